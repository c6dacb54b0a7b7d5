/**
 * Drives web/index.html in a headless browser: `node browser.mjs ADDRESS STEPS`.
 *
 * STEPS is a JSON array of [name, argument]; prints a JSON array with what the page shows after
 * each: {request, status, error, layers, width, height, pixels, saved}, pixels being RGBA in base64.
 */

import { readFileSync } from "node:fs";

// Makes the package bring the libraries that a bare machine lacks.
process.env.AWS_EXECUTION_ENV ??= "AWS_Lambda_nodejs20.x";
const { default: chromium } = await import("@sparticuz/chromium");
const { chromium: driver } = await import("playwright-core");

const [address, steps] = process.argv.slice(2);
const executablePath = await chromium.executablePath();
const browser = await driver.launch({ executablePath, args: chromium.args, headless: true });
// The canvas then has 640 by 480 pixels.
const page = await browser.newPage({ viewport: { width: 640 + 252, height: 480 } });
const problems = [];
page.on("pageerror", (error) => problems.push(String(error)));
page.on("console", (m) => m.type() === "error" && problems.push(m.text()));

let saved = null; // the file that was downloaded last, in base64

const actions = {
  async drop(path) {
    const bytes = readFileSync(path).toString("base64");
    const data = await page.evaluateHandle((text) => {
      const transfer = new DataTransfer();
      const content = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
      transfer.items.add(new File([content], "dropped.pxi"));
      return transfer;
    }, bytes);
    await page.dispatchEvent("body", "drop", { dataTransfer: data });
  },
  async wheel([x, y, delta]) {
    await page.mouse.move(x, y);
    await page.mouse.wheel(0, delta);
  },
  async drag([x, y, dx, dy]) {
    await page.mouse.move(x, y);
    await page.mouse.down();
    await page.mouse.move(x + dx, y + dy);
    await page.mouse.up();
  },
  async key(name) {
    await page.keyboard.press(name);
  },
  async pinch([from, to]) {
    const session = await page.context().newCDPSession(page);
    const touch = (type, places) => session.send("Input.dispatchTouchEvent", {
      type, touchPoints: places.map(([x, y], id) => ({ x, y, id })),
    });
    await touch("touchStart", from);
    await touch("touchMove", to);
    await touch("touchEnd", []);
  },
  async element([bytes, attributes]) {
    saved = await page.evaluate(async ([text, given]) => {
      await import(new URL("pxi-wasm/element.js", location.href));
      const element = document.createElement("pxi-image");
      const content = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
      const src = URL.createObjectURL(new Blob([content]));
      for (const [key, value] of Object.entries({ src, ...given })) element.setAttribute(key, value);
      const done = new Promise((resolve, reject) => {
        element.addEventListener("load", resolve);
        element.addEventListener("error", ({ message }) => reject(new Error(message)));
      });
      document.body.append(element);
      await done;
      return element.shadowRoot.querySelector("canvas").toDataURL().split(",")[1];
    }, [readFileSync(bytes).toString("base64"), attributes]);
  },
  async save() {
    const [download] = await Promise.all([page.waitForEvent("download"), page.click("#save")]);
    saved = readFileSync(await download.path()).toString("base64");
  },
  async toggle(layer) {
    await page.getByLabel(layer, { exact: true }).click();
  },
  async time(seconds) {
    await page.evaluate((value) => {
      const input = document.getElementById("time");
      input.value = value;
      input.dispatchEvent(new Event("input"));
    }, seconds);
  },
  async play() {
    await page.click("#play");
    await page.waitForTimeout(500);
    await page.click("#play");
  },
};

/** What the page shows once nothing changes any more. */
async function shown() {
  await page.waitForTimeout(150);
  await page.waitForSelector("body[data-idle='true'], #error:not(:empty)", { timeout: 20000 });
  return page.evaluate(() => {
    const canvas = document.getElementById("screen");
    const { width, height } = canvas;
    const { data } = canvas.getContext("2d").getImageData(0, 0, width, height);
    let pixels = "";
    for (const byte of data) pixels += String.fromCharCode(byte);
    return {
      request: JSON.parse(document.body.dataset.request ?? "null"),
      error: document.getElementById("error").textContent,
      layers: [...document.querySelectorAll("#layers label")].map((row) => row.textContent),
      time: Number(document.getElementById("time").value),
      width, height, pixels: btoa(pixels),
    };
  });
}

await page.goto(address);
const found = [];
for (const [name, argument] of JSON.parse(steps)) {
  await actions[name](argument);
  found.push({ ...(await shown()), saved });
}
await browser.close();
console.log(JSON.stringify({ found, problems }));

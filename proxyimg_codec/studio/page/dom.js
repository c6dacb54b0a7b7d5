/** Small pieces that the page is built of. */
import { ICONS } from "./bundled/icons.js";

/**
 * Makes an element. Properties that begin with "on" are listeners, "class", "data-..." and "aria-..."
 * are attributes, the rest are properties of the element.
 * @param {string} tag @param {Record<string, any>} [props] @param {...any} children
 * @returns {any}
 */
export function h(tag, props = {}, ...children) {
  const element = document.createElement(tag);
  for (const [key, value] of Object.entries(props)) {
    if (value === undefined || value === null) continue;
    if (key.startsWith("on")) element.addEventListener(key.slice(2), value);
    else if (key === "class" || key === "for" || key === "role" || key.includes("-")) element.setAttribute(key, String(value));
    else if (key === "style") element.style.cssText = value;
    else element[key] = value;
  }
  element.append(...children.flat().filter((c) => c !== null && c !== undefined && c !== false));
  return element;
}

const SVG = "http://www.w3.org/2000/svg";

/** Makes an SVG element. @param {string} tag @param {Record<string, any>} [attributes] @returns {any} */
export function s(tag, attributes = {}, ...children) {
  const element = document.createElementNS(SVG, tag);
  for (const [key, value] of Object.entries(attributes)) if (value !== undefined && value !== null) element.setAttribute(key, value);
  element.append(...children);
  return element;
}

/** @param {string} name @param {number} [size] */
export function icon(name, size = 16) {
  const svg = s("svg", { viewBox: "0 0 24 24", width: size, height: size, class: "icon", "aria-hidden": "true" });
  svg.innerHTML = ICONS[name] ?? "";
  return svg;
}

/**
 * A button. Without text its label is for screen readers and the tip.
 * @param {{icon?: string, text?: string, label?: string, keys?: string, class?: string, onclick?: (e: any) => void,
 *   pressed?: boolean, disabled?: boolean, id?: string, size?: number}} options
 */
export function button({ icon: name, text, label, keys, pressed, size, ...rest }) {
  const tip = label && (keys ? `${label}  (${keys})` : label);
  return h("button", {
    type: "button", title: tip, "aria-label": text ? undefined : label, "aria-pressed": pressed, "aria-keyshortcuts": keys && /^[\w+]+$/.test(keys) ? keys : undefined,
    ...rest, class: `button ${text ? "" : "bare"} ${rest.class ?? ""}`,
  }, name && icon(name, size), text && h("span", {}, text));
}

let unique = 0;

/**
 * A labelled slider with a number beside it.
 * @param {{label: string, min: number, max: number, step?: number, value: number, unit?: string, neutral?: number,
 *   oninput?: (v: number) => void, onchange?: (v: number) => void}} options
 */
export function slider({ label, min, max, step = 1, value, unit = "", neutral, oninput, onchange }) {
  const id = `s${++unique}`;
  const shown = (/** @type {number} */ v) => `${Number(v.toFixed(step < 0.1 ? 2 : step < 1 ? 1 : 0))}${unit}`;
  const number = h("output", { class: "value", htmlFor: id }, shown(value));
  const fill = () => range.style.setProperty("--at", `${((+range.value - min) / (max - min)) * 100}%`);
  const set = (/** @type {number} */ v) => { range.value = String(v); number.textContent = shown(v); fill(); };
  const range = h("input", {
    type: "range", id, min, max, step, value,
    oninput: () => { number.textContent = shown(+range.value); fill(); oninput?.(+range.value); },
    onchange: () => onchange?.(+range.value),
    ondblclick: () => { if (neutral !== undefined) { set(neutral); oninput?.(neutral); onchange?.(neutral); } },
  });
  fill();
  const row = h("div", { class: "slider" }, h("label", { for: id }, label), range, number);
  return Object.assign(row, { set });
}

/** A labelled number, stepped with the arrow keys. @param {{label: string, value: number, unit?: string, onchange: (v: number) => void, title?: string, digits?: number}} options */
export function number({ label, value, unit = "", onchange, title, digits = 1 }) {
  const id = `n${++unique}`;
  const text = (/** @type {number} */ v) => String(Number(v.toFixed(digits)));
  const input = h("input", {
    id, type: "text", inputMode: "decimal", value: text(value), title: title ?? label, autocomplete: "off",
    onfocus: () => input.select(),
    onchange: () => { const v = Number(input.value.replace(",", ".")); if (Number.isFinite(v)) onchange(v); else input.value = text(value); },
    onkeydown: (/** @type {KeyboardEvent} */ e) => {
      const by = e.key === "ArrowUp" ? 1 : e.key === "ArrowDown" ? -1 : 0;
      if (by) { e.preventDefault(); input.value = text(Number(input.value) + by * (e.shiftKey ? 10 : 1)); input.dispatchEvent(new Event("change")); }
      if (e.key === "Enter") input.blur();
      if (e.key !== "Tab") e.stopPropagation();
    },
  });
  return Object.assign(h("div", { class: "number" }, h("label", { for: id, title: title ?? label }, label), input, unit && h("span", { class: "unit" }, unit)), { show: (/** @type {number} */ v) => { input.value = text(v); } });
}

/** Puts text into the clipboard, and says so on the button. @param {any} from @param {string} text */
export async function copy(from, text) {
  try { await navigator.clipboard.writeText(text); } catch {
    const area = h("textarea", { value: text, class: "away" });
    document.body.append(area);
    area.select();
    document.execCommand("copy");
    area.remove();
  }
  from.classList.add("done");
  setTimeout(() => from.classList.remove("done"), 1200);
}

/** A field for a name in place of an element. @param {any} element @param {string} name @param {(name: string) => void} done */
export function rename(element, name, done) {
  let over = false;
  const finish = (/** @type {boolean} */ keep) => {
    if (over) return;
    over = true;
    input.replaceWith(element);
    const value = input.value.trim();
    if (keep && value && value !== name) done(value);
  };
  const input = h("input", {
    class: "rename", value: name, "aria-label": `Name of ${name}`, spellcheck: false, maxLength: 200,
    onblur: () => finish(true),
    onkeydown: (/** @type {KeyboardEvent} */ e) => {
      e.stopPropagation();
      if (e.key === "Enter") finish(true);
      if (e.key === "Escape") finish(false);
    },
    onpointerdown: (/** @type {Event} */ e) => e.stopPropagation(),
  });
  element.replaceWith(input);
  input.focus();
  input.select();
}

/** @param {number} bytes */
export function size(bytes) {
  return bytes < 1000 ? `${bytes} B` : bytes < 1e6 ? `${(bytes / 1000).toFixed(bytes < 1e4 ? 1 : 0)} kB` : `${(bytes / 1e6).toFixed(1)} MB`;
}

/** Calls a function when it has not been called for a while. @template {any[]} A @param {(...args: A) => void} fn @param {number} wait */
export function later(fn, wait) {
  let timer = 0;
  return Object.assign((/** @type {A} */ ...args) => { clearTimeout(timer); timer = window.setTimeout(() => fn(...args), wait); }, { cancel: () => clearTimeout(timer) });
}

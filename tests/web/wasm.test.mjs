/** The decoder of web/pxi-wasm: `node --test wasm.test.mjs`, with the files of PXI_STILL and PXI_MOVING. */

import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";
import * as plain from "../../web/pxi/index.js";
import { Image, MODEL_FILES, PxiError, loadModel, render } from "../../web/pxi-wasm/index.js";

const bytes = new Uint8Array(readFileSync(process.env.PXI_STILL));
const moving = new Uint8Array(readFileSync(process.env.PXI_MOVING));
const stop = new Error("stop");

/** A signal that stops at the first word of progress after `calls`. */
function stopping(calls) {
  const controller = new AbortController();
  let left = calls;
  return { signal: controller.signal, progress: () => left-- > 0 || controller.abort(stop) };
}

test("what a file holds is told as the plain decoder tells it", async () => {
  for (const content of [bytes, moving]) {
    const image = await Image.open(content);
    const other = await plain.Image.open(content, loadModel);
    assert.deepEqual([image.width, image.height], [other.width, other.height]);
    assert.deepEqual(image.names, other.names);
    assert.equal(image.motion?.duration, other.motion?.duration);
  }
});

test("without WebAssembly the plain decoder draws the same", async () => {
  const options = { width: 23, dtype: "uint16" };
  const [one, two] = [await Image.open(bytes), await Image.open(bytes, loadModel, {}, { plain: true })]
    .map((image) => render(image, options));
  assert.deepEqual([one.width, one.height, one.opaque], [two.width, two.height, two.opaque]);
  assert.equal(one.data.length, 4 * one.width * one.height);
  assert.ok(one.data.every((value, i) => Math.abs(value - two.data[i]) <= 64));
});

test("machines without WebAssembly take the plain decoder", async () => {
  const { validate } = WebAssembly;
  WebAssembly.validate = () => false;
  try {
    const image = await Image.open(bytes);
    const same = await Image.open(bytes, loadModel, {}, { plain: true });
    assert.deepEqual(render(image, { width: 9 }).data, render(same, { width: 9 }).data);
  } finally {
    WebAssembly.validate = validate;
  }
});

test("a damaged file is refused with its rule", async () => {
  await assert.rejects(Image.open(bytes.slice(0, -5)), (error) => {
    return error instanceof PxiError && error.kind === "invalid" && /^[A-Z]{3}-\d+$/.test(error.rule);
  });
});

test("limits hold for opening and for one picture", async () => {
  await assert.rejects(Image.open(bytes, loadModel, { file_bytes: 9 }), { kind: "limit" });
  await assert.rejects(Image.open(bytes, loadModel, { bogus: 9 }), { kind: "usage" });
  const image = await Image.open(bytes);
  assert.throws(() => render(image, { limits: { output_pixels: 50 } }), { kind: "limit" });
  assert.equal(render(image, { width: 30 }).width, 30);
});

test("a signal stops opening and drawing, after which the picture is drawn all the same", async () => {
  await assert.rejects(Image.open(bytes, loadModel, {}, { signal: AbortSignal.abort(stop) }), stop);
  await assert.rejects(Image.open(bytes, loadModel, {}, stopping(0)), stop);
  const image = await Image.open(bytes);
  const before = render(image, { width: 31 });
  assert.throws(() => render(image, { width: 31, ...stopping(1) }), stop);
  assert.deepEqual(render(image, { width: 31 }), before);
});

test("progress grows to the whole", async () => {
  const image = await Image.open(bytes);
  const shares = [];
  render(image, { progress: (share) => shares.push(share) });
  assert.ok(shares.every((share, i) => share >= (shares[i - 1] ?? 0)));
  assert.equal(shares.at(-1), 1);
});

test("a draft shows the same less exactly", async () => {
  const [draft, whole] = [true, false].map((draft) => ({ width: 5, draft }));
  const image = await Image.open(bytes);
  const coarse = render(image, draft).data;
  const exact = render(image, whole).data;
  assert.ok(coarse.every((value, i) => Math.abs(value - exact[i]) < 40));
});

test("models are read when a file needs them, and missing ones are an error", async () => {
  const asked = [];
  const load = async (model) => asked.push(model) && readFileSync(MODEL_FILES[model]);
  await Image.open(bytes, load);
  const needed = (await plain.Image.open(bytes, loadModel)).plans.length > 0;
  assert.equal(asked.length > 0, needed);
  if (!needed) return;
  await assert.rejects(Image.open(bytes, async () => { throw stop; }), stop);
  const damaged = await Image.open(bytes, async () => new Uint8Array(20));
  assert.throws(() => render(damaged), { kind: "unsupported" });
});

/** A decoder of .pxi files: libpxi as WebAssembly, or the plain decoder where there is none. */

import { PxiError } from "../pxi/errors.js";
import { MODEL_FILES } from "../pxi/registered.js";
import { requested } from "../pxi/request.js";
import { Instance, runs } from "./module.js";

export { MODEL_FILES, PxiError };

const MODULE = new URL("pxi.wasm", import.meta.url);

async function bytesOf(url) {
  if (url.protocol === "file:") {
    const { readFile } = await import(/* webpackIgnore: true */ /* @vite-ignore */ "node:fs/promises");
    return new Uint8Array(await readFile(url));
  }
  return new Uint8Array(await (await answerOf(url)).arrayBuffer());
}

async function answerOf(url) {
  const answer = await fetch(url);
  if (!answer.ok) throw new PxiError("io", `${url}: ${answer.status}`);
  return answer;
}

const kept = new Map();

/** What `make` promises, made once; what has failed is tried again. */
function once(key, make) {
  if (!kept.has(key)) kept.set(key, make().catch((error) => { kept.delete(key); throw error; }));
  return kept.get(key);
}

const compiled = () => once("module", async () => {
  if (MODULE.protocol === "file:") return WebAssembly.compile(await bytesOf(MODULE));
  const answer = await answerOf(MODULE);
  const streams = answer.headers.get("Content-Type") === "application/wasm";
  return streams ? WebAssembly.compileStreaming(answer) : WebAssembly.compile(await answer.arrayBuffer());
});
const plain = () => once("plain", () => import("../pxi/index.js"));

/** Begins to fetch and compile the decoder, before there is a file. */
export function prepare() {
  if (runs()) compiled().catch(() => {});
}

const PACKED = ["iCCp", "eXIf", "xMPd", "mOTN"]; // chunks that hold zstd frames

/** What decoding a file will need, as far as can be seen at once: a model, and what inflates zstd frames. */
function glance(bytes) {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.length);
  const found = { model: null, packed: false };
  for (let at = 12; at + 12 <= bytes.length; at += 12 + view.getUint32(at + 4, true)) {
    const kind = String.fromCharCode(...bytes.subarray(at, at + 4));
    found.packed ||= PACKED.includes(kind);
    // PLAN is an array, which begins with the number of its model.
    if (kind === "PLAN" && bytes[at + 8] >> 4 === 9 && MODEL_FILES[bytes[at + 9]]) found.model ??= bytes[at + 9];
  }
  return found;
}

/** The bytes of a registered model, fetched or read once. */
export function loadModel(model) {
  return once(model, () => bytesOf(MODEL_FILES[model]));
}

/** A picture that was read: its canvas, layers, motion and metadata. */
export class Image {
  #instance;
  #plain;

  constructor(found, instance, decoder) {
    Object.assign(this, found);
    this.#instance = instance;
    this.#plain = decoder;
  }

  /**
   * Reads and checks a file; throws PxiError, or the reason of the signal.
   *
   * `load(number)` promises the bytes of a registered model. `options` are {signal, progress(share), plain};
   * `plain` takes the plain decoder in any case.
   */
  static async open(content, load = loadModel, limits = {}, { signal, progress, plain: wanted = !runs() } = {}) {
    signal?.throwIfAborted();
    const bytes = content instanceof ArrayBuffer ? new Uint8Array(content) : content;
    // Pages may forbid what the machine runs.
    if (wanted) return openPlain(bytes, load, limits, signal);
    const { model: first, packed } = glance(bytes);
    const early = first === null ? null : (async () => load(first))();
    early?.catch(() => {}); // it is awaited below, unless something else fails before
    const inflater = packed ? import("../pxi/zstd.js") : null;
    const module = await compiled().catch(() => null);
    signal?.throwIfAborted();
    if (!module) return openPlain(bytes, async (model) => (model === first ? early : load(model)), limits, signal);
    const unzstd = (await inflater)?.unzstd;
    const instance = new Instance(module, Uint8Array.from(bytes), limits, telling(signal, progress), unzstd);
    const { models, layers, duration, fps, opaque, ...rest } = instance.describe();
    for (const model of models) {
      const name = MODEL_FILES[model].pathname.split("/").pop();
      instance.teach(name, new Uint8Array(await (model === first ? early : load(model))));
      signal?.throwIfAborted();
    }
    const motion = duration ? { duration, fps } : null;
    return new Image({ ...rest, names: layers, motion, head: { opaque } }, instance, null);
  }

  /** Whether the plain decoder draws it. */
  get plain() {
    return this.#instance === null;
  }

  /** What `render` does. */
  draw({ signal, progress, draft = false, ...options } = {}) {
    signal?.throwIfAborted();
    const all = { dtype: "uint8", ...options };
    const request = requested(this, all);
    const told = telling(signal, progress);
    if (this.#instance) return this.#instance.render(request, all.t ?? null, all.limits ?? {}, told, draft);
    const { image, render: drawn } = this.#plain;
    const count = request.width * request.height;
    let done = 0;
    const found = drawn(image, { ...all, progress: (pixels) => told((done += pixels) / count) });
    return found.channels === 4 ? { ...found, opaque: false } : withAlpha(found);
  }
}

async function openPlain(bytes, load, limits, signal) {
  const { Image: Plain, render: drawn } = await plain();
  const image = await Plain.open(Uint8Array.from(bytes), async (model) => new Uint8Array(await load(model)), limits);
  signal?.throwIfAborted();
  const { width, height, head, names } = image;
  const motion = image.motion && { duration: image.motion.duration };
  return new Image({ width, height, head, names, motion, metadata: [] }, null, { image, render: drawn });
}

/** A function that takes the share that is done, and throws when the signal says to stop. */
function telling(signal, progress) {
  return (share) => {
    progress?.(share);
    signal?.throwIfAborted();
  };
}

/** Opaque colours as RGBA. */
function withAlpha({ width, height, data }) {
  const top = { Uint8ClampedArray: 255, Uint16Array: 65535, Float32Array: 1 }[data.constructor.name];
  const out = new data.constructor(4 * width * height).fill(top);
  for (let i = 0, from = 0; i < out.length; i += 4, from += 3) {
    for (let c = 0; c < 3; c++) out[i + c] = data[from + c];
  }
  return { width, height, channels: 4, opaque: true, data: out };
}

/**
 * Draws a picture: {width, height, channels: 4, opaque, data}, straight RGBA.
 *
 * `options` are those of the plain decoder, only that `dtype` is "uint8" by default, `progress` takes the share
 * that is done, 0..1, and `signal` may stop it. `draft` draws small pictures less exactly, in a fraction of the time.
 */
export function render(image, options) {
  return image.draw(options);
}

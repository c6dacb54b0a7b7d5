/** The WebAssembly module (libpxi/wasm/host.cpp): one instance for each file. */

import { PxiError } from "../pxi/errors.js";

const KINDS = { 2: "usage", 3: "io", 4: "invalid", 5: "unsupported", 6: "limit" };
const INFO = ["width", "height", "opaque", "depth", "layers", "plans", "blocks", "duration", "fps",
  "primaries", "transfer"];
const FORMATS = {
  uint8: [0, Uint8ClampedArray], uint16: [1, Uint16Array], float32: [2, Float32Array],
};
/** A module with one instruction of SIMD. */
const SIMD = Uint8Array.of(0, 97, 115, 109, 1, 0, 0, 0, 1, 5, 1, 96, 0, 1, 123, 3, 2, 1, 0, 10, 10, 1, 8,
  0, 65, 0, 253, 15, 253, 98, 11);

/** Whether the machine runs the module. */
export function runs() {
  return typeof WebAssembly === "object" && WebAssembly.validate(SIMD);
}

const text = (bytes) => new TextDecoder().decode(bytes);

/**
 * A file in an instance of the module.
 *
 * A failure leaves the instance as it was amid the work, so that it is given up: the next call makes another
 * one, which reads the file again.
 */
export class Instance {
  #module;
  #bytes;
  #limits;
  #unzstd;
  #models = new Map();
  #exports = null;
  #progress = () => {};

  /**
   * Reads and checks a file (Uint8Array); `progress(share)` may throw to stop it. `unzstd(frame, size)` inflates, if
   * the file holds zstd frames.
   */
  constructor(module, bytes, limits, progress = () => {}, unzstd = null) {
    this.#module = module;
    this.#bytes = bytes;
    this.#limits = limits;
    this.#unzstd = unzstd;
    this.#attempt(progress, () => {});
  }

  /** Does some work in the instance. */
  #attempt(progress, work) {
    this.#progress = progress;
    try {
      if (!this.#exports) this.#start();
      return work(this.#exports);
    } catch (error) {
      this.#exports = null;
      throw error;
    }
  }

  #start() {
    const pxi = {
      exp: Math.exp,
      exp2: (x) => 2 ** x,
      log: Math.log,
      progress: (share) => this.#progress(share),
      inflate: (at, count, to, size) =>
        this.#view(Uint8Array, to, size).set(this.#unzstd(this.#view(Uint8Array, at, count).slice(), size)),
      failed: (kind, rule, message, chunk, offset) => {
        const [of, why] = [this.#string(chunk), this.#string(message)];
        const error = new PxiError(KINDS[kind], of ? `chunk ${of}: ${why}` : why);
        throw Object.assign(error, { rule: this.#string(rule), offset: Number(offset) });
      },
    };
    this.#exports = new WebAssembly.Instance(this.#module, { pxi }).exports;
    this.#exports._initialize();
    for (const [name, value] of Object.entries(this.#limits)) this.#limit(name, value);
    for (const [name, weights] of this.#models) this.#teach(name, weights);
    const at = this.#put(this.#bytes);
    this.#exports.open(at, this.#bytes.length);
    this.#exports.give_up(at);
  }

  #view(Type, at, count) {
    return new Type(this.#exports.memory.buffer, at >>> 0, count);
  }

  #put(bytes) {
    const at = this.#exports.room(bytes.length);
    this.#view(Uint8Array, at, bytes.length).set(bytes);
    return at;
  }

  #string(at) {
    const memory = new Uint8Array(this.#exports.memory.buffer);
    return text(memory.slice(at >>> 0, memory.indexOf(0, at >>> 0)));
  }

  #named(name) {
    return this.#put(new TextEncoder().encode(`${name}\0`));
  }

  #limit(name, value) {
    const at = this.#named(name);
    this.#exports.limit(at, value);
    this.#exports.give_up(at);
  }

  #teach(name, weights) {
    const at = this.#named(name);
    this.#exports.model(at, this.#put(weights), weights.length);
    this.#exports.give_up(at);
  }

  /** Numbers by their names in INFO, layers {name, hidden}, metadata {kind, bytes}, and models: their numbers. */
  describe() {
    return this.#attempt(() => {}, (e) => {
      const values = [...this.#view(Int32Array, e.info(), INFO.length)];
      const { layers, plans, blocks, ...rest } = Object.fromEntries(INFO.map((key, i) => [key, values[i]]));
      const each = (count, make) => Array.from({ length: count }, (_, i) => make(i));
      const copy = (at, count) => this.#view(Uint8Array, at, count).slice();
      return {
        ...rest,
        layers: each(layers, (i) => ({ name: text(copy(e.name(i), e.name_size(i))), hidden: e.hidden(i) === 1 })),
        metadata: each(blocks, (i) => ({ kind: this.#string(e.kind(i)), bytes: copy(e.block(i), e.block_size(i)) })),
        models: [...new Set(each(plans, (i) => e.plan_model(i)))],
      };
    });
  }

  /** Takes the weights of a model by the name of its file. */
  teach(name, weights) {
    this.#models.set(name, weights);
    this.#attempt(() => {}, () => this.#teach(name, weights));
  }

  /** Draws what `requested` (request.js) has checked; `t` in seconds or null. RGBA, straight. `draft`: coarsely. */
  render({ region, width, height, drawn, dtype }, t, limits, progress, draft) {
    return this.#attempt(progress, (e) => {
      for (const [name, value] of Object.entries(limits)) this.#limit(name, value);
      for (const layer of drawn) e.draw(layer);
      const [format, Type] = FORMATS[dtype];
      const at = e.render(...region, width, height, format, t === null ? 0 : 1, t ?? 0, draft);
      const data = this.#view(Type, at, 4 * width * height).slice();
      e.give_up(at);
      return { width, height, channels: 4, opaque: e.opaque() === 1, data };
    });
  }
}

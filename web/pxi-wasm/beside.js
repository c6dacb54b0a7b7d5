/** Pictures that a worker decodes beside the page, which stays alive. */

import { PxiError } from "../pxi/errors.js";

const COARSE = 1 / 8; // detail of a first picture, which takes a fraction of the time

/** The bytes of an address, a Blob, an ArrayBuffer or a Uint8Array. */
async function bytesOf(source, signal) {
  if (source instanceof Uint8Array) return source;
  if (source instanceof ArrayBuffer) return new Uint8Array(source);
  if (source instanceof Blob) return new Uint8Array(await source.arrayBuffer());
  const answer = await fetch(source, { signal });
  if (!answer.ok) throw new PxiError("io", `${source}: ${answer.status}`);
  return new Uint8Array(await answer.arrayBuffer());
}

/** A picture {width, height, names, motion, metadata}, in a worker of its own. */
export class Picture {
  #worker = null;
  #waiting = new Map(); // calls by number
  #last = 0;
  #opened; // how to open it again

  /**
   * Reads and checks a file, and promises the picture; throws PxiError, or the reason of the signal.
   *
   * `options` are {signal, progress(share), limits, plain}.
   */
  static async open(source, { signal, progress, limits = {}, plain } = {}) {
    signal?.throwIfAborted();
    const picture = new Picture();
    picture.#start(); // while the file comes
    try {
      picture.#opened = { task: "open", bytes: await bytesOf(source, signal), limits, plain };
      return Object.assign(picture, await picture.#ask(picture.#opened, { signal, progress }));
    } catch (error) {
      picture.close();
      throw error;
    }
  }

  /** What `render` of index.js returns. */
  render({ signal, progress, ...options } = {}) {
    return this.#ask({ task: "render", options }, { signal, progress });
  }

  /** The same as ImageBitmap, its colours as its profile tells. */
  bitmap({ signal, progress, ...options } = {}) {
    return this.#ask({ task: "bitmap", options }, { signal, progress });
  }

  /** The same as bytes of a PNG file, with the profile. */
  png({ signal, progress, ...options } = {}) {
    return this.#ask({ task: "png", options }, { signal, progress });
  }

  /** Gives `show(bitmap, coarse)` a coarse bitmap of {width, height, ..} first, then the whole one. */
  async show({ width, height, ...options }, show) {
    const least = (size) => Math.max(Math.round(size * COARSE), 1);
    show(await this.bitmap({ ...options, width: least(width), height: least(height), draft: true }), true);
    show(await this.bitmap({ ...options, width, height }), false);
  }

  /** Ends the worker and gives its memory up; the next call starts another one. */
  close() {
    this.#worker?.terminate();
    this.#worker = null;
    const ended = new DOMException("the picture was closed", "AbortError");
    for (const { reject } of this.#waiting.values()) reject(ended);
    this.#waiting.clear();
  }

  #start() {
    this.#worker = new Worker(new URL("worker.js", import.meta.url), { type: "module" });
    this.#worker.onmessage = ({ data }) => this.#heard(data);
    this.#worker.onerror = ({ message }) => {
      for (const { reject } of this.#waiting.values()) reject(new Error(message ?? "the worker does not start"));
      this.#waiting.clear();
      this.close();
    };
  }

  #heard({ id, share, answer, error, ...why }) {
    const call = this.#waiting.get(id);
    if (!call) return;
    if (share !== undefined) return call.progress(share);
    this.#waiting.delete(id);
    if (error === undefined) call.resolve(answer);
    else call.reject(why.kind ? Object.assign(new PxiError(why.kind, error), why) : new Error(error));
  }

  #ask(message, { signal, progress }) {
    return new Promise((resolve, reject) => {
      signal?.throwIfAborted();
      const id = ++this.#last;
      const stop = () => this.#stop(id, signal.reason);
      const end = (then) => (value) => {
        signal?.removeEventListener("abort", stop);
        then(value);
      };
      signal?.addEventListener("abort", stop);
      const call = { message: { ...message, id, wants: Boolean(progress) }, progress,
        resolve: end(resolve), reject: end(reject) };
      const asleep = !this.#worker;
      this.#waiting.set(id, call);
      if (asleep) this.#resume();
      else this.#worker.postMessage(call.message);
    });
  }

  /** A worker does not listen while it works: what it does for a call that is stopped ends with it. */
  #stop(id, reason) {
    const call = this.#waiting.get(id);
    if (!call) return;
    this.#waiting.delete(id);
    call.reject(reason);
    this.#worker?.terminate();
    this.#worker = null;
    if (this.#waiting.size) this.#resume();
  }

  /** Starts a worker with the calls that wait. */
  #resume() {
    this.#start();
    const calls = [...this.#waiting.values()];
    if (calls[0].message.task !== "open") this.#worker.postMessage({ ...this.#opened, id: 0 });
    for (const { message } of calls) this.#worker.postMessage(message);
  }
}

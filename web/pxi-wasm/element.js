/**
 * `<pxi-image src="picture.pxi" layers="sky,2" time="1.5" alt="…">`: a picture as large as its style says, or as its
 * canvas. `layers` are names or numbers, `time` is in seconds. Fires "load" and "error".
 */

import { Picture } from "./beside.js";

const STYLE = `:host { display: inline-block; max-width: 100%; }
  :host([hidden]) { display: none; }
  canvas { display: block; width: 100%; height: 100%; }`;

export class PxiImage extends HTMLElement {
  static observedAttributes = ["src", "layers", "time", "alt"];
  #canvas = document.createElement("canvas");
  #sizes = new ResizeObserver(() => this.#refresh());
  #opening = null; // controller of the file that is opened
  #work = null; // the drawing that is under way
  #stale = false;
  #shown = {}; // the picture, and what was asked of it
  /** The picture that is shown (beside.js), or null. */
  picture = null;

  constructor() {
    super();
    const style = Object.assign(document.createElement("style"), { textContent: STYLE });
    this.attachShadow({ mode: "open" }).append(style, this.#canvas);
    this.#canvas.role = "img";
  }

  connectedCallback() {
    this.#sizes.observe(this);
    if (!this.picture) this.#open();
  }

  disconnectedCallback() {
    this.#sizes.disconnect();
    this.#close();
  }

  attributeChangedCallback(name) {
    if (name === "alt") this.#canvas.ariaLabel = this.getAttribute("alt");
    else if (!this.isConnected) return;
    else if (name === "src") this.#open();
    else this.#refresh();
  }

  #close() {
    this.#opening?.abort();
    this.picture?.close();
    this.picture = null;
  }

  async #open() {
    this.#close();
    const source = this.getAttribute("src");
    if (!source) return;
    const own = (this.#opening = new AbortController());
    try {
      const picture = await Picture.open(new URL(source, document.baseURI), { signal: own.signal });
      if (own.signal.aborted) return picture.close();
      this.picture = picture;
      Object.assign(this.#canvas, { width: picture.width, height: picture.height });
      this.style.aspectRatio ||= `${picture.width} / ${picture.height}`;
      await this.#refresh();
      if (this.picture === picture) this.dispatchEvent(new Event("load"));
    } catch (error) {
      if (!own.signal.aborted) this.#failed(error);
    }
  }

  #failed(error) {
    this.dispatchEvent(new ErrorEvent("error", { error, message: error.message }));
  }

  /** What the attributes ask for, in the pixels of the screen. */
  #wanted() {
    const { width, height } = this.picture;
    const shown = this.#canvas.clientWidth * devicePixelRatio;
    const scale = Math.min(shown ? shown / width : 1, 1);
    const pixels = (size) => Math.max(Math.round(size * scale), 1);
    const names = this.getAttribute("layers")?.split(",").map((name) => name.trim());
    const layers = names?.map((name) => (/^-?\d+$/.test(name) ? Number(name) : name)) ?? null;
    const time = this.getAttribute("time");
    const t = time === null ? null : Number(time);
    return { width: pixels(width), height: pixels(height), layers, t };
  }

  #refresh() {
    this.#stale = true;
    this.#work ??= this.#draw().finally(() => (this.#work = null));
    return this.#work;
  }

  /** Draws as long as something has changed: one picture at a time, the newest next, new ones coarsely first. */
  async #draw() {
    while (this.#stale && this.picture) {
      this.#stale = false;
      const { picture } = this;
      const wanted = this.#wanted();
      const key = JSON.stringify(wanted);
      const fresh = this.#shown.picture !== picture;
      if (!fresh && this.#shown.key === key) continue;
      const put = (bitmap) => this.picture === picture && this.#put(bitmap, wanted);
      try {
        if (fresh) await picture.show(wanted, put);
        else put(await picture.bitmap(wanted));
      } catch (error) {
        if (this.picture === picture) this.#failed(error);
      }
      this.#shown = { picture, key };
    }
  }

  #put(bitmap, { width, height }) {
    Object.assign(this.#canvas, { width, height });
    this.#canvas.getContext("2d").drawImage(bitmap, 0, 0, width, height);
    bitmap.close();
  }
}

customElements.define("pxi-image", PxiImage);

/** The canvas in the middle: draws, zooms, pans, and hands the pointer to the tool in use. */
import { h, later, s } from "./dom.js";
import { FlatPainter, Painter, accelerated } from "./painter.js";
import * as scene from "./scene.js";
import { pixels } from "./server.js";
import { emit, hover, on, store } from "./store.js";
import { Viewport } from "./viewport.js";

export const view = new Viewport();

/** Milliseconds between frames, from the pointer to the picture, and from rest to the exact picture: the last ones. */
export const times = { frames: /** @type {number[]} */ ([]), pointer: /** @type {number[]} */ ([]), exact: /** @type {number[]} */ ([]), calls: 0, drawn: 0 };

/** @typedef {{id: string, label: string, icon: string, keys: string, hint: string, cursor?: string,
 *   down?: (p: Place, e: PointerEvent) => void, drag?: (p: Place, e: PointerEvent) => void, up?: (p: Place, e: PointerEvent) => void,
 *   hover?: (p: Place, e: PointerEvent) => string|void, double?: (p: Place, e: MouseEvent) => void, key?: (e: KeyboardEvent) => boolean|void,
 *   overlay?: (add: (node: any) => void) => void, leave?: () => void, enter?: () => void, escape?: () => boolean|void}} Tool */
/** @typedef {{x: number, y: number, sx: number, sy: number}} Place */

/** @type {Record<string, Tool>} */
export const tools = {};

const sheet = h("canvas", { class: "sheet" });
const exact = h("canvas", { class: "sheet exact", hidden: true });
const paper = h("div", { class: "paper" });
const overlay = s("svg", { class: "overlay", "aria-hidden": "true" });
export const root = h("div", { class: "stage", tabIndex: 0, role: "application", "aria-label": "Canvas. Arrow keys nudge what is selected, or move the view; plus and minus zoom." }, paper, sheet, exact, overlay);

const ratio = () => Math.min(window.devicePixelRatio || 1, 3);
/** How to draw, if the address says so: `?draw=gl` or `?draw=flat`. */
const wanted = new URLSearchParams(location.search).get("draw");
/** @type {any} */
const painter = (wanted ? wanted === "gl" : accelerated()) ? new Painter(sheet) : new FlatPainter(sheet);
scene.paintWith(painter);

let asked = false, lastFrame = 0, pointerAt = 0;

/** Draws soon. */
export function draw() {
  if (asked) return;
  asked = true;
  requestAnimationFrame(frame);
}

/** @param {number} now */
function frame(now) {
  asked = false;
  const { state } = store;
  if (lastFrame && now - lastFrame < 250) note("frames", now - lastFrame);
  lastFrame = now;
  emit("frame", now);
  const list = state.stage === "editing" ? scene.items(skins()) : state.stage === "pointing" ? sourceItems() : [];
  if (state.stage !== "empty") painter.draw(list, view, ratio(), state.size);
  times.calls = painter.calls;
  times.drawn++;
  if (!exact.hidden && (scene.changed() || key() !== shownKey)) exact.hidden = true;
  paintOverlay();
  if (pointerAt) {
    const from = pointerAt;
    pointerAt = 0;
    requestAnimationFrame((t) => note("pointer", t - from));
  }
}

/** @param {"frames"|"pointer"|"exact"} what @param {number} value */
function note(what, value) {
  times[what].push(value);
  if (times[what].length > 600) times[what].shift();
}

function paintOverlay() {
  const nodes = /** @type {any[]} */ ([]);
  const { state } = store;
  root.dataset.stage = state.stage;
  if (state.stage !== "empty") {
    const [x, y] = view.toScreen(0, 0);
    paper.style.cssText = `left:${x}px;top:${y}px;width:${state.size[0] * view.scale}px;height:${state.size[1] * view.scale}px`;
    for (const f of backdrops) f((node) => nodes.push(node));
    tools[store.tool]?.overlay?.((node) => nodes.push(node));
  }
  overlay.replaceChildren(...nodes);
}

/** Drawn under what the tool draws. @type {((add: (node: any) => void) => void)[]} */
export const backdrops = [];

/** Attribute that places canvas coordinates on the screen. */
export const placed = () => `matrix(${view.scale} 0 0 ${view.scale} ${view.x} ${view.y})`;

// The opened raster, while layers are pointed at.
let source = "";
function sourceItems() {
  const { state } = store, name = `source ${state.file} ${state.size}`;
  if (source !== name) {
    source = name;
    load(name).catch(() => { source = ""; });
  }
  return painter.has(name) ? [{ key: name, matrix: [1, 0, 0, 1, 0, 0], box: [0, 0, ...state.size], colour: null, opacity: 1 }] : [];
}

/** @param {string} name */
async function load(name) {
  const answer = await fetch(`/api/source.png?width=${Math.min(store.state.size[0], 2400)}`);
  if (!answer.ok) throw new Error(String(answer.status));
  const bitmap = await createImageBitmap(await answer.blob());
  const c = new OffscreenCanvas(bitmap.width, bitmap.height).getContext("2d");
  c?.drawImage(bitmap, 0, 0);
  painter.give(name, c?.getImageData(0, 0, bitmap.width, bitmap.height));
  draw();
}

// The exact picture, when nothing moves.
let shownKey = "", restedAt = 0;
/** @type {AbortController|null} */
let asking = null;

const key = () => `${store.state.version} ${view.x} ${view.y} ${view.scale} ${view.width} ${view.height} ${ratio()}`;

async function refine() {
  const { state } = store;
  if (state.stage !== "editing" || scene.changed() || playing() || pressed.size) return;
  const wanted = key(), seen = view.seen(state.size);
  if (!seen || (wanted === shownKey && !exact.hidden)) return;
  asking?.abort();
  asking = new AbortController();
  const [x, y, w, h] = seen, scale = view.scale * ratio();
  const width = Math.max(1, Math.round(w * scale)), height = Math.max(1, Math.round(h * scale));
  try {
    const got = await pixels(`/api/render?version=${state.version}&x=${x}&y=${y}&w=${w}&h=${h}&width=${width}&height=${height}&format=raw`, asking.signal);
    if (key() !== wanted || scene.changed() || playing()) return;
    exact.width = got.width;
    exact.height = got.height;
    exact.getContext("2d")?.putImageData(new ImageData(/** @type {any} */ (got.data), got.width, got.height), 0, 0);
    const [sx, sy] = view.toScreen(x, y);
    exact.style.cssText = `left:${sx}px;top:${sy}px;width:${w * view.scale}px;height:${h * view.scale}px`;
    exact.hidden = false;
    shownKey = wanted;
    if (restedAt) note("exact", performance.now() - restedAt);
    restedAt = 0;
    emit("exact");
  } catch { /* another state is there by now, and asks for its own picture */ }
}

const rest = later(refine, 60);
const sharpen = later(() => scene.load(view.scale * ratio()), 500);
/** Faint copies to draw behind layers. @type {() => {sway: Map<string, Float32Array>, share: number}[]} */
let skins = () => [];
/** @param {() => {sway: Map<string, Float32Array>, share: number}[]} value */
export function skinsFrom(value) { skins = value; }
/** Whether a motion plays. @type {() => boolean} */
let playing = () => false;
/** @param {() => boolean} value */
export function playsWhen(value) { playing = value; }

/** To be called when anything changed that the exact picture shows. */
export function unrest() {
  draw();
  rest();
}

function resize() {
  const box = root.getBoundingClientRect();
  if (!box.width) return;
  const [w, h] = [view.width, view.height];
  view.width = box.width;
  view.height = box.height;
  sheet.width = Math.round(box.width * ratio());
  sheet.height = Math.round(box.height * ratio());
  overlay.setAttribute("viewBox", `0 0 ${box.width} ${box.height}`);
  if (view.fitting && store.state.size) view.fit(store.state.size);
  else view.pan((box.width - w) / 2, (box.height - h) / 2);
  moved();
}

/** The view changed. */
export function moved() {
  emit("view");
  sharpen();
  unrest();
}

/** @param {number} factor @param {number} [x] @param {number} [y] */
export function zoom(factor, x, y) { view.zoom(factor, x, y); moved(); }
/** @param {number} dx @param {number} dy in CSS pixels */
export function pan(dx, dy) { view.pan(dx, dy); moved(); }
export function fit() { if (store.state.size) { view.fit(store.state.size); moved(); } }
/** @param {number} scale */
export function zoomTo(scale) { zoom(scale / view.scale); }

// Pointers: one works, two pinch, the middle button and the space bar pan.
/** @type {Map<number, {x: number, y: number}>} */
const pressed = new Map();
let panning = false, space = false, working = false;

/** @param {{clientX: number, clientY: number}} e @returns {Place} */
export function place(e) {
  const box = root.getBoundingClientRect(), sx = e.clientX - box.left, sy = e.clientY - box.top;
  const [x, y] = view.toCanvas(sx, sy);
  return { x, y, sx, sy };
}

root.addEventListener("pointerdown", (e) => {
  if (/** @type {Element} */ (e.target).closest(".float")) return;
  root.focus({ preventScroll: true });
  if (store.state.stage === "empty") return;
  try { root.setPointerCapture(e.pointerId); } catch { /* a made-up pointer has nothing to capture */ }
  const p = place(e);
  pressed.set(e.pointerId, { x: p.sx, y: p.sy });
  panning = e.button === 1 || space || store.tool === "hand" || pressed.size > 1;
  if (pressed.size > 1 && working) { working = false; tools[store.tool]?.escape?.(); }
  if (!panning && e.button === 0) { working = true; tools[store.tool]?.down?.(p, e); }
  draw();
});

root.addEventListener("pointermove", (e) => {
  if (store.state.stage === "empty") return;
  const p = place(e), at = pressed.get(e.pointerId), tool = tools[store.tool];
  emit("pointer", p);
  if (!at) {
    root.style.cursor = space || store.tool === "hand" ? "grab" : (tool?.hover?.(p, e) || tool?.cursor || "default");
    return;
  }
  if (panning) {
    const others = [...pressed].filter(([id]) => id !== e.pointerId).map(([, v]) => v);
    if (others.length === 1) {
      const [o] = others, before = Math.hypot(at.x - o.x, at.y - o.y), now = Math.hypot(p.sx - o.x, p.sy - o.y);
      view.pan((p.sx - at.x) / 2, (p.sy - at.y) / 2);
      if (before > 10) view.zoom(now / before, (p.sx + o.x) / 2, (p.sy + o.y) / 2);
    } else view.pan(p.sx - at.x, p.sy - at.y);
    root.style.cursor = "grabbing";
    moved();
  } else if (working) {
    if (!pointerAt) pointerAt = e.timeStamp;
    tool?.drag?.(p, e);
    draw();
  }
  pressed.set(e.pointerId, { x: p.sx, y: p.sy });
});

function release(/** @type {PointerEvent} */ e) {
  if (!pressed.delete(e.pointerId)) return;
  if (working && !pressed.size) {
    working = false;
    restedAt = performance.now();
    if (e.type === "pointercancel") tools[store.tool]?.escape?.();
    else tools[store.tool]?.up?.(place(e), e);
  }
  panning = pressed.size > 0;
  unrest();
}
root.addEventListener("pointerup", release);
root.addEventListener("pointercancel", release);
root.addEventListener("pointerleave", () => { if (!pressed.size) { hover(null); emit("pointer", null); } });
root.addEventListener("dblclick", (e) => { if (store.state.stage !== "empty" && !/** @type {Element} */ (e.target).closest(".float")) tools[store.tool]?.double?.(place(e), e); });
root.addEventListener("wheel", (e) => {
  if (store.state.stage === "empty") return;
  e.preventDefault();
  const p = place(e), lines = e.deltaMode === 1 ? 20 : 1;
  const pad = !e.ctrlKey && (e.deltaX !== 0 || e.shiftKey || (e.deltaMode === 0 && Math.abs(e.deltaY) < 40));
  if (pad) view.pan(-(e.shiftKey && !e.deltaX ? e.deltaY : e.deltaX) * lines, e.shiftKey && !e.deltaX ? 0 : -e.deltaY * lines);
  else view.zoom(Math.exp((-e.deltaY * lines * (e.ctrlKey && Math.abs(e.deltaY) < 40 ? 6 : 1)) / 500), p.sx, p.sy);
  moved();
}, { passive: false });

/** @param {boolean} value whether the space bar is down */
export function grab(value) {
  space = value;
  root.style.cursor = value ? "grab" : (tools[store.tool]?.cursor ?? "default");
}

new ResizeObserver(resize).observe(root);
matchMedia("(resolution: 1dppx)").addEventListener("change", resize);
on("state", (before) => {
  const { state } = store;
  if (state.stage !== "empty" && (before.stage === "empty" || String(before.size) !== String(state.size) || before.file !== state.file)) view.fit(state.size), emit("view");
  if (state.stage === "empty") { exact.hidden = true; source = ""; }
  scene.load(Math.min(view.scale * ratio(), 1));
  sharpen();
  unrest();
});
on("drawn", unrest);
on("selection hover tool mode", draw);

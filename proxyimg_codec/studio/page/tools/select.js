/** Selects layers, and moves, scales, turns and slants what is selected. */
import { commit } from "../actions.js";
import { s } from "../dom.js";
import { pathData } from "../bezier.js";
import { about, apply, inverse, product, rotation } from "../matrix.js";
import * as scene from "../scene.js";
import { draw, tools, unrest, view } from "../stage.js";
import { emit, hover, layerOf, moved, on, select, store, targets } from "../store.js";

/** @typedef {{matrix: number[], box: number[]}} Frame the box x0, y0, x1, y1 of what is selected, before the matrix */

/** Box of what is selected. @returns {Frame|null} */
export function frameOf() {
  const layers = moved(targets());
  if (!layers.length) return null;
  if (store.selected.size === 1 && layerOf([...store.selected][0])) {
    const name = [...store.selected][0], box = scene.localBox(name);
    return box && { matrix: scene.matrixOf(name), box };
  }
  const edge = (/** @type {number} */ i) => (i < 2 ? Math.min : Math.max)(...layers.map((l) => l.bounds[i]));
  const change = scene.preview.get(layers[0].name)?.matrix;
  return { matrix: change ? product(change, inverse(layers[0].matrix)) : [1, 0, 0, 1, 0, 0], box: [edge(0), edge(1), edge(2), edge(3)] };
}

/** Handles of a box: how far across and down. */
const HANDLES = [[0, 0], [0.5, 0], [1, 0], [1, 0.5], [1, 1], [0.5, 1], [0, 1], [0, 0.5]];
const CURSORS = ["nwse-resize", "ns-resize", "nesw-resize", "ew-resize"];

const at = (/** @type {Frame} */ { matrix, box }, /** @type {number} */ u, /** @type {number} */ v) => apply(matrix, box[0] + u * (box[2] - box[0]), box[1] + v * (box[3] - box[1]));

/** Where the handle for turning is, on the screen. @param {Frame} frame */
function knob(frame) {
  const [x, y] = view.toScreen(...at(frame, 0.5, 0)), [cx, cy] = view.toScreen(...at(frame, 0.5, 0.5));
  const length = Math.hypot(x - cx, y - cy) || 1;
  return [x + ((x - cx) / length) * 24, y + ((y - cy) / length) * 24];
}

/** What of the box is at a place on the screen. @param {Frame} frame @param {{sx: number, sy: number}} p */
function grip(frame, { sx, sy }) {
  const near = (/** @type {number[]} */ [x, y], /** @type {number} */ r) => Math.hypot(sx - x, sy - y) <= r;
  if (near(knob(frame), 10)) return { turn: true };
  for (const [u, v] of HANDLES) if (near(view.toScreen(...at(frame, u, v)), 9)) return { u, v };
  for (const [u, v] of [[0, 0], [1, 0], [1, 1], [0, 1]]) if (near(view.toScreen(...at(frame, u, v)), 20) && !inside(frame, sx, sy)) return { turn: true };
  return null;
}

function inside(/** @type {Frame} */ frame, /** @type {number} */ sx, /** @type {number} */ sy) {
  const [x, y] = apply(inverse(frame.matrix), ...view.toCanvas(sx, sy)), b = frame.box;
  return x >= b[0] && x <= b[2] && y >= b[1] && y <= b[3];
}

/** @type {null | {kind: string, frame: Frame, start: any, before: Map<string, number[]>, u?: number, v?: number, edits: any[], pick?: any, far?: boolean}} */
let work = null;

/** @param {string} kind @param {any} start @param {any} [grip] */
function begin(kind, start, grip = {}) {
  const frame = frameOf();
  if (!frame) return;
  const names = moved(targets()).map((l) => l.name);
  work = { kind, frame, start, before: new Map(names.map((n) => [n, scene.matrixOf(n)])), edits: [], ...grip };
}

/** Shows a map of everything that is selected. @param {number[]} change */
function show(change) {
  for (const [name, matrix] of work?.before ?? []) scene.preview.set(name, { ...scene.preview.get(name), matrix: product(change, matrix) });
  emit("previewed");
  draw();
}

function finish() {
  const done = work;
  work = null;
  if (!done) return;
  if (done.edits.length) commit(done.edits, done.before.keys());
  else {
    for (const name of done.before.keys()) scene.preview.delete(name);
    unrest();
  }
}

const round = (/** @type {number} */ v, digits = 3) => Number(v.toFixed(digits));

/** @param {any} p @param {PointerEvent} e */
function moving(p, e) {
  let dx = p.x - work.start.x, dy = p.y - work.start.y;
  if (e.shiftKey) Math.abs(dx) > Math.abs(dy) ? (dy = 0) : (dx = 0);
  if (!work.far && Math.hypot(p.sx - work.start.sx, p.sy - work.start.sy) < 3) return;
  work.far = true;
  [dx, dy] = [round(dx, 1), round(dy, 1)];
  show([1, 0, 0, 1, dx, dy]);
  work.edits = targets().map((layer) => ({ op: "move", layer, by: [dx, dy] }));
}

/** @param {any} p @param {PointerEvent} e */
function turning(p, e) {
  const pivot = at(work.frame, 0.5, 0.5).map((v) => round(v, 2));
  const angle = (/** @type {any} */ q) => (Math.atan2(q.y - pivot[1], q.x - pivot[0]) * 180) / Math.PI;
  let degrees = ((angle(p) - angle(work.start) + 540) % 360) - 180;
  degrees = e.shiftKey ? Math.round(degrees / 15) * 15 : round(degrees, 1);
  show(about(rotation(degrees), pivot[0], pivot[1]));
  work.edits = targets().map((layer) => ({ op: "rotate", layer, degrees, pivot }));
}

/** @param {any} p @param {PointerEvent} e */
function scaling(p, e) {
  const { frame, u, v } = work, { box } = frame;
  const [ou, ov] = e.altKey ? [0.5, 0.5] : [1 - u, 1 - v];
  const back = inverse(frame.matrix), w = box[2] - box[0], h = box[3] - box[1];
  const [x, y] = apply(back, p.x, p.y), [sx, sy] = apply(back, work.start.x, work.start.y);
  const ox = box[0] + ou * w, oy = box[1] + ov * h;
  const [px, py] = apply(frame.matrix, ox, oy);
  const side = u === 0.5 || v === 0.5;
  if (side && (e.ctrlKey || e.metaKey)) {
    const local = u === 0.5 ? [1, 0, (x - sx) / ((v - ov) * h), 1, 0, 0] : [1, (y - sy) / ((u - ou) * w), 0, 1, 0, 0];
    return mapped(local, ox, oy, px, py);
  }
  const factor = (/** @type {number} */ now, /** @type {number} */ then, /** @type {number} */ o, /** @type {number} */ k) => (k === 0.5 ? 1 : Math.max(0.02, Math.abs(then - o) < 1e-6 ? 1 : (now - o) / (then - o)));
  let fx = factor(x, sx, ox, u), fy = factor(y, sy, oy, v);
  if (!side && !e.shiftKey) fx = fy = Math.max(0.02, ((x - ox) * (sx - ox) + (y - oy) * (sy - oy)) / ((sx - ox) ** 2 + (sy - oy) ** 2));
  return mapped([round(fx, 4), 0, 0, round(fy, 4), 0, 0], ox, oy, px, py);
}

/** Shows a map in the coordinates of the box, and writes it as the plainest operation. */
function mapped(/** @type {number[]} */ local, /** @type {number} */ ox, /** @type {number} */ oy, /** @type {number} */ px, /** @type {number} */ py) {
  const { matrix } = work.frame;
  const linear = [...matrix.slice(0, 4), 0, 0];
  const m = product(product(linear, local), inverse(linear)).map((v) => round(v, 5));
  const pivot = [round(px, 2), round(py, 2)];
  show(about(m, pivot[0], pivot[1]));
  const flat = Math.abs(m[1]) < 1e-5 && Math.abs(m[2]) < 1e-5, even = m[0] === 1 && m[3] === 1;
  const how = flat ? { op: "scale", by: [m[0], m[3]] } : even ? { op: "shear", by: [m[2], m[1]] } : { op: "affine", matrix: m };
  work.edits = targets().map((layer) => ({ ...how, layer, pivot }));
}

/** Applies an operation to everything selected. @param {any} what @param {number[]} change */
export function transform(what, change) {
  const names = moved(targets()).map((l) => l.name);
  for (const name of names) scene.preview.set(name, { ...scene.preview.get(name), matrix: product(change, scene.matrixOf(name)) });
  emit("previewed");
  draw();
  return commit(targets().map((layer) => ({ ...what, layer })), names);
}

// Arrow keys: what is nudged in one go is one edit.
let nudged = [0, 0], nudging = 0;
/** @param {number} dx @param {number} dy */
export function nudge(dx, dy) {
  if (!store.selected.size) return;
  if (!work) { begin("nudge", {}); nudged = [0, 0]; }
  if (work?.kind !== "nudge") return;
  nudged = [nudged[0] + dx, nudged[1] + dy];
  show([1, 0, 0, 1, ...nudged]);
  work.edits = nudged[0] || nudged[1] ? targets().map((layer) => ({ op: "move", layer, by: [...nudged] })) : [];
  clearTimeout(nudging);
  nudging = window.setTimeout(finish, 400);
}

tools.select = {
  id: "select", label: "Select and transform", icon: "mouse-pointer-2", keys: "V",
  hint: "Drag to move \u00b7 handles scale, Shift frees, Alt about the centre, Ctrl on a side slants \u00b7 the knob turns",
  down(p, e) {
    if (work?.kind === "nudge") { clearTimeout(nudging); finish(); }
    const frame = frameOf(), found = frame && !scene.sway.size && grip(frame, p);
    if (found) return begin("turn" in found ? "turn" : "scale", p, found);
    const name = scene.hit(p.x, p.y);
    if (e.shiftKey) {
      if (name) { const next = new Set(store.selected); next.delete(name) || next.add(name); select(next); }
      return;
    }
    const owned = name && (store.selected.has(name) || moved(targets()).some((l) => l.name === name));
    if (!owned && !(frame && store.selected.size && inside(frame, p.sx, p.sy) && name === null)) select(name ? [name] : []);
    if (name && !(name === store.state.layers[0].name && store.state.opaque)) { begin("move", p, { pick: name }); }
  },
  drag(p, e) {
    if (work?.kind === "move") moving(p, e);
    if (work?.kind === "turn") turning(p, e);
    if (work?.kind === "scale") scaling(p, e);
  },
  up() {
    if (work && !work.far && work.kind === "move" && store.selected.size > 1 && work.pick) select([work.pick]);
    finish();
  },
  escape() {
    if (!work) return false;
    work.edits = [];
    finish();
    return true;
  },
  hover(p) {
    const frame = frameOf(), found = frame && !scene.sway.size && grip(frame, p);
    if (found && "turn" in found) { hover(null); return "alias"; }
    if (found) {
      const [a, b] = [at(frame, 0.5, 0.5), at(frame, found.u, found.v)];
      return CURSORS[(Math.round((Math.atan2(b[1] - a[1], b[0] - a[0]) * 4) / Math.PI) + 9) % 4];
    }
    const name = scene.hit(p.x, p.y);
    hover(name);
    if (name) scene.outlineOf(name).then(draw, () => {});
    return name && store.selected.has(name) ? "move" : "default";
  },
  key(e) {
    const by = e.shiftKey ? 10 : 1;
    const step = { ArrowLeft: [-by, 0], ArrowRight: [by, 0], ArrowUp: [0, -by], ArrowDown: [0, by] }[e.key];
    if (step && store.selected.size) { nudge(step[0], step[1]); return true; }
    return false;
  },
  leave() { if (work) finish(); },
  overlay(add) { outlineNodes(add, true); },
};

/** Draws the outline of what the pointer is over, and the box of what is selected. @param {(node: any) => void} add @param {boolean} handles */
export function outlineNodes(add, handles) {
  for (const name of new Set([...store.selected, store.hovered])) {
    const layer = name && layerOf(name), paths = layer && scene.outline(name);
    if (!paths || (name === store.state.layers[0].name && store.state.opaque)) continue;
    const lead = product(scene.matrixOf(name), inverse(layer.matrix));
    if (scene.preview.get(name)?.bent || scene.sway.has(name)) continue;
    const d = pathData(paths, (x, y) => view.toScreen(...apply(lead, x, y)));
    add(s("path", { d, class: "under" }));
    add(s("path", { d, class: name === store.hovered && !store.selected.has(name) ? "hovered" : "chosen" }));
  }
  const frame = handles && !scene.sway.size && !(work?.kind === "nudge") ? frameOf() : null;
  if (!frame || (store.state.opaque && store.selected.has(store.state.layers[0]?.name))) return;
  const corners = [[0, 0], [1, 0], [1, 1], [0, 1]].map(([u, v]) => view.toScreen(...at(frame, u, v)).join(","));
  add(s("polygon", { points: corners.join(" "), class: "under" }));
  add(s("polygon", { points: corners.join(" "), class: "box" }));
  const [kx, ky] = knob(frame), [tx, ty] = view.toScreen(...at(frame, 0.5, 0));
  add(s("line", { x1: tx, y1: ty, x2: kx, y2: ky, class: "box" }));
  add(s("circle", { cx: kx, cy: ky, r: 5, class: "handle" }));
  const [[ax, ay], [bx, by]] = [view.toScreen(...at(frame, 0, 0)), view.toScreen(...at(frame, 1, 0))];
  const turn = (Math.atan2(by - ay, bx - ax) * 180) / Math.PI;
  for (const [u, v] of HANDLES) {
    const [x, y] = view.toScreen(...at(frame, u, v));
    add(s("rect", { x: x - 4, y: y - 4, width: 8, height: 8, rx: 1.5, class: "handle", transform: `rotate(${turn} ${x} ${y})` }));
  }
}

on("selection state", () => {
  for (const name of store.selected) if (layerOf(name)) scene.outlineOf(name).then(() => { draw(); emit("framed"); }, () => {});
});

/** Tools of a motion: pins that stay, and handles that follow keys. */
import { s } from "../dom.js";
import { at, draft, handle, player, pose, renew, seconds, setKey } from "../motion.js";
import * as scene from "../scene.js";
import { backdrops, draw, skinsFrom, tools, view } from "../stage.js";
import { emit, hover, layerOf, select, single, store } from "../store.js";

/** The handle that the panel shows, or -1. */
export const chosen = { handle: -1 };

/** Layer to work on at a place. @param {any} p */
function layerAt(p) {
  const name = scene.hit(p.x, p.y);
  return name && !(store.state.opaque && name === store.state.layers[0].name) ? name : null;
}

const near = (/** @type {number[]} */ q, /** @type {any} */ p, r = 10) => { const [x, y] = view.toScreen(q[0], q[1]); return Math.hypot(x - p.sx, y - p.sy) <= r; };

/** Place of the knob that turns a handle, on the screen. @param {import("../motion.js").Handle} h */
function knob(h) {
  const { at: [cx, cy], turn, scale } = now(h), [x, y] = view.toScreen(cx, cy), a = (turn * Math.PI) / 180, reach = Math.max(26, h.radius * scale * scene.enlarged(h.layer) * view.scale);
  return [x + reach * Math.cos(a), y + reach * Math.sin(a)];
}

/** @type {null | {handle: import("../motion.js").Handle, start: any, before: {offset: number[], scale: number, turn: number}, turning: boolean, now: {offset?: number[], turn?: number}, moved: boolean}} */
let work = null;

/** A handle as it is shown now, with what is being dragged; `at` is its place on the canvas. @param {import("../motion.js").Handle} h */
function now(h) {
  const values = { ...at(h, player.time), ...(work?.handle === h && work.moved ? work.now : {}) };
  return { ...values, at: moved(h, values.offset) };
}

/** Place on the canvas of a handle with an offset. @param {import("../motion.js").Handle} h @param {number[]} offset @returns {[number, number]} */
function moved(h, offset) {
  const [x, y] = scene.onCanvas(h.layer, h.at[0], h.at[1]), [dx, dy] = scene.turned(h.layer, offset);
  return [x + dx, y + dy];
}

/** Point at rest of a layer at a place, with one decimal. @param {string} layer @param {any} p */
const resting = (layer, p) => scene.atRest(layer, p.x, p.y).map((v) => Number(v.toFixed(1)));

const placeOf = (/** @type {{layer: string, at: number[]}} */ d) => scene.onCanvas(d.layer, d.at[0], d.at[1]);

tools.keep = {
  id: "keep", label: "Pin what stays", icon: "pin", keys: "P", cursor: "crosshair",
  hint: "Click a layer where it is to stay \u00b7 click a pin again to take it away",
  up(p) {
    const old = draft.discs.findIndex((d) => near(placeOf(d), p));
    if (old >= 0) draft.discs.splice(old, 1);
    else {
      const layer = layerAt(p) ?? single()?.name;
      if (!layer) return;
      const b = /** @type {any} */ (layerOf(layer)).bounds;
      draft.discs.push({ layer, at: resting(layer, p), radius: Math.round(Math.max(6, (0.06 * Math.hypot(b[2] - b[0], b[3] - b[1])) / scene.enlarged(layer))) });
    }
    renew();
    emit("motion");
    draw();
  },
  hover(p) { hover(layerAt(p)); return draft.discs.some((d) => near(placeOf(d), p)) ? "pointer" : "crosshair"; },
};

tools.handle = {
  id: "handle", label: "Handles with keys", icon: "diamond", keys: "K", cursor: "crosshair",
  hint: "Click a layer to hold it there \u00b7 go to a moment, drag the handle or its knob: that sets a key",
  down(p) {
    const held = draft.handles[chosen.handle], turning = Boolean(held) && onKnob(held, p);
    const old = turning ? chosen.handle : draft.handles.findIndex((h) => near(now(h).at, p));
    if (old >= 0) {
      chosen.handle = old;
      work = { handle: draft.handles[old], start: p, before: at(draft.handles[old], player.time), turning, now: {}, moved: false };
    } else {
      const layer = layerAt(p);
      if (!layer) { chosen.handle = -1; emit("motion"); return; }
      select([layer]);
      player.running = false;
      handle(layer, resting(layer, p));
      chosen.handle = draft.handles.length - 1;
    }
    emit("motion");
  },
  drag(p) {
    if (!work || (!work.moved && Math.hypot(p.sx - work.start.sx, p.sy - work.start.sy) < 3)) return;
    work.moved = true;
    player.running = false;
    const { before: { offset, turn }, start, handle: { layer }, handle: held } = work, [cx, cy] = moved(held, offset), round = (/** @type {number} */ v) => Number(v.toFixed(1));
    const angle = (/** @type {any} */ q) => (Math.atan2(q.y - cy, q.x - cx) * 180) / Math.PI;
    work.now = work.turning ? { turn: round(turn + ((angle(p) - angle(start) + 540) % 360) - 180) } : { offset: scene.turned(layer, [p.x - start.x, p.y - start.y], true).map((v, i) => round(offset[i] + v)) };
    pull();
  },
  up() {
    const done = work;
    work = null;
    if (done?.moved) setKey(done.handle, done.now);
  },
  escape() { const was = Boolean(work); work = null; draw(); return was; },
  hover(p) {
    hover(layerAt(p));
    if (draft.handles[chosen.handle] && onKnob(draft.handles[chosen.handle], p)) return "alias";
    return draft.handles.some((h) => near(now(h).at, p)) ? "grab" : "crosshair";
  },
  key(e) {
    const h = draft.handles[chosen.handle], by = e.shiftKey ? 10 : 1;
    const step = { ArrowLeft: [-by, 0], ArrowRight: [by, 0], ArrowUp: [0, -by], ArrowDown: [0, by] }[e.key];
    if (h && step) { const { offset } = at(h, player.time); setKey(h, { offset: [offset[0] + step[0], offset[1] + step[1]] }); return true; }
    if (h && (e.key === "Delete" || e.key === "Backspace")) { draft.handles.splice(chosen.handle, 1); chosen.handle = -1; renew(); emit("motion"); return true; }
    return false;
  },
};

/** Whether a place is on the knob of a handle. @param {import("../motion.js").Handle} h @param {any} p */
function onKnob(h, p) { const [x, y] = knob(h); return Math.hypot(x - p.sx, y - p.sy) <= 9; }

/** Shows roughly what the handle does while it is dragged: nodes near it go along. */
function pull() {
  if (!work) return;
  const { layer, at: [x, y], radius } = work.handle, mesh = scene.mesh(layer), { offset, scale, turn } = now(work.handle);
  if (!mesh) { scene.meshOf(layer).then(draw, () => {}); return; }
  const out = new Float32Array(mesh.nodes.length), reach = 2.5 * radius;
  const c = scale * Math.cos((turn * Math.PI) / 180), si = scale * Math.sin((turn * Math.PI) / 180);
  for (let i = 0; i < out.length; i += 2) {
    const u = mesh.nodes[i] - x, v = mesh.nodes[i + 1] - y, d = Math.hypot(u, v), w = d < radius ? 1 : d < reach ? 1 - (d - radius) / (reach - radius) : 0;
    out[i] = w * ((c - 1) * u - si * v + offset[0]);
    out[i + 1] = w * (si * u + (c - 1) * v + offset[1]);
  }
  scene.sway.set(layer, out);
  draw();
}

backdrops.push((add) => {
  if (store.mode !== "motion") return;
  for (const d of draft.discs) {
    const [x, y] = view.toScreen(...placeOf(d));
    add(s("circle", { cx: x, cy: y, r: d.radius * scene.enlarged(d.layer) * view.scale, class: "reach" }));
    add(s("circle", { cx: x, cy: y, r: 6.5, class: "pin" }));
    add(s("circle", { cx: x, cy: y, r: 2, class: "pin-dot" }));
  }
  draft.handles.forEach((h, i) => {
    const shown = now(h), [x, y] = view.toScreen(...shown.at), on = i === chosen.handle;
    const path = h.keys.map((k) => view.toScreen(...moved(h, k.offset)).join(",")).join(" ");
    if (h.keys.length > 1) add(s("polyline", { points: path, class: "trail" }));
    add(s("circle", { cx: x, cy: y, r: h.radius * shown.scale * scene.enlarged(h.layer) * view.scale, class: "reach" }));
    if (on) {
      const [kx, ky] = knob(h);
      add(s("line", { x1: x, y1: y, x2: kx, y2: ky, class: "turn" }));
      add(s("circle", { cx: kx, cy: ky, r: 4.5, class: "handle" }));
    }
    add(s("rect", { x: x - 5, y: y - 5, width: 10, height: 10, rx: 1, transform: `rotate(45 ${x} ${y})`, class: `handle${on ? " on" : ""}` }));
  });
});

/** Onion skin: sets of displacements around a moment, with how strongly each shows. @param {number} fps @returns {{sway: Map<string, Float32Array>, share: number}[]} */
export function ghosts(fps) {
  if (!player.onion || store.mode !== "motion" || player.running) return [];
  return [-6, -3, 3, 6].map((k) => {
    const sway = new Map();
    pose((player.time + k / fps + seconds()) % seconds(), sway);
    return { sway, share: Math.abs(k) === 3 ? 0.3 : 0.15 };
  });
}
skinsFrom(() => ghosts(draft.fps));

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

/** Where a handle is at the present moment. @param {import("../motion.js").Handle} h */
function where(h) { const { offset } = at(h, player.time); return [h.at[0] + offset[0], h.at[1] + offset[1]]; }

const near = (/** @type {number[]} */ q, /** @type {any} */ p, r = 10) => { const [x, y] = view.toScreen(q[0], q[1]); return Math.hypot(x - p.sx, y - p.sy) <= r; };

/** @type {null | {handle: import("../motion.js").Handle, start: any, offset: number[], now: number[], moved: boolean}} */
let work = null;

tools.keep = {
  id: "keep", label: "Pin what stays", icon: "pin", keys: "P", cursor: "crosshair",
  hint: "Click a layer where it is to stay \u00b7 click a pin again to take it away",
  up(p) {
    const old = draft.discs.findIndex((d) => near(d.at, p));
    if (old >= 0) draft.discs.splice(old, 1);
    else {
      const layer = layerAt(p) ?? single()?.name;
      if (!layer) return;
      const b = /** @type {any} */ (layerOf(layer)).bounds;
      draft.discs.push({ layer, at: [p.x, p.y].map((v) => Number(v.toFixed(1))), radius: Math.round(Math.max(6, 0.06 * Math.hypot(b[2] - b[0], b[3] - b[1]))) });
    }
    renew();
    emit("motion");
    draw();
  },
  hover(p) { hover(layerAt(p)); return draft.discs.some((d) => near(d.at, p)) ? "pointer" : "crosshair"; },
};

tools.handle = {
  id: "handle", label: "Handles with keys", icon: "diamond", keys: "K", cursor: "crosshair",
  hint: "Click a layer to hold it there \u00b7 go to a moment, drag the handle: that sets a key",
  down(p) {
    const old = draft.handles.findIndex((h) => near(where(h), p));
    if (old >= 0) {
      chosen.handle = old;
      work = { handle: draft.handles[old], start: p, offset: at(draft.handles[old], player.time).offset, now: [], moved: false };
    } else {
      const layer = layerAt(p);
      if (!layer) { chosen.handle = -1; emit("motion"); return; }
      select([layer]);
      player.running = false;
      handle(layer, [p.x, p.y].map((v) => Number(v.toFixed(1))));
      chosen.handle = draft.handles.length - 1;
    }
    emit("motion");
  },
  drag(p) {
    if (!work || (!work.moved && Math.hypot(p.sx - work.start.sx, p.sy - work.start.sy) < 3)) return;
    work.moved = true;
    player.running = false;
    work.now = [work.offset[0] + p.x - work.start.x, work.offset[1] + p.y - work.start.y].map((v) => Number(v.toFixed(1)));
    pull();
  },
  up() {
    const done = work;
    work = null;
    if (done?.moved) setKey(done.handle, { offset: done.now });
  },
  escape() { const was = Boolean(work); work = null; draw(); return was; },
  hover(p) { hover(layerAt(p)); return draft.handles.some((h) => near(where(h), p)) ? "grab" : "crosshair"; },
  key(e) {
    const h = draft.handles[chosen.handle], by = e.shiftKey ? 10 : 1;
    const step = { ArrowLeft: [-by, 0], ArrowRight: [by, 0], ArrowUp: [0, -by], ArrowDown: [0, by] }[e.key];
    if (h && step) { const { offset } = at(h, player.time); setKey(h, { offset: [offset[0] + step[0], offset[1] + step[1]] }); return true; }
    if (h && (e.key === "Delete" || e.key === "Backspace")) { draft.handles.splice(chosen.handle, 1); chosen.handle = -1; renew(); emit("motion"); return true; }
    return false;
  },
};

/** Shows roughly what the handle does while it is dragged: nodes near it go along. */
function pull() {
  if (!work) return;
  const { layer, at: [x, y], radius } = work.handle, mesh = scene.mesh(layer);
  if (!mesh) { scene.meshOf(layer).then(draw, () => {}); return; }
  const out = new Float32Array(mesh.nodes.length), reach = 2.5 * radius;
  for (let i = 0; i < out.length; i += 2) {
    const d = Math.hypot(mesh.nodes[i] - x, mesh.nodes[i + 1] - y), w = d < radius ? 1 : d < reach ? 1 - (d - radius) / (reach - radius) : 0;
    out[i] = w * work.now[0];
    out[i + 1] = w * work.now[1];
  }
  scene.sway.set(layer, out);
  draw();
}

backdrops.push((add) => {
  if (store.mode !== "motion") return;
  for (const d of draft.discs) {
    const [x, y] = view.toScreen(d.at[0], d.at[1]);
    add(s("circle", { cx: x, cy: y, r: d.radius * view.scale, class: "reach" }));
    add(s("circle", { cx: x, cy: y, r: 6.5, class: "pin" }));
    add(s("circle", { cx: x, cy: y, r: 2, class: "pin-dot" }));
  }
  draft.handles.forEach((h, i) => {
    const [x, y] = view.toScreen(...(work?.handle === h && work.moved ? /** @type {[number, number]} */ ([h.at[0] + work.now[0], h.at[1] + work.now[1]]) : /** @type {[number, number]} */ (where(h))));
    const path = h.keys.map((k) => view.toScreen(h.at[0] + k.offset[0], h.at[1] + k.offset[1]).join(",")).join(" ");
    if (h.keys.length > 1) add(s("polyline", { points: path, class: "trail" }));
    add(s("circle", { cx: x, cy: y, r: h.radius * at(h, player.time).scale * view.scale, class: "reach" }));
    add(s("rect", { x: x - 5, y: y - 5, width: 10, height: 10, rx: 1, transform: `rotate(45 ${x} ${y})`, class: `handle${i === chosen.handle ? " on" : ""}` }));
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

/** Bézier points of an outline: shows and drags them, smooth or as corners. */
import { commit } from "../actions.js";
import { s } from "../dom.js";
import { pathData } from "../bezier.js";
import * as scene from "../scene.js";
import { draw, tools, unrest, view } from "../stage.js";
import { emit, hover, on, select, single, store } from "../store.js";
import { follower } from "./follow.js";
import { outlineNodes } from "./select.js";

/** Chosen anchor: path and point, and whether the inside follows. @type {{path: number, point: number, follow: boolean}} */
export const anchor = { path: -1, point: -1, follow: false };

/** Paths that are being dragged, in place of those of the server. @type {number[][][]|null} */
let moving = null;
/** @type {null | {path: number, point: number, start: any, before: number[][][], steps: Map<number, number[]>, kind?: boolean, bend?: ((dx: number, dy: number) => void) | null}} `kind`: smooth or corner, which moves nothing inside */
let work = null;

const paths = () => { const layer = single(); return moving ?? (layer ? scene.outline(layer.name) : null); };
const wrap = (/** @type {number[][]} */ path, /** @type {number} */ k) => ((k % path.length) + path.length) % path.length;

/** Whether the curve is smooth at an anchor: its two handles lie on one line. @param {number[][]} path @param {number} k */
export function smooth(path, k) {
  const [a, p, b] = [path[wrap(path, k - 1)], path[k], path[wrap(path, k + 1)]];
  const u = [p[0] - a[0], p[1] - a[1]], v = [b[0] - p[0], b[1] - p[1]];
  const l = Math.hypot(...u) * Math.hypot(...v);
  return l < 1e-9 || (u[0] * v[0] + u[1] * v[1]) / l > 0.99;
}

/** Control points at a place: handles of the chosen anchor first. @param {any} p */
function find(p) {
  const shape = paths();
  if (!shape) return null;
  const near = (/** @type {number[]} */ q) => { const [x, y] = view.toScreen(q[0], q[1]); return Math.hypot(x - p.sx, y - p.sy) <= 8; };
  const path = shape[anchor.path];
  if (path) for (const k of [anchor.point - 1, anchor.point + 1]) if (near(path[wrap(path, k)])) return { path: anchor.path, point: wrap(path, k) };
  for (let i = 0; i < shape.length; i++) for (let k = 0; k < shape[i].length; k += 3) if (near(shape[i][k])) return { path: i, point: k };
  return null;
}

/** Sets how far points of the path are moved. @param {Map<number, number[]>} steps */
function show(steps) {
  if (!work) return;
  work.steps = steps;
  moving = work.before.map((path, i) => (i !== work.path ? path : path.map((q, k) => { const d = steps.get(k); return d ? [q[0] + d[0], q[1] + d[1]] : q; })));
  const name = single()?.name ?? "";
  if (anchor.follow && !work.kind) {
    if (work.bend === undefined) work.bend = follower(name, work.before, work.path, work.point);
    const [dx, dy] = steps.get(work.point) ?? [0, 0];
    work.bend?.(dx, dy);
  } else scene.preview.set(name, { ...scene.preview.get(name), clip: moving });
  draw();
}

/** @param {number} dx @param {number} dy @param {boolean} alone */
function move(dx, dy, alone) {
  if (!work) return;
  const path = work.before[work.path], k = work.point, steps = new Map([[k, [dx, dy]]]);
  if (k % 3 === 0) {
    for (const j of [k - 1, k + 1]) steps.set(wrap(path, j), [dx, dy]);
  } else {
    const middle = k % 3 === 1 ? k - 1 : wrap(path, k + 1), other = k % 3 === 1 ? wrap(path, k - 2) : wrap(path, k + 2);
    if (!alone && smooth(path, middle)) {
      const m = path[middle], q = [path[k][0] + dx, path[k][1] + dy], o = path[other];
      const far = Math.hypot(o[0] - m[0], o[1] - m[1]), near = Math.hypot(q[0] - m[0], q[1] - m[1]) || 1;
      steps.set(other, [m[0] - ((q[0] - m[0]) / near) * far - o[0], m[1] - ((q[1] - m[1]) / near) * far - o[1]]);
    }
  }
  show(steps);
}

async function finish() {
  const done = work, layer = single();
  work = null;
  if (!done || !layer || !done.steps.size) { if (layer) scene.preview.delete(layer.name); moving = null; return draw(); }
  const along = anchor.follow && !done.kind, follow = along ? { follow: true } : {};
  const round = (/** @type {number} */ v) => Number(v.toFixed(2));
  const edits = [...done.steps].filter(([k]) => !along || k % 3 === 0 || done.point % 3).filter(([, d]) => Math.hypot(...d) > 0.01)
    .map(([point, d]) => ({ op: "point", layer: layer.name, path: done.path, point, by: d.map(round), ...follow }));
  if (edits.length) await commit(edits, [layer.name]);
  else scene.preview.delete(layer.name);
  await scene.outlineOf(layer.name).catch(() => {});
  moving = null;
  unrest();
}

/** Makes the chosen anchor a corner or smooth. @param {boolean} even */
export function setSmooth(even) {
  const shape = paths(), path = shape?.[anchor.path];
  if (!shape || !path) return;
  const k = anchor.point, p = path[k], a = path[wrap(path, k - 1)], b = path[wrap(path, k + 1)];
  const la = Math.hypot(a[0] - p[0], a[1] - p[1]), lb = Math.hypot(b[0] - p[0], b[1] - p[1]);
  let d = [b[0] - a[0], b[1] - a[1]];
  if (Math.hypot(...d) < 1e-6) { const [u, v] = [path[wrap(path, k - 3)], path[wrap(path, k + 3)]]; d = [v[0] - u[0], v[1] - u[1]]; }
  const l = Math.hypot(...d) || 1, third = (/** @type {number} */ j) => { const q = path[wrap(path, j)]; return Math.hypot(q[0] - p[0], q[1] - p[1]) / 3; };
  work = { path: anchor.path, point: k, start: null, before: shape, steps: new Map(), kind: true };
  const wanted = even
    ? [[p[0] - (d[0] / l) * (la || third(k - 3)), p[1] - (d[1] / l) * (la || third(k - 3))], [p[0] + (d[0] / l) * (lb || third(k + 3)), p[1] + (d[1] / l) * (lb || third(k + 3))]]
    : [corner(p, path[wrap(path, k - 3)]), corner(p, path[wrap(path, k + 3)])];
  show(new Map([[wrap(path, k - 1), [wanted[0][0] - a[0], wanted[0][1] - a[1]]], [wrap(path, k + 1), [wanted[1][0] - b[0], wanted[1][1] - b[1]]]]));
  finish();
}

const corner = (/** @type {number[]} */ p, /** @type {number[]} */ q) => [p[0] + (q[0] - p[0]) / 3, p[1] + (q[1] - p[1]) / 3];

/** Whether the chosen anchor is smooth; null without one. */
export function chosenSmooth() {
  const path = paths()?.[anchor.path];
  return path?.[anchor.point] ? smooth(path, anchor.point) : null;
}

tools.points = {
  id: "points", label: "Outline points", icon: "spline", keys: "B",
  hint: "Drag a point or its handles \u00b7 double-click makes a corner smooth or the other way \u00b7 Alt moves one handle alone",
  enter() {
    const layer = single();
    if (!layer) return;
    scene.outlineOf(layer.name).then(draw, () => {});
    scene.wholeOf(layer.name).catch(() => {});
    scene.meshOf(layer.name).catch(() => {});
  },
  down(p) {
    const found = find(p), shape = paths();
    if (!found || !shape) {
      const name = scene.hit(p.x, p.y);
      if (name) { select([name]); scene.outlineOf(name).then(draw, () => {}); }
      return;
    }
    if (found.point % 3 === 0) { anchor.path = found.path; anchor.point = found.point; emit("pins"); }
    work = { ...found, start: p, before: shape, steps: new Map() };
  },
  drag(p, e) { if (work?.start && (work.steps.size || Math.hypot(p.sx - work.start.sx, p.sy - work.start.sy) > 2)) move(p.x - work.start.x, p.y - work.start.y, e.altKey); },
  up() { finish(); },
  double(p) {
    const found = find(p);
    if (found && found.point % 3 === 0) { anchor.path = found.path; anchor.point = found.point; setSmooth(!chosenSmooth()); }
  },
  escape() {
    const was = Boolean(work), layer = single();
    if (layer) scene.preview.delete(layer.name);
    work = moving = null;
    draw();
    return was;
  },
  hover(p) {
    if (find(p)) return "pointer";
    const name = scene.hit(p.x, p.y);
    hover(name);
    if (name) scene.outlineOf(name).then(draw, () => {});
    return "default";
  },
  key(e) {
    const by = e.shiftKey ? 10 : 1, shape = paths();
    const step = { ArrowLeft: [-by, 0], ArrowRight: [by, 0], ArrowUp: [0, -by], ArrowDown: [0, by] }[e.key];
    if (!step || !shape?.[anchor.path]) return false;
    work = { path: anchor.path, point: anchor.point, start: null, before: shape, steps: new Map() };
    move(step[0], step[1], false);
    finish();
    return true;
  },
  leave() { tools.points.escape?.(); },
  overlay(add) {
    const shape = paths();
    if (!shape) return outlineNodes(add, false);
    const d = pathData(shape, (x, y) => view.toScreen(x, y));
    add(s("path", { d, class: "under" }));
    add(s("path", { d, class: "chosen" }));
    shape.forEach((path, i) => {
      for (let k = 0; k < path.length; k += 3) {
        const [x, y] = view.toScreen(path[k][0], path[k][1]), on = i === anchor.path && k === anchor.point;
        if (on) for (const j of [k - 1, k + 1]) {
          const [hx, hy] = view.toScreen(path[wrap(path, j)][0], path[wrap(path, j)][1]);
          add(s("line", { x1: x, y1: y, x2: hx, y2: hy, class: "box" }));
          add(s("circle", { cx: hx, cy: hy, r: 4, class: "handle" }));
        }
        const shape = smooth(path, k) ? s("circle", { cx: x, cy: y, r: 4, class: `handle${on ? " on" : ""}` })
          : s("rect", { x: x - 3.5, y: y - 3.5, width: 7, height: 7, class: `handle${on ? " on" : ""}` });
        add(shape);
      }
    });
  },
};

on("selection", () => {
  anchor.path = anchor.point = -1;
  moving = work = null;
  if (store.tool === "points") tools.points.enter?.();
});

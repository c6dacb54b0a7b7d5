/** Puppet pins: the layer follows them as rigidly as possible, at the speed of the pointer. */
import { Puppet, attach } from "../arap.js";
import { commit } from "../actions.js";
import { s } from "../dom.js";
import { apply } from "../matrix.js";
import * as scene from "../scene.js";
import { draw, tools, unrest, view } from "../stage.js";
import { emit, hover, on, select, single, store } from "../store.js";
import { outlineNodes } from "./select.js";

/** A pin sits in a triangle of the mesh, so that it goes where the layer goes. `reach` is the radius in
 * canvas pixels of what turns and moves with it as one piece; 0 is a bare point.
 * @typedef {{face: number, weights: number[], reach: number}} Pin */

/** Pins of each layer, by its name. @type {Map<string, Pin[]>} */
export const pins = new Map();
/** The pin that the panel shows, or -1. */
export const chosen = { pin: -1, mesh: true };

/** Points around a pin that turn with it. */
const RING = 6;
/** Milliseconds that the solution may take while the pointer moves. */
const BUDGET = 12;

const own = () => { const layer = single(); return layer ? (pins.get(layer.name) ?? pins.set(layer.name, []).get(layer.name)) : []; };

/** Where a pin is now. @param {string} name @param {Pin} pin @returns {[number, number]} */
export function where(name, pin) {
  const mesh = scene.mesh(name);
  if (!mesh) return [0, 0];
  const bent = scene.preview.get(name)?.bent ?? mesh.bent, m = scene.matrixOf(name);
  const at = [0, 1, 2].map((i) => mesh.faces[3 * pin.face + i]);
  return apply(m, at.reduce((t, n, i) => t + pin.weights[i] * bent[2 * n], 0), at.reduce((t, n, i) => t + pin.weights[i] * bent[2 * n + 1], 0));
}

/** @type {null | {name: string, mesh: import("../scene.js").Mesh, puppet: Puppet, points: number[], groups: number[][], centres: number[][],
 *   pin: number, start: any, turning: boolean, targets: number[], moved: boolean}} */
let work = null;

/** Prepares a drag: the held points of all pins, and the solver. */
function begin(/** @type {number} */ pin, /** @type {any} */ p, turning = false) {
  const layer = single(), mesh = layer && scene.mesh(layer.name);
  if (!layer || !mesh) return;
  const points = [], groups = [], centres = [];
  const nodes = scene.present(layer.name, mesh);
  for (const each of own()) {
    const [x, y] = where(layer.name, each), group = [points.length / 2];
    points.push(x, y);
    for (let k = 0; each.reach && k < RING; k++) {
      const a = (2 * Math.PI * k) / RING, px = x + each.reach * Math.cos(a), py = y + each.reach * Math.sin(a);
      if (attach(nodes, mesh.faces, px, py).distance > 1) continue;
      group.push(points.length / 2);
      points.push(px, py);
    }
    groups.push(group);
    centres.push([x, y]);
  }
  const rest = scene.present(layer.name, mesh, mesh.nodes);
  const puppet = new Puppet(nodes, mesh.faces, points, rest);
  work = { name: layer.name, mesh, puppet, points, groups, centres, pin, start: p, turning, targets: [...points], moved: false };
}

let waiting = false;
function solve(full = false) {
  if (!work) return;
  const { puppet, targets, name } = work;
  scene.bend(name, puppet.drag(targets, full ? {} : { milliseconds: BUDGET, rounds: 2, warm: true }));
  draw();
}

/** Sets the targets of the pin that is dragged or turned. @param {number} dx @param {number} dy @param {number} degrees */
function aim(dx, dy, degrees) {
  if (!work) return;
  const [cx, cy] = work.centres[work.pin], a = (degrees * Math.PI) / 180, c = Math.cos(a), si = Math.sin(a);
  for (const k of work.groups[work.pin]) {
    const x = work.points[2 * k] - cx, y = work.points[2 * k + 1] - cy;
    work.targets[2 * k] = cx + dx + c * x - si * y;
    work.targets[2 * k + 1] = cy + dy + si * x + c * y;
  }
  work.moved = true;
  if (waiting) return;
  waiting = true;
  requestAnimationFrame(() => { waiting = false; solve(); });
}

async function finish() {
  if (!work) return;
  if (work.moved) solve(true);
  const done = work;
  work = null;
  if (!done.moved) return;
  const round = (/** @type {number} */ v) => Number(v.toFixed(2));
  const handles = [];
  for (let k = 0; k < done.points.length; k += 2) {
    handles.push([round(done.points[k]), round(done.points[k + 1]), round(done.targets[k] - done.points[k]), round(done.targets[k + 1] - done.points[k + 1])]);
  }
  await commit([{ op: "drag", layer: done.name, handles }], [done.name]);
}

/** Turns the chosen pin by so many degrees. @param {number} degrees */
export function turn(degrees) {
  const mine = own();
  const pin = mine[chosen.pin];
  if (!pin) return;
  ring(pin);
  begin(chosen.pin, null, true);
  aim(0, 0, degrees);
  finish();
}

/** Gives a pin a reach if it has none, so that it can turn something. @param {Pin} pin */
function ring(pin) {
  const layer = single();
  if (!pin.reach && layer) pin.reach = Math.max(6, Math.round(0.06 * Math.hypot(layer.bounds[2] - layer.bounds[0], layer.bounds[3] - layer.bounds[1])));
}

/** @param {any} p index of the pin at a place of the screen, or -1 */
function pinAt(p) {
  const layer = single();
  if (!layer || !scene.mesh(layer.name)) return -1;
  return own().findIndex((pin) => { const [x, y] = view.toScreen(...where(layer.name, pin)); return Math.hypot(x - p.sx, y - p.sy) <= 11; });
}

/** Whether a place is on the knob of the chosen pin. @param {any} p */
function onKnob(p) {
  const layer = single(), pin = own()[chosen.pin];
  if (!layer || !pin) return false;
  const [x, y] = view.toScreen(...where(layer.name, pin));
  return Math.hypot(x + knobReach(pin) - p.sx, y - p.sy) <= 9;
}

const knobReach = (/** @type {Pin} */ pin) => Math.max(30, pin.reach * view.scale);

/** Takes pins away. @param {number} [pin] all, without */
export function unpin(pin) {
  if (pin === undefined) own().length = 0;
  else own().splice(pin, 1);
  chosen.pin = -1;
  emit("pins");
  draw();
}

/** Sets a pin where the layer is at a point of the canvas. @param {number} x @param {number} y @returns {number} its index, -1 beside the layer */
function pinDown(x, y) {
  const layer = single(), mesh = layer && scene.mesh(layer.name);
  if (!layer || !mesh) return -1;
  const found = attach(scene.present(layer.name, mesh), mesh.faces, x, y);
  if (found.distance > 6 / view.scale) return -1;
  own().push({ face: found.triangle, weights: found.weights, reach: 0 });
  emit("pins");
  return own().length - 1;
}

tools.pins = {
  id: "pins", label: "Puppet pins", icon: "pin", keys: "P", cursor: "crosshair",
  hint: "Click to set pins, then drag one: the rest bends \u00b7 the ring turns it \u00b7 Alt-click takes a pin away",
  enter() {
    const layer = single();
    if (layer) scene.meshOf(layer.name).then(draw, () => {});
  },
  down(p, e) {
    const layer = single();
    if (onKnob(p)) { ring(own()[chosen.pin]); return begin(chosen.pin, p, true); }
    const pin = pinAt(p);
    if (pin >= 0 && e.altKey) return unpin(pin);
    if (pin < 0) {
      const name = scene.hit(p.x, p.y);
      if (!layer || (name && name !== layer.name && attachDistance(layer.name, p) > 6)) {
        if (name) { select([name]); scene.meshOf(name).then(draw, () => {}); }
        return;
      }
    }
    chosen.pin = pin >= 0 ? pin : pinDown(p.x, p.y);
    emit("pins");
    if (chosen.pin >= 0) begin(chosen.pin, p);
  },
  drag(p) {
    if (!work) return;
    if (work.turning) {
      const [cx, cy] = work.centres[work.pin];
      const angle = (/** @type {any} */ q) => (Math.atan2(q.y - cy, q.x - cx) * 180) / Math.PI;
      aim(0, 0, angle(p) - angle(work.start));
    } else if (work.moved || Math.hypot(p.sx - work.start.sx, p.sy - work.start.sy) > 3) aim(p.x - work.start.x, p.y - work.start.y, 0);
  },
  up() { finish(); unrest(); },
  escape() {
    if (!work) return false;
    scene.preview.delete(work.name);
    work = null;
    unrest();
    return true;
  },
  hover(p) {
    if (onKnob(p)) return "alias";
    if (pinAt(p) >= 0) return "grab";
    hover(single() ? null : scene.hit(p.x, p.y));
    return "crosshair";
  },
  key(e) {
    const pin = own()[chosen.pin];
    const by = e.shiftKey ? 10 : 1;
    const step = { ArrowLeft: [-by, 0], ArrowRight: [by, 0], ArrowUp: [0, -by], ArrowDown: [0, by] }[e.key];
    if (pin && step) { begin(chosen.pin, null); aim(step[0], step[1], 0); finish(); return true; }
    if (pin && (e.key === "Delete" || e.key === "Backspace")) { unpin(chosen.pin); return true; }
    return false;
  },
  leave() { finish(); },
  overlay(add) {
    const layer = single(), mesh = layer && scene.mesh(layer.name);
    if (!layer || !mesh) return outlineNodes(add, false);
    if (chosen.mesh) {
      const nodes = scene.present(layer.name, mesh), d = [];
      const q = (/** @type {number} */ n) => view.toScreen(nodes[2 * n], nodes[2 * n + 1]).map((v) => v.toFixed(1)).join(" ");
      for (const [a, b] of edges(mesh)) d.push(`M${q(a)}L${q(b)}`);
      add(s("path", { d: d.join(""), class: "mesh" }));
    }
    own().forEach((pin, i) => {
      const [x, y] = view.toScreen(...where(layer.name, pin)), on = i === chosen.pin;
      if (pin.reach) add(s("circle", { cx: x, cy: y, r: pin.reach * view.scale, class: "reach" }));
      if (on) {
        add(s("circle", { cx: x, cy: y, r: knobReach(pin), class: "turn" }));
        add(s("circle", { cx: x + knobReach(pin), cy: y, r: 4.5, class: "handle" }));
      }
      add(s("circle", { cx: x, cy: y, r: 6.5, class: `pin${on ? " on" : ""}` }));
      add(s("circle", { cx: x, cy: y, r: 2, class: "pin-dot" }));
    });
  },
};

/** @type {WeakMap<object, number[][]>} */
const known = new WeakMap();

/** Edges of a mesh, each once. @param {import("../scene.js").Mesh} mesh @returns {number[][]} */
function edges(mesh) {
  const found = known.get(mesh) ?? [], seen = new Set();
  if (known.has(mesh)) return found;
  for (let t = 0; t < mesh.faces.length; t += 3) for (let i = 0; i < 3; i++) {
    const a = mesh.faces[t + i], b = mesh.faces[t + ((i + 1) % 3)], key = Math.min(a, b) * 1e6 + Math.max(a, b);
    if (!seen.has(key)) { seen.add(key); found.push([a, b]); }
  }
  known.set(mesh, found);
  return found;
}

function attachDistance(/** @type {string} */ name, /** @type {any} */ p) {
  const mesh = scene.mesh(name);
  return mesh ? attach(scene.present(name, mesh), mesh.faces, p.x, p.y).distance * view.scale : Infinity;
}

on("selection", () => {
  chosen.pin = -1;
  if (store.tool === "pins") tools.pins.enter?.();
});
on("state", () => { if (store.tool === "pins") tools.pins.enter?.(); });

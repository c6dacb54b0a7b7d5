/** Chapter 6, "Base" and "Refinement": the proxy nodes of a layer at rest. */

import { decodeArray, decodeSigned } from "./entropy.js";
import { need } from "./errors.js";
import { takeArray } from "./implicit.js";

const NEW = 1;
const RANKED = 2;
const FAR = 15;

/** Twice the area of the triangle of three points of a flat array. */
export function area(points, a, b, c) {
  const [x, y] = [points[2 * a], points[2 * a + 1]];
  return (
    (points[2 * b] - x) * (points[2 * c + 1] - y) - (points[2 * b + 1] - y) * (points[2 * c] - x)
  );
}

/** Decodes the lattice points and triangles of a base (MSH-3 to MSH-9). */
class Base {
  constructor(mesh) {
    this.count = mesh.vertices;
    this.symbols = decodeArray(mesh.symbols, 1, 1, mesh.gates, 4);
    this.far = mesh.far;
    this.residuals = decodeSigned(mesh.classes, mesh.deltas, 2, 1, mesh.vertices);
    this.points = new Int32Array(2 * mesh.vertices);
    this.triangles = [];
    this.known = 0; // vertices so far
    this.used = 0; // symbols so far
    this.usedFar = 0;
    this.edges = new Set(); // directed, as numbers
    this.queue = [];
    this.near = new Map(); // of the open gates
    this.open = new Map(); // vertices of open gates, and of how many

    while (this.used < this.symbols.length) {
      const a = this.#vertex(0, 0);
      const b = this.#vertex(this.points[2 * a], this.points[2 * a + 1]);
      this.#add(a, b, this.#vertex(this.points[2 * b], this.points[2 * b + 1]));
      this.#passGates();
    }
    need(this.known === this.count, "vertices are left over");
    need(this.usedFar === this.far.length, "far vertices are left over");
  }

  #passGates() {
    for (let at = 0; at < this.queue.length; at++) {
      const gate = this.queue[at];
      if (!this.near.has(gate)) continue;
      const n = this.near.get(gate);
      this.#close(gate);
      const [x, y] = [Math.floor(gate / 65536), gate % 65536];
      const p = this.points;
      const across = p[2 * x] + p[2 * y] - p[2 * n];
      const down = p[2 * x + 1] + p[2 * y + 1] - p[2 * n + 1];
      const z = this.#vertex(across, down, [x, y]);
      if (z !== null) this.#add(y, x, z);
    }
    this.queue = [];
  }

  /** The vertex that the next symbol names; `gate` is null at the start of a part. */
  #vertex(across, down, gate = null) {
    need(this.used < this.symbols.length, "the symbols of a mesh end early");
    const symbol = this.symbols[this.used++];
    if (symbol === NEW) {
      const v = this.known++;
      need(v < this.count, "a mesh has more vertices than announced");
      this.points[2 * v] = (across + this.residuals[v]) & 255;
      this.points[2 * v + 1] = (down + this.residuals[this.count + v]) & 255;
      return v;
    }
    if (symbol === FAR) {
      const v = this.far[this.usedFar++];
      need(v < this.known, "a far vertex does not exist yet");
      return v;
    }
    need(gate !== null, "a part begins without a vertex");
    return symbol < RANKED ? null : this.#ranked(symbol - RANKED, across, down, gate);
  }

  /** MSH-8. */
  #ranked(rank, across, down, [x, y]) {
    const best = []; // [square of the distance, vertex], ascending, at most rank + 1
    for (const v of this.open.keys()) {
      const square = (this.points[2 * v] - across) ** 2 + (this.points[2 * v + 1] - down) ** 2;
      const last = best[rank];
      if (last && (square > last[0] || (square === last[0] && v > last[1]))) continue;
      if (area(this.points, y, x, v) <= 0) continue;
      best.push([square, v]);
      best.sort((a, b) => a[0] - b[0] || a[1] - b[1]);
      best.length = Math.min(best.length, rank + 1);
    }
    need(best.length > rank, "no vertex has this rank");
    return best[rank][1];
  }

  /** MSH-6. */
  #add(a, b, c) {
    need(area(this.points, a, b, c) > 0, "a triangle has no area, or is turned over");
    for (const [x, y, n] of [[a, b, c], [b, c, a], [c, a, b]]) {
      const edge = x * 65536 + y;
      const back = y * 65536 + x;
      need(!this.edges.has(edge), "two triangles have one directed edge");
      this.edges.add(edge);
      if (this.near.has(back)) this.#close(back);
      else if (!this.edges.has(back)) this.#openGate(edge, n);
    }
    this.triangles.push([a, b, c]);
  }

  #openGate(gate, near) {
    this.near.set(gate, near);
    this.queue.push(gate);
    for (const v of [Math.floor(gate / 65536), gate % 65536]) {
      this.open.set(v, (this.open.get(v) ?? 0) + 1);
    }
  }

  #close(gate) {
    this.near.delete(gate);
    for (const v of [Math.floor(gate / 65536), gate % 65536]) {
      const left = this.open.get(v) - 1;
      if (left) this.open.set(v, left);
      else this.open.delete(v);
    }
  }
}

/** Pairs of node numbers as numbers, which ascend like the pairs. */
const SHIFT = 2 ** 22;
const pair = (a, b) => Math.min(a, b) * SHIFT + Math.max(a, b);
const pairs = ([a, b, c]) => [pair(a, b), pair(b, c), pair(c, a)];

/** MSH-13. */
function four(triangle, middle) {
  const [a, b, c] = triangle;
  const [d, e, f] = pairs(triangle).map((p) => middle.get(p));
  return [[a, d, f], [d, b, e], [f, e, c], [d, e, f]];
}

/**
 * A mesh: `nodes` at rest x, y, .. in 1/1024 canvas pixel, the two `ends` of each (a vertex has
 * itself twice), and `faces` of three nodes.
 */
export function decodeMesh(mesh, limits) {
  const base = new Base(mesh);
  const nodes = Array.from(base.points, (p, i) => {
    return 1024 * mesh.origin[i & 1] + p * mesh.step[i & 1];
  });
  const ends = Array.from(nodes, (_, i) => i >> 1);
  const middle = new Map();
  const whole = []; // triangles that were not split, as [base triangle, corners]
  let triangles = base.triangles.map((t, home) => [home, t]);
  let at = 0;
  for (let level = 0; level < mesh.levels; level++) {
    limits.spend("faces", 4 * triangles.length);
    const data = takeArray(mesh.splits, at);
    at += 4 + data.length;
    const flags = decodeArray(data, 1, 1, triangles.length, 1);
    const split = triangles.filter((_, i) => flags[i]);
    need(split.length, "a refinement splits nothing");
    for (let i = 0; i < triangles.length; i++) if (!flags[i]) whole.push(triangles[i]);
    addMidpoints(split, middle, nodes, ends);
    triangles = split.flatMap(([home, t]) => four(t, middle).map((child) => [home, child]));
  }
  need(at === mesh.splits.length, "split flags are left over");
  return {
    nodes: Float64Array.from(nodes),
    ends: Uint32Array.from(ends),
    faces: close(whole.concat(triangles), middle),
  };
}

/** MSH-12. */
function addMidpoints(split, middle, nodes, ends) {
  const fresh = new Set(split.flatMap(([, t]) => pairs(t)).filter((p) => !middle.has(p)));
  for (const p of Float64Array.from(fresh).sort()) {
    const [a, b] = [Math.floor(p / SHIFT), p % SHIFT];
    middle.set(p, nodes.length / 2);
    for (const axis of [0, 1]) {
      nodes.push(Math.floor((nodes[2 * a + axis] + nodes[2 * b + axis]) / 2));
    }
    ends.push(a, b);
  }
}

/** MSH-14 and MSH-15. */
function close(triangles, middle) {
  const faces = [];
  while (triangles.length) {
    const parts = [[], [], []];
    for (const [home, t] of triangles) {
      const halved = pairs(t).map((p) => middle.has(p));
      const count = halved.filter(Boolean).length;
      if (count) parts[count - 1].push(...divided(t, halved, count, middle).map((d) => [home, d]));
      else faces.push([home, t]);
    }
    triangles = parts.flat();
  }
  faces.sort((a, b) => a[0] - b[0]); // stable
  return faces.map(([, t]) => t);
}

function divided(triangle, halved, count, middle) {
  if (count === 3) return four(triangle, middle);
  const turn = count === 1 ? halved.indexOf(true) : (halved.indexOf(false) + 1) % 3;
  const t = [0, 1, 2].map((i) => triangle[(i + turn) % 3]);
  const [a, b, c] = t;
  const [d, e] = pairs(t).map((p) => middle.get(p));
  return count === 1 ? [[a, d, c], [d, b, c]] : [[d, b, e], [a, d, c], [d, e, c]];
}

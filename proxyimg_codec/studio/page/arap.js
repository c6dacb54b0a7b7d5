/**
 * Free deformation of a triangle mesh by dragging a few points of it, as `edit/deform.py` does it:
 * as rigid as possible, one rotation a triangle, heavy ball steps, stiffening of what would fold.
 * The same steps in the same order, so that the page shows what `drag` will store.
 *
 * Points are flat arrays x0, y0, x1, y1, ... in canvas pixels; triangles flat arrays of three nodes.
 */

const COTANGENT = [0.05, 10];
const STEPS = 150;
const STRIDE = 1.5, MOMENTUM = 0.6;
const STILL = 1e-5;
const ROUNDS = 32, ROUND_STEPS = 10;
const FOLDING = 0.02, SQUEEZED = 0.25;

/**
 * Skyline Cholesky factorization of a symmetric definite matrix of a mesh, in the order of the
 * distances of nodes from one end of it, which keeps what is stored close to the diagonal.
 */
class Skyline {
  /** @type {Float64Array|undefined} */
  work;

  /** @param {number} count @param {ArrayLike<number>[]} elements flat triples; the first connects all */
  constructor(count, elements) {
    const from = levels(count, elements[0], 0);
    const level = levels(count, elements[0], from.indexOf(Math.max(...from)));
    const order = Array.from({ length: count }, (_, i) => i).sort((a, b) => level[a] - level[b] || a - b);
    this.count = count;
    this.place = new Int32Array(count);
    order.forEach((node, i) => { this.place[node] = i; });
    this.first = Int32Array.from({ length: count }, (_, i) => i);
    this.elements = elements;
    for (const list of elements) {
      for (let e = 0; e < list.length; e += 3) {
        const at = [this.place[list[e]], this.place[list[e + 1]], this.place[list[e + 2]]];
        const low = Math.min(...at);
        for (const i of at) this.first[i] = Math.min(this.first[i], low);
      }
    }
    this.row = new Int32Array(count + 1);
    for (let i = 0; i < count; i++) this.row[i + 1] = this.row[i] + i - this.first[i] + 1;
    this.values = new Float64Array(this.row[count]);
  }

  /** Factors the sum of element matrices. @param {Float64Array[]} matrices nine numbers an element */
  factor(matrices) {
    const { count, first, row, values, place } = this;
    values.fill(0);
    matrices.forEach((matrix, k) => {
      const list = this.elements[k];
      for (let e = 0; e < list.length; e += 3) {
        for (let i = 0; i < 3; i++) for (let j = 0; j < 3; j++) {
          const r = place[list[e + i]], c = place[list[e + j]];
          if (c <= r) values[row[r] + c - first[r]] += matrix[e * 3 + i * 3 + j];
        }
      }
    });
    for (let i = 0; i < count; i++) {
      const low = first[i], at = row[i] - low;
      for (let j = low; j < i; j++) {
        const start = Math.max(low, first[j]), other = row[j] - first[j];
        let sum = values[at + j];
        for (let k = start; k < j; k++) sum -= values[at + k] * values[other + k];
        values[at + j] = sum / values[other + j];
      }
      let square = values[at + i];
      for (let k = low; k < i; k++) square -= values[at + k] * values[at + k];
      values[at + i] = Math.sqrt(Math.max(square, 1e-300));
    }
  }

  /** Solves for two columns at once, in place. @param {Float64Array} right x, y of each node */
  solve(right) {
    const { count, first, row, values, place } = this;
    const sorted = (this.work ??= new Float64Array(2 * count));
    for (let n = 0; n < count; n++) {
      sorted[2 * place[n]] = right[2 * n];
      sorted[2 * place[n] + 1] = right[2 * n + 1];
    }
    for (let i = 0; i < count; i++) {
      const at = row[i] - first[i], pivot = values[at + i];
      let x = sorted[2 * i], y = sorted[2 * i + 1];
      for (let k = first[i]; k < i; k++) {
        const v = values[at + k];
        x -= v * sorted[2 * k];
        y -= v * sorted[2 * k + 1];
      }
      sorted[2 * i] = x / pivot;
      sorted[2 * i + 1] = y / pivot;
    }
    for (let i = count - 1; i >= 0; i--) {
      const at = row[i] - first[i], pivot = values[at + i];
      const x = (sorted[2 * i] /= pivot), y = (sorted[2 * i + 1] /= pivot);
      for (let k = first[i]; k < i; k++) {
        const v = values[at + k];
        sorted[2 * k] -= v * x;
        sorted[2 * k + 1] -= v * y;
      }
    }
    for (let n = 0; n < count; n++) {
      right[2 * n] = sorted[2 * place[n]];
      right[2 * n + 1] = sorted[2 * place[n] + 1];
    }
  }
}

/** Distance in edges of every node of a connected mesh from the node `start`; unreached ones 0. */
function levels(count, triangles, start) {
  const near = Array.from({ length: count }, () => /** @type {number[]} */ ([]));
  for (let t = 0; t < triangles.length; t += 3) {
    for (let i = 0; i < 3; i++) near[triangles[t + i]].push(triangles[t + ((i + 1) % 3)], triangles[t + ((i + 2) % 3)]);
  }
  const level = new Array(count).fill(-1);
  level[start] = 0;
  for (let queue = [start], i = 0; i < queue.length; i++) {
    for (const n of near[queue[i]]) if (level[n] < 0) { level[n] = level[queue[i]] + 1; queue.push(n); }
  }
  return level.map((v) => Math.max(v, 0));
}

/**
 * Triangle that holds a point, or is nearest to it, and the weights of its corners there.
 * @returns {{triangle: number, weights: number[], distance: number}}
 */
export function attach(nodes, triangles, x, y) {
  let best = { triangle: 0, weights: [1, 0, 0], distance: Infinity };
  for (let t = 0; t < triangles.length; t += 3) {
    const at = [0, 1, 2].map((i) => [nodes[2 * triangles[t + i]], nodes[2 * triangles[t + i] + 1]]);
    const weights = [0, 0, 0];
    const edges = [0, 1, 2].map((i) => {
      const a = at[(i + 1) % 3], b = at[(i + 2) % 3];
      return [b[0] - a[0], b[1] - a[1], x - a[0], y - a[1]];
    });
    const area = edges[0][0] * edges[1][1] - edges[0][1] * edges[1][0];
    const longest = Math.max(...edges.map((e) => e[0] ** 2 + e[1] ** 2));
    if (Math.abs(area) > 1e-9 * longest) {
      edges.forEach((e, i) => { weights[i] = (e[0] * e[3] - e[1] * e[2]) / area; });
      if (Math.min(...weights) >= 0) return { triangle: t / 3, weights, distance: 0 };
    }
    edges.forEach((e, i) => {
      const along = Math.min(1, Math.max(0, (e[0] * e[2] + e[1] * e[3]) / Math.max(e[0] ** 2 + e[1] ** 2, 1e-300)));
      const distance = Math.hypot(e[2] - along * e[0], e[3] - along * e[1]);
      if (distance < best.distance) {
        const w = [0, 0, 0];
        w[(i + 1) % 3] = 1 - along;
        w[(i + 2) % 3] = along;
        best = { triangle: t / 3, weights: w, distance };
      }
    });
  }
  return best;
}

/** Rigid motion that maps points `before` to `after` best, applied to `z`. All flat. */
function rigid(before, after, z, weights = null) {
  const n = before.length / 2, c = [0, 0, 0, 0];
  let total = 0;
  for (let i = 0; i < n; i++) {
    const w = weights ? weights[i] : 1;
    total += w;
    c[0] += w * before[2 * i]; c[1] += w * before[2 * i + 1];
    c[2] += w * after[2 * i]; c[3] += w * after[2 * i + 1];
  }
  for (let k = 0; k < 4; k++) c[k] /= total;
  let re = 0, im = 0, size = 0;
  for (let i = 0; i < n; i++) {
    const w = (weights ? weights[i] : 1) / total;
    const x = before[2 * i] - c[0], y = before[2 * i + 1] - c[1];
    const u = after[2 * i] - c[2], v = after[2 * i + 1] - c[3];
    re += w * (x * u + y * v);
    im += w * (x * v - y * u);
    size += w * (x * x + y * y);
  }
  const length = Math.hypot(re, im);
  const [cos, sin] = length > 1e-9 * size ? [re / length, im / length] : [1, 0];
  const out = new Float64Array(z.length);
  for (let i = 0; i < z.length; i += 2) {
    const x = z[i] - c[0], y = z[i + 1] - c[1];
    out[i] = c[2] + cos * x - sin * y;
    out[i + 1] = c[3] + sin * x + cos * y;
  }
  return out;
}

/** Connected component with its handles, and the linear system of the global step. */
class Body {
  constructor(rest, triangles, holders, weights) {
    this.rest = rest;
    this.triangles = triangles;
    this.count = rest.length / 2;
    this.handles = holders.length;
    const T = triangles.length / 3;
    this.edge = new Float64Array(2 * triangles.length);
    this.cotangent = new Float64Array(triangles.length);
    this.area = new Float64Array(T);
    this.solid = new Uint8Array(T);
    for (let t = 0; t < T; t++) this.#measure(t);
    let mx = 0, my = 0;
    for (let i = 0; i < this.count; i++) { mx += rest[2 * i] / this.count; my += rest[2 * i + 1] / this.count; }
    this.extent = 0;
    for (let i = 0; i < this.count; i++) this.extent = Math.max(this.extent, Math.hypot(rest[2 * i] - mx, rest[2 * i + 1] - my));
    this.corners = Int32Array.from(holders.flatMap((h) => [0, 1, 2].map((i) => triangles[3 * h + i])));
    this.shares = Float64Array.from(weights.flat());
    this.matrix = new Skyline(this.count, [triangles, this.corners]);
    this.own = new Float64Array(9 * this.handles);
    for (let h = 0; h < this.handles; h++) for (let i = 0; i < 9; i++) {
      this.own[9 * h + i] = this.shares[3 * h + ((i / 3) | 0)] * this.shares[3 * h + (i % 3)];
    }
    this.stiffen(null);
  }

  #measure(t) {
    const { rest, triangles, edge } = this;
    const d = [];
    for (let i = 0; i < 3; i++) {
      const a = triangles[3 * t + ((i + 1) % 3)], b = triangles[3 * t + ((i + 2) % 3)];
      d.push([rest[2 * b] - rest[2 * a], rest[2 * b + 1] - rest[2 * a + 1]]);
      edge[6 * t + 2 * i] = d[i][0];
      edge[6 * t + 2 * i + 1] = d[i][1];
    }
    this.area[t] = d[0][0] * d[1][1] - d[0][1] * d[1][0];
    this.solid[t] = Number(Math.abs(this.area[t]) > 1e-6 * Math.max(...d.map((e) => e[0] ** 2 + e[1] ** 2)));
    for (let i = 0; i < 3; i++) {
      const u = d[(i + 1) % 3], v = d[(i + 2) % 3];
      const dot = -(u[0] * v[0] + u[1] * v[1]), cross = Math.abs(u[0] * v[1] - u[1] * v[0]);
      this.cotangent[3 * t + i] = Math.min(COTANGENT[1], Math.max(COTANGENT[0], dot / Math.max(cross, 1e-300)));
    }
  }

  /** Multiplies the energy of each triangle by a factor, and factors the system. */
  stiffen(factor) {
    const { triangles, cotangent, handles, count } = this;
    this.soft = !factor;
    this.weight = factor ? cotangent.map((c, i) => c * factor[(i / 3) | 0]) : cotangent;
    const elements = new Float64Array(3 * triangles.length);
    for (let t = 0; t < triangles.length; t += 3) {
      const [a, b, c] = [this.weight[t], this.weight[t + 1], this.weight[t + 2]];
      elements.set([b + c, -c, -b, -c, a + c, -a, -b, -a, a + b], 3 * t);
    }
    this.matrix.factor([elements, this.own]);
    this.pull = [];
    for (let h = 0; h < handles; h++) {
      const column = new Float64Array(2 * count);
      for (let i = 0; i < 3; i++) column[2 * this.corners[3 * h + i]] += this.shares[3 * h + i];
      this.matrix.solve(column);
      this.pull.push(column.filter((_, i) => i % 2 === 0));
    }
    const s = this.pull.map((column) => this.pull.map((_, h) => this.#held(column, h)));
    this.force = pseudoInverse(s);
  }

  /** Value of a column of numbers at a handle. */
  #held(column, h) {
    let sum = 0;
    for (let i = 0; i < 3; i++) sum += this.shares[3 * h + i] * column[this.corners[3 * h + i]];
    return sum;
  }

  /** Positions of least energy for the rotations that fit `z` best; handles are met. */
  step(z, targets) {
    const { triangles, edge, weight, corners, shares, handles } = this;
    const x = new Float64Array(2 * this.count);
    for (let t = 0; t < triangles.length; t += 3) {
      let re = 0, im = 0;
      for (let i = 0; i < 3; i++) {
        const a = 2 * triangles[t + (i + 1) % 3], b = 2 * triangles[t + (i + 2) % 3];
        const dx = edge[2 * t + 2 * i], dy = edge[2 * t + 2 * i + 1], w = weight[t + i];
        const u = z[b] - z[a], v = z[b + 1] - z[a + 1];
        re += w * (dx * u + dy * v);
        im += w * (dx * v - dy * u);
      }
      const length = Math.hypot(re, im);
      const cos = length ? re / length : 1, sin = length ? im / length : 0;
      for (let i = 0; i < 3; i++) {
        const a = 2 * triangles[t + (i + 1) % 3], b = 2 * triangles[t + (i + 2) % 3];
        const dx = edge[2 * t + 2 * i], dy = edge[2 * t + 2 * i + 1], w = weight[t + i];
        const u = w * (cos * dx - sin * dy), v = w * (sin * dx + cos * dy);
        x[b] += u; x[b + 1] += v;
        x[a] -= u; x[a + 1] -= v;
      }
    }
    for (let h = 0; h < handles; h++) for (let i = 0; i < 3; i++) {
      const n = 2 * corners[3 * h + i], w = shares[3 * h + i];
      x[n] += w * targets[2 * h];
      x[n + 1] += w * targets[2 * h + 1];
    }
    this.matrix.solve(x);
    const missing = new Float64Array(2 * handles);
    for (let h = 0; h < handles; h++) {
      let u = targets[2 * h], v = targets[2 * h + 1];
      for (let i = 0; i < 3; i++) {
        const n = 2 * corners[3 * h + i], w = shares[3 * h + i];
        u -= w * x[n];
        v -= w * x[n + 1];
      }
      missing[2 * h] = u;
      missing[2 * h + 1] = v;
    }
    for (let h = 0; h < handles; h++) {
      let u = 0, v = 0;
      for (let g = 0; g < handles; g++) { u += this.force[h][g] * missing[2 * g]; v += this.force[h][g] * missing[2 * g + 1]; }
      if (!u && !v) continue;
      const pull = this.pull[h];
      for (let n = 0; n < this.count; n++) { x[2 * n] += pull[n] * u; x[2 * n + 1] += pull[n] * v; }
    }
    return x;
  }

  /** Smaller singular value of each triangle's map from rest; negative if it is folded. */
  stretch(z) {
    const { triangles, edge, solid, area } = this, T = triangles.length / 3;
    const out = new Float64Array(T);
    for (let t = 0; t < T; t++) {
      if (!solid[t]) { out[t] = 1; continue; }
      const [n0, n1, n2] = [triangles[3 * t], triangles[3 * t + 1], triangles[3 * t + 2]];
      const [ax, ay, bx, by] = [edge[6 * t], edge[6 * t + 1], edge[6 * t + 2], edge[6 * t + 3]];
      const ex = z[2 * n2] - z[2 * n1], ey = z[2 * n2 + 1] - z[2 * n1 + 1];
      const fx = z[2 * n0] - z[2 * n2], fy = z[2 * n0 + 1] - z[2 * n2 + 1];
      // f conj(a) - e conj(b), and f a - e b
      const p = Math.hypot(fx * ax + fy * ay - ex * bx - ey * by, fy * ax - fx * ay - ey * bx + ex * by);
      const q = Math.hypot(fx * ax - fy * ay - ex * bx + ey * by, fx * ay + fy * ax - ex * by - ey * bx);
      out[t] = (p - q) / (2 * Math.abs(area[t]));
    }
    return out;
  }

  /** Minimizes the energy from `z`; then stiffens folded triangles while that unfolds some. */
  settle(z, targets, rounds, until) {
    if (!this.soft) this.stiffen(null);
    let best = (z = this.#alternate(z, targets, STEPS, until));
    let squeeze = this.stretch(z), fewest = squeeze.filter((v) => v <= 0).length;
    const factor = new Float64Array(squeeze.length).fill(1);
    for (let round = 0; round < rounds && performance.now() < until; round++) {
      if (squeeze.every((v) => v > FOLDING)) break;
      squeeze.forEach((v, t) => { if (v < SQUEEZED) factor[t] *= 2; });
      this.stiffen(factor);
      z = this.#alternate(z, targets, ROUND_STEPS, until);
      squeeze = this.stretch(z);
      const folds = squeeze.filter((v) => v <= 0).length;
      if (folds <= fewest) { best = z; fewest = folds; }
    }
    return best;
  }

  #alternate(start, targets, steps, until) {
    let z = this.step(start, targets), before = z;
    for (let i = 0; i < steps && performance.now() < until; i++) {
      const next = this.step(z, targets);
      let moved = 0;
      for (let k = 0; k < z.length; k++) next[k] = z[k] + STRIDE * (next[k] - z[k]) + MOMENTUM * (z[k] - before[k]);
      for (let k = 0; k < z.length; k += 2) moved = Math.max(moved, Math.hypot(next[k] - z[k], next[k + 1] - z[k + 1]));
      before = z;
      z = next;
      if (moved <= STILL * this.extent) break;
    }
    return this.step(z, targets);
  }
}

/** Pseudo-inverse of a symmetric matrix, by Jacobi rotations; tiny eigenvalues count as none. */
function pseudoInverse(matrix) {
  const n = matrix.length, a = matrix.map((r) => r.slice());
  const v = a.map((_, i) => a.map((_, j) => Number(i === j)));
  for (let sweep = 0; sweep < 60; sweep++) {
    let off = 0, size = 0;
    for (let i = 0; i < n; i++) for (let j = 0; j < n; j++) { size += a[i][j] ** 2; if (i !== j) off += a[i][j] ** 2; }
    if (off <= 1e-26 * size) break;
    for (let p = 0; p < n; p++) for (let q = p + 1; q < n; q++) {
      if (!a[p][q]) continue;
      const theta = (a[q][q] - a[p][p]) / (2 * a[p][q]);
      const t = (theta < 0 ? -1 : 1) / (Math.abs(theta) + Math.hypot(theta, 1));
      const c = 1 / Math.hypot(t, 1), s = t * c;
      for (let k = 0; k < n; k++) { const x = a[k][p], y = a[k][q]; a[k][p] = c * x - s * y; a[k][q] = s * x + c * y; }
      for (let k = 0; k < n; k++) { const x = a[p][k], y = a[q][k]; a[p][k] = c * x - s * y; a[q][k] = s * x + c * y; }
      for (let k = 0; k < n; k++) { const x = v[k][p], y = v[k][q]; v[k][p] = c * x - s * y; v[k][q] = s * x + c * y; }
    }
  }
  const most = Math.max(...a.map((r, i) => Math.abs(r[i])));
  const inverse = a.map((r, i) => (Math.abs(r[i]) > 1e-10 * most ? 1 / r[i] : 0));
  return a.map((_, i) => a.map((_, j) => v[i].reduce((sum, x, k) => sum + x * inverse[k] * v[j][k], 0)));
}

/** Component of each node: the lowest node that triangles connect it to. */
function components(count, triangles) {
  const up = Int32Array.from({ length: count }, (_, i) => i);
  const root = (/** @type {number} */ i) => { while (up[i] !== i) i = up[i] = up[up[i]]; return i; };
  for (let t = 0; t < triangles.length; t += 3) {
    for (let k = 1; k < 3; k++) {
      const a = root(triangles[t]), b = root(triangles[t + k]);
      up[Math.max(a, b)] = Math.min(a, b);
    }
  }
  return up.map((_, i) => root(i));
}

/**
 * Mesh that is held at some points, ready to be dragged again and again. What depends on the points
 * alone is prepared once.
 */
export class Puppet {
  /**
   * @param {ArrayLike<number>} nodes present positions [2 N]
   * @param {ArrayLike<number>} triangles [3 T]
   * @param {ArrayLike<number>} points points of the present mesh that are held [2 H]
   * @param {ArrayLike<number>} rest positions whose local shape is kept [2 N]
   */
  constructor(nodes, triangles, points, rest = nodes) {
    this.nodes = Float64Array.from(nodes);
    this.points = Float64Array.from(points);
    const count = nodes.length / 2, H = points.length / 2;
    const held = Array.from({ length: H }, (_, h) => attach(nodes, triangles, points[2 * h], points[2 * h + 1]));
    this.places = new Float64Array(2 * H);
    held.forEach(({ triangle, weights }, h) => weights.forEach((w, i) => {
      this.places[2 * h] += w * nodes[2 * triangles[3 * triangle + i]];
      this.places[2 * h + 1] += w * nodes[2 * triangles[3 * triangle + i] + 1];
    }));
    this.component = components(count, triangles);
    this.grabbed = held.map(({ triangle }) => this.component[triangles[3 * triangle]]);
    /** @type {{inside: number[], mine: number[], body: Body | null, last?: Float64Array}[]} */
    this.parts = [];
    for (const c of [...new Set(this.grabbed)].sort((a, b) => a - b)) {
      const mine = this.grabbed.flatMap((g, h) => (g === c ? [h] : []));
      const inside = Array.from(this.component.keys()).filter((n) => this.component[n] === c);
      this.parts.push({ inside, mine, body: mine.length < 2 ? null : this.#body(inside, mine, held, triangles, rest) });
    }
  }

  #body(inside, mine, held, triangles, rest) {
    const local = new Map(inside.map((n, i) => [n, i])), number = new Map();
    const mesh = [];
    for (let t = 0; t < triangles.length; t += 3) {
      if (!local.has(triangles[t])) continue;
      number.set(t / 3, mesh.length / 3);
      for (let i = 0; i < 3; i++) mesh.push(local.get(triangles[t + i]));
    }
    const own = Float64Array.from(inside.flatMap((n) => [rest[2 * n], rest[2 * n + 1]]));
    return new Body(own, Int32Array.from(mesh), mine.map((h) => number.get(held[h].triangle)), mine.map((h) => held[h].weights));
  }

  /**
   * Positions of all nodes [2 N] when the held points are at their targets.
   * @param {ArrayLike<number>} targets [2 H]
   * @param {{rounds?: number, milliseconds?: number, warm?: boolean}} budget less than all gives a sketch; `warm` goes
   *   on from the last one, which is near where the pointer has moved only a little
   */
  drag(targets, { rounds = ROUNDS, milliseconds = Infinity, warm = false } = {}) {
    const until = performance.now() + milliseconds;
    const { nodes, points, places } = this;
    const moved = Float64Array.from(nodes);
    const goal = places.map((p, k) => targets[k] - (points[k] - p));
    for (const part of this.parts) {
      const { inside, mine, body } = part;
      if (!body) {
        const [h] = mine, dx = goal[2 * h] - places[2 * h], dy = goal[2 * h + 1] - places[2 * h + 1];
        for (const n of inside) { moved[2 * n] += dx; moved[2 * n + 1] += dy; }
        continue;
      }
      const pick = (/** @type {ArrayLike<number>} */ v, /** @type {number[]} */ at) => Float64Array.from(at.flatMap((k) => [v[2 * k], v[2 * k + 1]]));
      const aim = pick(goal, mine);
      const start = (warm && part.last) || rigid(pick(places, mine), aim, pick(nodes, inside));
      const z = (part.last = body.settle(start, aim, rounds, until));
      inside.forEach((n, i) => { moved[2 * n] = z[2 * i]; moved[2 * n + 1] = z[2 * i + 1]; });
    }
    if (this.parts.length) this.#follow(moved);
    return moved;
  }

  /** Moves the components without a handle with their surroundings (moving least squares). */
  #follow(moved) {
    const { nodes, component } = this, held = new Set(this.grabbed);
    const leads = [], others = new Map();
    component.forEach((c, n) => {
      if (held.has(c)) leads.push(n);
      else others.set(c, [...(others.get(c) ?? []), n]);
    });
    const pick = (/** @type {Float64Array} */ v, /** @type {number[]} */ at) => Float64Array.from(at.flatMap((k) => [v[2 * k], v[2 * k + 1]]));
    for (const own of others.values()) {
      let x = 0, y = 0;
      for (const n of own) { x += nodes[2 * n] / own.length; y += nodes[2 * n + 1] / own.length; }
      const weights = leads.map((n) => 1 / ((nodes[2 * n] - x) ** 2 + (nodes[2 * n + 1] - y) ** 2 + 1) ** 2);
      const z = rigid(pick(nodes, leads), pick(moved, leads), pick(nodes, own), weights);
      own.forEach((n, i) => { moved[2 * n] = z[2 * i]; moved[2 * n + 1] = z[2 * i + 1]; });
    }
  }
}

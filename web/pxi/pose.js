/** Chapter 6, "Pose" and "Outline": where layers are now. Points are x, y in flat arrays. */

import { identity } from "./chunks.js";
import { decodeSigned } from "./entropy.js";
import { need, within } from "./errors.js";
import { clamp, dotDiv, sumDiv } from "./integers.js";

const POINT_MAX = 2 ** 30;
const NODE_MAX = 2 ** 24;
const PIECE = 4096;
const PIECES_LOG2_MAX = 6;
const GRID_BITS = 22;
const WEIGHT_MAX = 2 ** 20;

/** Adds to residuals what is expected of each node (MSH-18), in place. */
export function predict(values, ends, at, count) {
  for (let i = 0; i < count; i++) {
    const [p, q] = [ends[2 * i], ends[2 * i + 1]];
    if (p !== i) values[at + i] += Math.floor((values[at + p] + values[at + q]) / 2);
    else if (i) values[at + i] += values[at + i - 1];
  }
}

/** Displacements "node" or "place" of all nodes in 1/16 canvas pixel, or null (MSH-17 to 19). */
export function displacements(pose, kind, mesh) {
  const classes = pose[`${kind}_classes`];
  if (!classes.length) return null;
  const count = mesh.nodes.length / 2;
  const rows = decodeSigned(classes, pose[`${kind}_deltas`], 2, 1, count);
  predict(rows, mesh.ends, 0, count);
  predict(rows, mesh.ends, count, count);
  need(rows.some((v) => v !== 0), "displacements are all 0");
  need(rows.every((v) => Math.abs(v) < NODE_MAX), "a displacement is too large");
  return rows.map((_, i) => rows[(i & 1) * count + (i >> 1)]);
}

/** Points in 1/1024 canvas pixel under the affine map of a pose (MSH-20). */
export function mapped(pose, points) {
  if (identity(pose)) return points;
  const [a, b, c, d] = pose.matrix;
  const [e, f] = pose.shift;
  const out = new Float64Array(points.length);
  for (let i = 0; i < points.length; i += 2) {
    const x = clamp(points[i], -POINT_MAX, POINT_MAX);
    const y = clamp(points[i + 1], -POINT_MAX, POINT_MAX);
    out[i] = dotDiv(a, x, c, y, 2 ** 23, 2 ** 24) + e;
    out[i + 1] = dotDiv(b, x, d, y, 2 ** 23, 2 ** 24) + f;
  }
  return out;
}

/**
 * The outline of a layer: its paths in their present place, and their unit (MSH-22 to MSH-29).
 *
 * `moves` are the displacements of the nodes in 1/1024 canvas pixel, null if it is not bent.
 */
export function outline(paths, unit, size, pose, moves, mesh, limits) {
  if (identity(pose) && !moves) return { paths, unit };
  if (!paths) {
    const [w, h] = size;
    const corners = [[0, 0], [w, 0], [w, h], [0, h]];
    paths = [corners.flatMap((corner, i) => [...corner, ...corner, ...corners[(i + 1) % 4]])];
    unit = 0;
  }
  paths = paths.map((path) => Float64Array.from(path, (p) => p * 2 ** (10 - unit)));
  if (moves) {
    const rider = new Rider(mesh, moves, limits);
    paths = paths.map((path) => rider.moved(divide(path)));
  }
  return { paths: paths.map((path) => mapped(pose, path)), unit: 10 };
}

/** The path with its segments divided into pieces (MSH-25). */
function divide(path) {
  const result = [];
  for (let k = 0; k < path.length; k += 6) {
    const axes = [0, 1].map((axis) => [0, 2, 4, 6].map((i) => path[((k + i) % path.length) + axis]));
    const extent = Math.max(...axes.map((values) => Math.max(...values) - Math.min(...values)));
    let log2 = 0;
    while (log2 < PIECES_LOG2_MAX && extent > PIECE * 2 ** log2) log2++;
    const n = 1 << log2;
    for (let i = 0; i < n; i++) {
      for (const [s, t, u] of [[i, i, i], [i, i, i + 1], [i, i + 1, i + 1]]) {
        const weights = blossom(n, s, t, u);
        for (const values of axes) result.push(sumDiv(weights, values, 0, n ** 3));
      }
    }
  }
  return Float64Array.from(result);
}

/** How much P, Q, R and S weigh in B(s, t, u), times n^3. */
function blossom(n, s, t, u) {
  const [a, b, c] = [n - s, n - t, n - u];
  return [
    a * b * c,
    s * b * c + a * t * c + a * b * u,
    s * t * c + s * b * u + a * t * u,
    s * t * u,
  ];
}

/** Moves control points with the nodes of a mesh (MSH-26 to MSH-29). */
class Rider {
  constructor(mesh, moves, limits) {
    const { nodes, faces } = mesh;
    this.moves = moves;
    this.faces = faces;
    this.left = limits.beyond;
    this.limits = limits;
    this.low = [Infinity, Infinity];
    const high = [-Infinity, -Infinity];
    nodes.forEach((v, i) => {
      this.low[i & 1] = Math.min(this.low[i & 1], v);
      high[i & 1] = Math.max(high[i & 1], v);
    });
    const extent = Math.max(high[0] - this.low[0], high[1] - this.low[1]);
    const bits = extent ? Math.floor(Math.log2(extent)) + 1 : 0; // exact: extents are below 2^36
    this.scale = 2 ** Math.max(bits - GRID_BITS, 0);
    this.grid = nodes.map((v, i) => Math.floor((v - this.low[i & 1]) / this.scale));
    this.strip = 2 ** Math.max(Math.min(bits, GRID_BITS) - 7, 0);
    this.#sortIntoStrips();
  }

  /** Faces by strips of rows, so that few need to be looked at. */
  #sortIntoStrips() {
    this.strips = Array.from({ length: 129 }, () => []);
    for (const face of this.faces) {
      const ys = face.map((i) => this.grid[2 * i + 1]);
      const last = Math.floor(Math.max(...ys) / this.strip);
      for (let s = Math.floor(Math.min(...ys) / this.strip); s <= last; s++) {
        this.strips[s].push(face);
      }
    }
  }

  #side(a, b, x, y) {
    const { grid } = this;
    const [ax, ay] = [grid[2 * a], grid[2 * a + 1]];
    return (grid[2 * b] - ax) * (y - ay) - (grid[2 * b + 1] - ay) * (x - ax);
  }

  /** The face that holds a point, or null (MSH-27). */
  #holding(x, y) {
    const near = this.strips[Math.floor(y / this.strip)] ?? [];
    this.#spend(near.length / 4);
    for (const face of near) {
      const [a, b, c] = face;
      if (this.#side(a, b, x, y) >= 0 && this.#side(b, c, x, y) >= 0 && this.#side(c, a, x, y) >= 0) {
        return face;
      }
    }
    return null;
  }

  /** The face that is nearest to a point which no face holds (MSH-27). */
  #nearest(x, y) {
    this.sums ??= Float64Array.from({ length: 2 * this.faces.length }, (_, i) =>
      this.faces[i >> 1].reduce((sum, node) => sum + this.grid[2 * node + (i & 1)], 0));
    const { sums } = this;
    let [best, least] = [0, Infinity];
    for (let i = 0; i < sums.length; i += 2) {
      const dx = sums[i] - 3 * x;
      const dy = sums[i + 1] - 3 * y;
      const square = dx * dx + dy * dy;
      if (square < least) {
        best = i;
        least = square;
      }
    }
    return this.faces[best / 2];
  }

  #spend(count) {
    this.left -= count;
    within(this.limits.beyond - this.left, this.limits.beyond, "beyond");
  }

  /** MSH-28 and MSH-29. */
  moved(points) {
    const out = new Float64Array(points.length);
    const small = (v, axis) =>
      clamp(Math.floor((v - this.low[axis]) / this.scale), -(2 ** GRID_BITS), 2 ** (GRID_BITS + 1));
    const at = points.map((v, i) => small(v, i & 1));
    const holding = Array.from({ length: at.length / 2 }, (_, i) =>
      this.#holding(at[2 * i], at[2 * i + 1]));
    this.#spend(holding.filter((face) => !face).length * this.faces.length);
    for (let i = 0; i < points.length; i += 2) {
      const [x, y] = [at[i], at[i + 1]];
      const face = holding[i / 2] ?? this.#nearest(x, y);
      const [a, b, c] = face;
      const whole = Math.max(this.#side(a, b, this.grid[2 * c], this.grid[2 * c + 1]), 1);
      const share = (side) =>
        clamp(dotDiv(65536, side, 0, 0, 0, whole), -WEIGHT_MAX, WEIGHT_MAX);
      const wb = share(this.#side(c, a, x, y));
      const wc = share(this.#side(a, b, x, y));
      const weights = [65536 - wb - wc, wb, wc];
      for (const axis of [0, 1]) {
        const by = sumDiv(weights, face.map((n) => this.moves[2 * n + axis]), 32768, 65536);
        out[i + axis] = points[i + axis] + by;
      }
    }
    return out;
  }
}

/** Chapter 6, "Texture points": which point of a layer at rest each sample shows. */

import { REST, identity } from "./chunks.js";
import { within } from "./errors.js";
import { SAMPLE_COST } from "./limits.js";
import { mapped } from "./pose.js";

/** On which side of an edge p lies; exactly the opposite if the edge is turned round (MSH-33). */
function side(ax, ay, bx, by, x, y) {
  if (ax > bx || (ax === bx && ay > by)) return (ax - bx) * (y - by) - (ay - by) * (x - bx);
  return (by - ay) * (x - ax) - (bx - ax) * (y - ay);
}

/** Texture points of a layer whose mesh is not consulted (MSH-30). */
export class Straight {
  constructor(pose) {
    this.pose = pose ?? REST;
    this.identity = identity(this.pose);
    const [a, b, c, d] = this.pose.matrix.map(BigInt);
    this.determinant = Number(a * d - b * c);
  }

  /** Puts the texture points of canvas points (xs, ys) into us and vs. */
  locate(samples, xs, ys, us, vs) {
    if (this.identity) {
      us.set(xs);
      vs.set(ys);
      return;
    }
    const [a, b, c, d] = this.pose.matrix;
    const [e, f] = this.pose.shift;
    for (let i = 0; i < xs.length; i++) {
      const [x, y] = [xs[i] - e / 1024, ys[i] - f / 1024];
      us[i] = ((d * x - c * y) * 2 ** 24) / this.determinant;
      vs[i] = ((a * y - b * x) * 2 ** 24) / this.determinant;
    }
  }
}

/** Texture points of a layer with a mesh (MSH-31 to MSH-33). */
export class Bent {
  /**
   * `moves` are displacements in 1/1024 canvas pixel, `places` those of the texture in 1/16; both
   * may be null.
   */
  constructor(pose, moves, places, mesh, budget) {
    const { nodes, faces } = mesh;
    this.budget = budget;
    this.count = faces.length;
    const present = moves ? nodes.map((v, i) => v + moves[i]) : nodes;
    this.present = mapped(pose, present).map((v) => v / 1024);
    this.shown = nodes.map((v, i) => v / 1024 + (places ? places[i] / 16 : 0));
    const turned = new Straight(pose).determinant < 0;
    const solid = faces.filter((face) => this.#area(face) !== 0);
    const upright = (face) => this.#area(face) > 0 !== turned;
    this.faces = [...solid.filter(upright), ...solid.filter((face) => !upright(face))];
    this.faceOf = null; // of each sample of the last band
    this.weights = null;
  }

  #area([a, b, c]) {
    const p = this.present;
    const [x, y] = [p[2 * a], p[2 * a + 1]];
    return (
      (p[2 * b] - x) * (p[2 * c + 1] - y) - (p[2 * b + 1] - y) * (p[2 * c] - x)
    );
  }

  /** The first face that holds each sample of a band, or -1. */
  prepare(band) {
    const { columns, top, bottom, x, y } = band;
    const found = new Int32Array(columns * (bottom - top)).fill(-1);
    const p = this.present;
    let held = 0; // rows count too, but for one a face
    this.budget.spend("multiply_adds", SAMPLE_COST * this.faces.length);
    this.faces.forEach(([a, b, c], index) => {
      const before = held;
      let rows = 0;
      const [ax, ay, bx, by, cx, cy] = [
        p[2 * a], p[2 * a + 1], p[2 * b], p[2 * b + 1], p[2 * c], p[2 * c + 1]];
      const first = Math.max(Math.floor(band.rowAt(Math.min(ay, by, cy))) - 1, top);
      const last = Math.min(Math.ceil(band.rowAt(Math.max(ay, by, cy))) + 1, bottom - 1);
      for (let row = first; row <= last; row++) {
        const py = y(row);
        const [low, high] = crossing(py, ax, ay, bx, by, cx, cy);
        if (low > high) continue;
        rows++;
        const from = Math.max(Math.floor(band.columnAt(low)) - 1, 0);
        const to = Math.min(Math.ceil(band.columnAt(high)) + 1, columns - 1);
        for (let column = from; column <= to; column++) {
          const px = x(column);
          const s = side(ax, ay, bx, by, px, py);
          const t = side(bx, by, cx, cy, px, py);
          const u = side(cx, cy, ax, ay, px, py);
          if (!((s >= 0 && t >= 0 && u >= 0) || (s <= 0 && t <= 0 && u <= 0))) continue;
          held++;
          const at = (row - top) * columns + column;
          if (found[at] < 0) found[at] = index;
        }
      }
      held += Math.max(rows - 1, 0);
      this.budget.spend("multiply_adds", SAMPLE_COST * (held - before));
      within(held / found.length, this.budget.overlap, "overlap");
    });
    this.faceOf = found;
  }

  /** The face whose centroid is nearest to a point. */
  #nearest(x, y) {
    const p = this.present;
    this.centroids ??= Float64Array.from({ length: 2 * this.faces.length }, (_, i) => {
      const [a, b, c] = this.faces[i >> 1].map((node) => p[2 * node + (i & 1)]);
      return (a + b + c) / 3;
    });
    const { centroids } = this;
    let [best, least] = [-2, Infinity];
    for (let i = 0; i < centroids.length; i += 2) {
      const dx = centroids[i] - x;
      const dy = centroids[i + 1] - y;
      const square = dx * dx + dy * dy;
      if (square < least) {
        best = i;
        least = square;
      }
    }
    return best / 2;
  }

  /** As of Straight; `samples` are positions in the band. Keeps corners and weights of samples. */
  locate(samples, xs, ys, us, vs) {
    const p = this.present;
    const r = this.shown;
    this.weights = new Float64Array(3 * xs.length);
    this.corners = new Uint32Array(3 * xs.length);
    const lost = samples.reduce((sum, at) => sum + (this.faceOf[at] < 0), 0);
    this.budget.spend("beyond", lost * this.count);
    for (let i = 0; i < xs.length; i++) {
      const [x, y] = [xs[i], ys[i]];
      let index = this.faceOf[samples[i]];
      if (index < 0) index = this.#nearest(x, y);
      if (index < 0) {
        [us[i], vs[i]] = [x, y]; // all faces are without area: not specified
        continue;
      }
      const [a, b, c] = this.faces[index];
      const whole = this.#area(this.faces[index]);
      const at = (m, n) =>
        ((p[2 * m] - x) * (p[2 * n + 1] - y) - (p[2 * m + 1] - y) * (p[2 * n] - x)) / whole;
      const [wa, wb, wc] = [at(b, c), at(c, a), at(a, b)];
      us[i] = wa * r[2 * a] + wb * r[2 * b] + wc * r[2 * c];
      vs[i] = wa * r[2 * a + 1] + wb * r[2 * b + 1] + wc * r[2 * c + 1];
      this.weights.set([wa, wb, wc], 3 * i);
      this.corners.set([a, b, c], 3 * i);
    }
  }
}

/** The interval of x in which a row can meet a triangle. */
function crossing(y, ax, ay, bx, by, cx, cy) {
  let low = Infinity;
  let high = -Infinity;
  const edge = (x0, y0, x1, y1) => {
    if (Math.min(y0, y1) > y || Math.max(y0, y1) < y) return;
    const t = y0 === y1 ? 0 : (y - y0) / (y1 - y0);
    const x = x0 + t * (x1 - x0);
    low = Math.min(low, x, y0 === y1 ? x1 : x);
    high = Math.max(high, x, y0 === y1 ? x1 : x);
  };
  edge(ax, ay, bx, by);
  edge(bx, by, cx, cy);
  edge(cx, cy, ax, ay);
  return [low, high];
}

/** Chapter 10: how the nodes of layers move over time. */

import { decodeSigned } from "./entropy.js";
import { need } from "./errors.js";
import { clamp, sumDiv } from "./integers.js";
import { predict } from "./pose.js";
import { unzstd } from "./zstd.js";

const COEFFICIENT_MAX = 2 ** 15;
const SHAPE_MAX = 2 ** 20;
const POINT_MAX = 2 ** 30;

/** The baked trajectory of an mOTN chunk; `meshes` by the number of their layer. */
export class Motion {
  constructor(content, meshes, limits) {
    Object.assign(this, content);
    this.span = this.loop ? this.intervals : this.intervals + 3; // coefficients of a curve, K
    this.nodes = this.layers.map((layer) => meshes.get(layer).nodes.length / 2);
    const total = this.nodes.reduce((a, b) => a + b);
    const columns = this.layers.length * this.span;
    limits.spend("motion", this.modes * (columns + 2 * total));
    limits.spend("wavefronts", columns + 2 + total + 2 * this.modes);
    this.#decodeCurves(columns);
    this.#decodeShapes(total, meshes);
    if (this.size) checkScript(unzstd(this.script, this.size));
  }

  /** MOT-3: curves [modes][layer][coefficient]. */
  #decodeCurves(columns) {
    const { span } = this;
    this.curves = decodeSigned(this.curve_classes, this.curve_deltas, this.modes, 1, columns);
    this.curves.forEach((step, i, curves) => {
      if (i % span) curves[i] = curves[i - 1] + step;
      need(Math.abs(curves[i]) < COEFFICIENT_MAX, "a coefficient is out of range");
    });
  }

  /** MOT-4: shapes [x, y][mode][layer][node]. */
  #decodeShapes(total, meshes) {
    this.total = total;
    this.shapes = decodeSigned(this.shape_classes, this.shape_deltas, 2, this.modes, total);
    for (let row = 0, at = 0; row < 2 * this.modes; row++) {
      this.layers.forEach((layer, l) => {
        predict(this.shapes, meshes.get(layer).ends, at, this.nodes[l]);
        at += this.nodes[l];
      });
    }
    need(this.shapes.every((v) => Math.abs(v) < SHAPE_MAX), "a shape is out of range");
  }

  /** The interval and phase of a time in microseconds (MOT-6). */
  #place(microseconds) {
    const end = 1000 * this.duration;
    const t = this.loop
      ? ((microseconds % end) + end) % end
      : clamp(microseconds, 0, end);
    const p = Number((1024n * BigInt(t) * BigInt(this.intervals)) / BigInt(end));
    if (p === 1024 * this.intervals) return [this.intervals - 1, 1024];
    return [Math.floor(p / 1024), p % 1024];
  }

  /** Displacements of the nodes of each layer that moves, x, y, .. in 1/1024 pixel (MOT-7). */
  at(microseconds) {
    const [interval, f] = this.#place(microseconds);
    const g = 1024 - f;
    const weights = [
      g ** 3, 3 * f ** 3 - 6144 * f ** 2 + 2 ** 32, 3 * g ** 3 - 6144 * g ** 2 + 2 ** 32, f ** 3];
    const { layers, modes, span, total } = this;
    let first = 0;
    return new Map(layers.map((layer, l) => {
      const values = Array.from({ length: modes }, (_, m) => {
        const curve = (m * layers.length + l) * span;
        const c = [0, 1, 2, 3].map((k) => this.curves[curve + ((interval + k) % span)]);
        return sumDiv(weights, c, 3 * 2 ** 22, 6 * 2 ** 22);
      });
      // 2^(10 - unit) (sum) + 2^15 over 2^16, with what both sides have in common left out.
      const moves = new Float64Array(2 * this.nodes[l]).map((_, i) => {
        const at = (i & 1) * modes * total + first + (i >> 1);
        const shape = values.map((_v, m) => this.shapes[at + m * total]);
        const moved = sumDiv(values, shape, 2 ** (5 + this.unit), 2 ** (6 + this.unit));
        return clamp(moved, -POINT_MAX, POINT_MAX);
      });
      first += this.nodes[l];
      return [layer, moves];
    }));
  }
}

/** MOT-10. */
function checkScript(bytes) {
  try {
    new TextDecoder("utf-8", { fatal: true }).decode(bytes);
  } catch {
    need(false, "the script of a motion is not UTF-8");
  }
}

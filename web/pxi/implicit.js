/** Chapter 7: planes of codes, their diffusion, and the decoder network. */

import { networkSizes } from "./chunks.js";
import { decodeArray, decodeMask } from "./entropy.js";
import { need } from "./errors.js";
import { clamp } from "./integers.js";

const SWEEPS = 8;
const BATCH = 128; // points that a network takes at a time

/** float16 values, finite and perhaps positive (TEX-3, TEX-16). */
function halves(data, count, positive) {
  need(data.length === 2 * count, "the number of steps or biases is wrong");
  return Float64Array.from({ length: count }, (_, i) => {
    const bits = data[2 * i] | (data[2 * i + 1] << 8);
    const exponent = (bits >> 10) & 31;
    need(exponent !== 31, "a step or bias is not finite");
    const size = exponent
      ? (1 + (bits & 1023) / 1024) * 2 ** (exponent - 15)
      : ((bits & 1023) / 1024) * 2 ** -14;
    need(!positive || (size > 0 && bits < 0x8000), "a step is not positive");
    return bits & 0x8000 ? -size : size;
  });
}

/** Linear layers {inputs, outputs, weights, biases} of a NETW (TEX-14 to TEX-16). */
export function decodeNetwork(netw) {
  const sizes = networkSizes(netw);
  const rows = sizes.slice(1).reduce((a, b) => a + b);
  const steps = halves(netw.steps, rows, true);
  const biases = halves(netw.biases, rows, false);
  const zero = 1 << (netw.bits - 1);
  const layers = [];
  let at = 0;
  let row = 0;
  for (let k = 1; k < sizes.length; k++) {
    const [inputs, outputs] = [sizes[k - 1], sizes[k]];
    const data = takeArray(netw.weights, at);
    at += 4 + data.length;
    const values = decodeArray(data, 1, outputs, inputs, netw.bits);
    const first = row;
    const weights = Float64Array.from(
      values, (v, i) => steps[first + Math.floor(i / inputs)] * (v - zero));
    layers.push({ inputs, outputs, weights, biases: biases.subarray(row, row + outputs) });
    row += outputs;
  }
  need(at === netw.weights.length, "weights are left over");
  return { dim: netw.dim, octaves: netw.octaves, layers };
}

/** The bytes after a u32 length. */
export function takeArray(data, at) {
  need(at + 4 <= data.length, "a length is missing");
  const length = new DataView(data.buffer, data.byteOffset + at).getUint32(0, true);
  need(at + 4 + length <= data.length, "a coded array ends early");
  return data.subarray(at + 4, at + 4 + length);
}

/** Fills what is not known of planes that all know the same positions (TEX-5 to TEX-9). */
export class Diffusion {
  /** `known` has a number for each position, 0 if it is not known. */
  constructor(known, rows, columns) {
    Object.assign(this, { known, rows, columns });
    this.runs = []; // positions in a row that are not known: the row's first, their first, their end
    let count = 0;
    for (let row = 0; row < rows * columns; row += columns) {
      for (let i = row; i < row + columns; i++) {
        if (known[i]) continue;
        const first = i;
        while (i < row + columns && !known[i]) i++;
        this.runs.push([row, first, i]);
        count += i - first;
      }
    }
    if (!count) return;
    this.next = new Int32Array(count);
    [this.high, this.wide] = [(rows + 1) >> 1, (columns + 1) >> 1];
    this.counts = this.#sums(known.map((k) => (k ? 1 : 0)), Uint8Array);
    this.coarse = new Diffusion(this.counts, this.high, this.wide);
  }

  /** Sums of the known values of all children (TEX-6). */
  #sums(values, Type) {
    const { known, rows, columns, wide } = this;
    const sums = new Type(this.high * wide);
    for (let y = 0, i = 0; y < rows; y++) {
      const to = (y >> 1) * wide;
      for (let x = 0; x < columns; x++, i++) if (known[i]) sums[to + (x >> 1)] += values[i];
    }
    return sums;
  }

  /** Fills `value` in place. */
  fill(value) {
    const { runs, columns, wide, counts } = this;
    if (!runs.length) return;
    const coarse = this.#sums(value, Int32Array).map((sum, i) => {
      return counts[i] && Math.floor((2 * sum + counts[i]) / (2 * counts[i]));
    });
    this.coarse.fill(coarse);
    for (const [row, first, end] of runs) {
      const from = (row / columns >> 1) * wide;
      for (let i = first; i < end; i++) value[i] = coarse[from + ((i - row) >> 1)];
    }
    for (let sweep = 0; sweep < SWEEPS; sweep++) this.#sweep(value);
  }

  /** TEX-9. */
  #sweep(value) {
    const { runs, rows, columns, next } = this;
    let k = 0;
    for (const [row, first, end] of runs) {
      const up = row ? columns : 0;
      const down = row < (rows - 1) * columns ? columns : 0;
      const last = row + columns - 1;
      for (let i = first; i < end; i++) {
        const left = value[i > row ? i - 1 : i];
        const right = value[i < last ? i + 1 : i];
        next[k++] = (value[i - up] + value[i + down] + left + right + 2) >> 2;
      }
    }
    k = 0;
    for (const [, first, end] of runs) {
      value.set(next.subarray(k, k + end - first), first);
      k += end - first;
    }
  }
}

/** The features of a plane [rows, columns, dim] (TEX-1 to TEX-10). */
export function decodePlane(texr, dim) {
  const [columns, rows] = texr.grid;
  const size = rows * columns;
  const stored = texr.stored.length ? decodeMask(texr.stored, rows, columns) : null;
  const codes = decodeArray(texr.codes, dim, rows, columns, texr.bits, stored);
  const steps = halves(texr.steps, dim, true);
  const zero = 1 << (texr.bits - 1);
  const features = new Float64Array(size * dim);
  const value = new Int32Array(size);
  const diffusion = stored && new Diffusion(stored, rows, columns);
  for (let f = 0; f < dim; f++) {
    for (let i = 0; i < size; i++) value[i] = (codes[f * size + i] - zero) * 256;
    diffusion?.fill(value);
    for (let i = 0; i < size; i++) features[i * dim + f] = (value[i] * steps[f]) / 256;
  }
  return { columns, rows, dim, features };
}

/** Puts the features at a canvas point into out[at ..] (TEX-11, TEX-12). */
export function featuresAt({ columns, rows, dim, features }, box, x, y, out, at) {
  const gx = clamp(((x - box[0]) * (columns - 1)) / box[2], 0, columns - 1);
  const gy = clamp(((y - box[1]) * (rows - 1)) / box[3], 0, rows - 1);
  const ix = Math.min(Math.floor(gx), columns - 2);
  const iy = Math.min(Math.floor(gy), rows - 2);
  const [fx, fy] = [gx - ix, gy - iy];
  const a = (iy * columns + ix) * dim;
  const c = a + columns * dim;
  for (let f = 0; f < dim; f++) {
    const top = features[a + f] * (1 - fx) + features[a + dim + f] * fx;
    const bottom = features[c + f] * (1 - fx) + features[c + dim + f] * fx;
    out[at + f] = top + (bottom - top) * fy;
  }
}

/**
 * Premultiplied colour and alpha of points (TEX-13 to TEX-19).
 *
 * `features(i, out)` puts the `dim` features of point i into `out`; the colours go to
 * out[4 i .. 4 i + 3].
 */
export function runNetwork({ dim, octaves, layers }, count, features, out) {
  const widest = Math.max(...layers.map((l) => Math.max(l.inputs, l.outputs)));
  let values = new Float64Array(widest * BATCH);
  let next = new Float64Array(widest * BATCH);
  const point = new Float64Array(dim);
  for (let first = 0; first < count; first += BATCH) {
    const n = Math.min(BATCH, count - first);
    for (let i = 0; i < n; i++) {
      features(first + i, point);
      encode(point, octaves, values, i);
    }
    for (const layer of layers) {
      runLayer(layer, values, next, n, layer !== layers[layers.length - 1]);
      [values, next] = [next, values];
    }
    const { outputs } = layers[layers.length - 1];
    for (let i = 0; i < n; i++) {
      toColour(values, i, outputs === 4 ? values[3 * BATCH + i] : 1, out, 4 * (first + i));
    }
  }
}

/** The frequency encoding of one point (TEX-13), into column i of `values`. */
function encode(point, octaves, values, i) {
  const dim = point.length;
  for (let f = 0; f < dim; f++) {
    values[f * BATCH + i] = point[f];
    const n = Math.round(point[f]);
    const turn = n % 2 === 0 ? 1 : -1;
    let sine = turn * Math.sin(Math.PI * (point[f] - n));
    let cosine = turn * Math.cos(Math.PI * (point[f] - n));
    for (let k = 0; k < octaves; k++) {
      values[((2 * k + 1) * dim + f) * BATCH + i] = sine;
      values[((2 * k + 2) * dim + f) * BATCH + i] = cosine;
      [sine, cosine] = [2 * sine * cosine, 1 - 2 * sine * sine];
    }
  }
}

/** One linear layer over n points (TEX-17). */
function runLayer({ inputs, outputs, weights, biases }, values, next, n, active) {
  for (let o = 0; o < outputs; o++) {
    const sums = next.subarray(o * BATCH, o * BATCH + n).fill(biases[o]);
    const row = o * inputs;
    let i = 0;
    for (; i + 3 < inputs; i += 4) {
      const [w0, w1, w2, w3] = [
        weights[row + i], weights[row + i + 1], weights[row + i + 2], weights[row + i + 3]];
      const at = i * BATCH;
      for (let k = 0; k < n; k++) {
        sums[k] +=
          w0 * values[at + k] + w1 * values[at + BATCH + k] +
          w2 * values[at + 2 * BATCH + k] + w3 * values[at + 3 * BATCH + k];
      }
    }
    for (; i < inputs; i++) {
      const w = weights[row + i];
      for (let k = 0; k < n; k++) sums[k] += w * values[i * BATCH + k];
    }
    if (active) for (let k = 0; k < n; k++) if (sums[k] < 0) sums[k] = 0;
  }
}

/** TEX-18; what is not a number counts as 0 (TEX-19). */
function toColour(values, i, alpha, out, at) {
  const a = clamp(alpha || 0, 0, 1);
  for (let c = 0; c < 3; c++) out[at + c] = clamp(values[c * BATCH + i] || 0, 0, a);
  out[at + 3] = a;
}

/** Anchors x, y, x, y, .. of a layer in canvas pixels (TEX-22). */
export function anchors(paths, unit, [w, h]) {
  if (!paths) return [w / 2, 0, w, h / 2, w / 2, h, 0, h / 2];
  const found = [];
  for (const path of paths) {
    for (let k = 0; k < path.length; k += 6) {
      for (const axis of [0, 1]) {
        const [p, q, r, s] = [0, 2, 4, 6].map((i) => path[((k + i) % path.length) + axis]);
        found.push((p + 3 * q + 3 * r + s) / (8 * 2 ** unit));
      }
    }
  }
  return found;
}

/** Features at points x, y, x, y, .. of the canvas, one point after the other. */
export function featuresOf(plane, box, points) {
  const out = new Float64Array((points.length / 2) * plane.dim);
  for (let i = 0; i < points.length; i += 2) {
    featuresAt(plane, box, points[i], points[i + 1], out, (i / 2) * plane.dim);
  }
  return out;
}

/** Puts the global feature at a texture point into out[at ..] (TEX-23). */
export function globalFeature(points, features, dim, x, y, out, at) {
  out.fill(0, at, at + dim);
  let total = 0;
  for (let i = 0, k = 0; i < points.length; i += 2, k += dim) {
    const square = (x - points[i]) ** 2 + (y - points[i + 1]) ** 2;
    const share = 1 / Math.max(square, 1e-4);
    total += share;
    for (let f = 0; f < dim; f++) out[at + f] += share * features[k + f];
  }
  for (let f = 0; f < dim; f++) out[at + f] /= total;
}

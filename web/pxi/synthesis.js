/** Chapter 8, "Synthesis": from latents to a raster of samples. */

import { clamp } from "./integers.js";
import { Rows, conv3, mirrored, rough, shapeOf } from "./planes.js";

const SMOOTH = [0.788485616406, 0.418092273222, -0.040689417609, -0.064538882629];
const SHARP = [
  0.852698679009, -0.377402855613, -0.110624404418, 0.02384946502, 0.037828455507];
const WAYS = [[0, 0], [0, 1], [1, 0], [1, 1]]; // high-pass down, across: low, and the three bands

/** w(high, n) of PYR-32. */
function wavelet(high, n) {
  return (high ? SHARP[Math.abs(n - 1)] : SMOOTH[Math.abs(n)]) ?? 0;
}

/** Weights of the linear part [12 outputs][12 planes][5][5] of networks (PYR-32), by what these add. */
const linear = new WeakMap();

function linearWeights(delta) {
  if (!linear.has(delta)) linear.set(delta, withWavelet(delta));
  return linear.get(delta);
}

function withWavelet(delta) {
  return delta.map((d, i) => {
    const [output, plane] = [Math.floor(i / 300), Math.floor(i / 25) % 12];
    const [q, p] = [(Math.floor(i / 5) % 5) - 2, (i % 5) - 2];
    if (plane % 3 !== output >> 2) return d;
    const [v, h] = WAYS[Math.floor(plane / 3)];
    return d + wavelet(v, ((output >> 1) & 1) - 2 * q) * wavelet(h, (output & 1) - 2 * p);
  });
}

/** A plane with two mirrored columns on both sides; `finer` columns are made of it. */
function padded(plane, rows, columns, finer, high) {
  const wide = columns + 4;
  const out = new Float64Array(rows * wide);
  const from = Int32Array.from({ length: wide }, (_, i) => mirrored(i - 2, finer, high));
  for (let y = 0, at = 0; y < rows; y++) {
    for (let i = 0; i < wide; i++, at++) out[at] = plane[y * columns + from[i]];
  }
  return out;
}

/** The finer planes, of rows and columns `to` (PYR-30 to PYR-33). */
function finer(net, low, { rows, columns, latents }, step, [toRows, toColumns]) {
  const t = (step - 293) / 128;
  const gains = net.gain.map((g, k) => Math.exp(g + net.gain_by_step[k] * t));
  const high = latents.map((plane, k) => Float32Array.from(plane, (v) => v * gains[k]));
  const planes = [...low, ...[0, 1, 2].flatMap((band) => [0, 3, 6].map((c) => high[c + band]))];
  const linear = {
    weights: linearWeights(net.delta),
    planes: planes.map((p, i) => padded(p, rows, columns, toColumns, WAYS[Math.floor(i / 3)][1])),
    rows: toRows,
  };
  const network = networkRows(net, low, high, rows, columns, t);
  const out = [0, 1, 2].map(() => new Float32Array(toRows * toColumns));
  const sums = new Float64Array(12 * columns);
  for (let y = 0; y < rows; y++) {
    conv3(network.around(y), net.width, columns, net.third, net.third_bias, 12, sums, 0, columns);
    addLinear(linear, y, columns, sums);
    for (let k = 0; k < 12; k++) {
      const row = 2 * y + ((k >> 1) & 1);
      if (row >= toRows) continue;
      for (let x = k & 1, at = k * columns; x < toColumns; x += 2, at++) {
        out[k >> 2][row * toColumns + x] = sums[at];
      }
    }
  }
  return out;
}

/** Rows of the results of `second` (PYR-33). */
function networkRows(net, low, high, rows, columns, t) {
  const wide = columns + 2;
  const size = net.width;
  const bias = net.first_bias.map((b, i) => b + net.first_by_step[i] * t);
  const soft = (x) => x / (1 + Math.abs(x) / 8);
  const inputs = new Rows(rows, 12 * wide, (y, row) => {
    for (let c = 0; c < 3; c++) {
      rough(low[c], rows, columns, y, (x, v) => (row[c * wide + x + 1] = soft(v / 9)));
    }
    for (let c = 0; c < 9; c++) {
      const to = (3 + c) * wide + 1;
      for (let x = 0; x < columns; x++) row[to + x] = soft(high[c][y * columns + x]);
    }
  });
  const first = new Float64Array(size * columns);
  return new Rows(rows, size * wide, (y, row) => {
    conv3(inputs.around(y), 12, columns, net.first, bias, size, first, 0, columns);
    for (let i = 0; i < first.length; i++) if (first[i] < 0) first[i] = 0;
    for (let o = 0; o < size; o++) mix(first, net.second, net.second_bias, size, o, columns, row);
  });
}

/** Output o of `second`, replaced by 0 where negative, over one row. */
function mix(inputs, weights, biases, size, o, columns, row) {
  const to = o * (columns + 2) + 1;
  row.fill(biases[o], to, to + columns);
  for (let i = 0; i < size; i += 4) {
    const w = o * size + i;
    const w0 = weights[w], w1 = weights[w + 1], w2 = weights[w + 2], w3 = weights[w + 3];
    const at = i * columns;
    for (let x = 0; x < columns; x++) {
      row[to + x] +=
        w0 * inputs[at + x] + w1 * inputs[at + columns + x] +
        w2 * inputs[at + 2 * columns + x] + w3 * inputs[at + 3 * columns + x];
    }
  }
  for (let x = to; x < to + columns; x++) if (row[x] < 0) row[x] = 0;
}

/** Adds the linear part of row y to the sums [12, columns] (PYR-32). */
function addLinear({ weights, planes, rows }, y, columns, sums) {
  const wide = columns + 4;
  for (let p = 0; p < 12; p++) {
    const plane = planes[p];
    const high = WAYS[Math.floor(p / 3)][0];
    for (let j = 0; j < 5; j++) {
      const from = mirrored(y + j - 2, rows, high) * wide;
      for (let k = 0; k < 12; k++) {
        const w = (k * 12 + p) * 25 + j * 5;
        const w0 = weights[w], w1 = weights[w + 1], w2 = weights[w + 2];
        const w3 = weights[w + 3], w4 = weights[w + 4];
        if (!w0 && !w1 && !w2 && !w3 && !w4) continue;
        const to = k * columns;
        let a = plane[from], b = plane[from + 1], c = plane[from + 2], d = plane[from + 3];
        for (let x = 0; x < columns; x++) {
          const e = plane[from + x + 4];
          sums[to + x] += w0 * a + w1 * b + w2 * c + w3 * d + w4 * e;
          a = b, b = c, c = d, d = e;
        }
      }
    }
  }
}

/** The samples of a PLAN: {columns, rows, components}, planes of 0..1 (PYR-34). */
export function synthesize(plan, { lowest, levels }, model) {
  const { size, components, step } = plan;
  let planes = lowest.map((plane) => Float32Array.from(plane));
  for (let l = levels.length; l >= 1; l--) {
    planes = finer(model.of(l).synthesis, planes, levels[l - 1], step, shapeOf(plan, l - 1));
  }
  const [columns, rows] = size;
  const unit = 2 ** (step / 64);
  const wide = shapeOf(plan, 0)[1];
  const out = Array.from({ length: components }, () => new Float32Array(rows * columns));
  const m = model.to_colour;
  const [a, b, c] = planes;
  for (let y = 0, to = 0; y < rows; y++) {
    for (let x = 0, at = y * wide; x < columns; x++, at++, to++) {
      let mean = 0;
      for (let k = 0; k < 3; k++) {
        const value = (m[3 * k] * a[at] + m[3 * k + 1] * b[at] + m[3 * k + 2] * c[at]) * unit + 128;
        if (components === 3) out[k][to] = clamp(value / 255, 0, 1);
        else mean += value / 3;
      }
      if (components === 1) out[0][to] = clamp(mean / 255, 0, 1);
    }
  }
  return { columns, rows, planes: out };
}

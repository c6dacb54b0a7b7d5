/** Chapter 8, "What lies behind": samples that copy others of their part (PYR-48 to PYR-51). */

import { decodeArray } from "./entropy.js";
import { need } from "./errors.js";
import { Diffusion } from "./implicit.js";
import { clamp } from "./integers.js";

export const FILL_ONE = 65280;

/** The largest correction of a copy. */
const DRIFT = 3072;

/** The largest difference of copies that counts, the largest lift, and the rounds of balancing. */
const [LIFT, APART, LIFT_MOST, TURNS] = [6144, 12288, 32640, 64];

/** The array of sources: channels, rows, columns and bits (PYR-48). */
export function sourcesShape({ part, grain, offsets }) {
  const [columns, rows] = [part[2], part[3]].map((n) => Math.ceil(n / 2 ** grain));
  const bits = 32 - Math.clz32(offsets.length / 2);
  return bits <= 4 ? [1, rows, columns, bits] : [2, rows, columns, 4];
}

/** The source of each cell [rows, columns]; null if there is none at all. */
export function decodeSources(texr) {
  if (!texr.sources.length) return null;
  const [channels, rows, columns, bits] = sourcesShape(texr);
  const found = decodeArray(texr.sources, channels, rows, columns, bits);
  const sources = found.slice(0, rows * columns);
  if (channels === 2) sources.forEach((low, i) => (sources[i] = low + 16 * found[sources.length + i]));
  need(sources.some((source) => source), "all sources are 0");
  need(sources.every((source) => 2 * source <= texr.offsets.length), "a source has no offset");
  return sources;
}

/** For each row or column: the number of the later of the two cells beside it, and its weight. */
function beside(count, side) {
  return Array.from({ length: count }, (_, i) => {
    const a = 2 * i + 1 + side;
    return [Math.floor(a / (2 * side)), a % (2 * side)];
  });
}

/** a / n, rounded to the nearest integer, for n > 0. */
const quotient = (a, n) => Math.floor((2 * a + n) / (2 * n));

/** Where a cell copies the sample (y, x) of the part from, or -1 (PYR-49). */
function placeOf({ part, offsets }, source, known, y, x) {
  const [, , w, h] = part;
  if (!source || x < 0 || x >= w || y < 0 || y >= h) return -1;
  const [u, v] = [x + offsets[2 * source - 2], y + offsets[2 * source - 1]];
  return u >= 0 && u < w && v >= 0 && v < h && known[v * w + u] ? v * w + u : -1;
}

/** The lifts of all cells, one array a component (PYR-51). */
function liftsOf(texr, sources, values, known) {
  const [, , w, h] = texr.part;
  const side = 2 ** texr.grain;
  const [rows, columns] = [h, w].map((n) => Math.ceil(n / side));
  const half = Math.floor(side / 2);
  /** Means of the differences of two values at the samples of a square, and their number. */
  const compare = (top, left, size, pair) => {
    const sums = values.map(() => 0);
    let count = 0;
    for (let y = top; y < top + size; y++) {
      for (let x = left; x < left + size; x++) {
        const [one, other] = pair(y, x);
        if (one < 0 || other < 0) continue;
        count++;
        values.forEach((value, c) => (sums[c] += value[one] - value[other]));
      }
    }
    const means = sums.map((sum) => (count ? quotient(sum, count) : 0));
    const bounded = means.map((mean) => clamp(mean, -LIFT, LIFT));
    return [bounded, means.some((mean) => Math.abs(mean) > APART) ? 0 : count];
  };
  const cells = [...sources.keys()].filter((k) => sources[k]);
  const links = new Map(cells.map((k) => [k, []]));
  const aims = new Map();
  for (const k of cells) {
    const [row, column] = [Math.floor(k / columns), k % columns];
    const copy = (cell, y, x) => placeOf(texr, sources[cell], known, y, x);
    for (const [j, i] of [[0, 1], [1, 0]]) {
      const other = k + j * columns + i;
      if (row + j >= rows || column + i >= columns || !sources[other]) continue;
      const [found, count] = compare(row * side + j * half, column * side + i * half, side,
        (y, x) => [copy(k, y, x), copy(other, y, x)]);
      if (!count) continue;
      links.get(k).push([other, found]);
      links.get(other).push([k, found.map((m) => -m)]);
    }
    const [aim, count] = compare(row * side - half, column * side - half, 2 * side - (side % 2),
      (y, x) => [y >= 0 && y < h && x >= 0 && x < w && known[y * w + x] ? y * w + x : -1, copy(k, y, x)]);
    aims.set(k, [aim, Math.ceil((4 * Math.min(count, side * side)) / (side * side))]);
  }
  const lifts = values.map(() => new Int32Array(sources.length));
  for (let turn = 0; turn < 2 * TURNS; turn++) {
    for (const k of cells) {
      if ((Math.floor(k / columns) + (k % columns)) % 2 !== turn % 2) continue;
      const [aim, weight] = aims.get(k);
      const n = weight + links.get(k).length;
      if (!n) continue;
      lifts.forEach((lift, c) => {
        const wanted = links.get(k).reduce((sum, [b, m]) => sum + lift[b] - m[c], weight * aim[c]);
        const more = Math.floor((7 * (wanted - n * lift[k]) + 2 * n) / (4 * n));
        lift[k] = clamp(lift[k] + more, -LIFT_MOST, LIFT_MOST);
      });
    }
  }
  return lifts;
}

/**
 * The samples that have a base, and their bases with what lifts them (PYR-49, PYR-51).
 *
 * `values` are components [h, w] in 1/65280, `known` marks their samples.
 */
function basesOf(texr, sources, values, known) {
  const [, , w, h] = texr.part;
  const side = 2 ** texr.grain;
  const lifts = liftsOf(texr, sources, values, known);
  const [rows, columns] = [h, w].map((n) => Math.ceil(n / side));
  const [down, across] = [beside(h, side), beside(w, side)];
  const there = new Uint8Array(w * h);
  const bases = values.map(() => new Int32Array(w * h));
  const [sums, lifted] = [0, 1].map(() => new Float64Array(values.length));
  for (let y = 0, i = 0; y < h; y++) {
    for (let x = 0; x < w; x++, i++) {
      sums.fill(0);
      lifted.fill(0);
      let total = 0;
      for (let corner = 0; corner < 4; corner++) {
        const [j, g] = down[y];
        const [k, f] = across[x];
        const [row, column] = [j - 1 + (corner >> 1), k - 1 + (corner & 1)];
        if (row < 0 || row >= rows || column < 0 || column >= columns) continue;
        const weight = (corner >> 1 ? g : 2 * side - g) * (corner & 1 ? f : 2 * side - f);
        const cell = row * columns + column;
        const place = placeOf(texr, sources[cell], known, y, x);
        if (!weight || place < 0) continue;
        total += weight;
        for (let c = 0; c < sums.length; c++) {
          sums[c] += weight * values[c][place];
          lifted[c] += weight * lifts[c][cell];
        }
      }
      if (!total) continue;
      there[i] = 1;
      bases.forEach((base, c) => (base[i] = quotient(sums[c], total) + quotient(lifted[c], total)));
    }
  }
  return { there, bases };
}

/** Makes all copies (PYR-50): changes `values` and `known`, which are as those of `basesOf`. */
export function copy(texr, sources, values, known) {
  const [, , w, h] = texr.part;
  const { there, bases } = basesOf(texr, sources, values, known);
  const copied = there.map((some, i) => some && !known[i]);
  const rim = there.map((some, i) => some && known[i]);
  const diffusion = rim.includes(1) ? new Diffusion(rim, h, w) : null;
  values.forEach((value, c) => {
    const drift = value.map((v, i) => (rim[i] ? clamp(v - bases[c][i], -DRIFT, DRIFT) : 0));
    diffusion?.fill(drift);
    copied.forEach((some, i) => {
      if (some) value[i] = clamp(bases[c][i] + drift[i], 0, FILL_ONE);
    });
  });
  copied.forEach((some, i) => {
    if (some) known[i] = 1;
  });
}

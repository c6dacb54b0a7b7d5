/** Chapter 8, "What lies behind": samples that copy others of their part (PYR-48 to PYR-50). */

import { decodeArray } from "./entropy.js";
import { need } from "./errors.js";
import { Diffusion } from "./implicit.js";
import { clamp } from "./integers.js";

export const FILL_ONE = 65280;

/** The largest correction of a copy. */
const DRIFT = 3072;

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

/**
 * The samples that have a base, and their bases (PYR-49).
 *
 * `values` are components [h, w] in 1/65280, `known` marks their samples.
 */
function basesOf({ part, grain, offsets }, sources, values, known) {
  const [, , w, h] = part;
  const side = 2 ** grain;
  const [rows, columns] = [h, w].map((n) => Math.ceil(n / side));
  const [down, across] = [beside(h, side), beside(w, side)];
  const there = new Uint8Array(w * h);
  const bases = values.map(() => new Int32Array(w * h));
  const sums = new Float64Array(values.length);
  for (let y = 0, i = 0; y < h; y++) {
    for (let x = 0; x < w; x++, i++) {
      sums.fill(0);
      let total = 0;
      for (let corner = 0; corner < 4; corner++) {
        const [j, g] = down[y];
        const [k, f] = across[x];
        const [row, column] = [j - 1 + (corner >> 1), k - 1 + (corner & 1)];
        if (row < 0 || row >= rows || column < 0 || column >= columns) continue;
        const weight = (corner >> 1 ? g : 2 * side - g) * (corner & 1 ? f : 2 * side - f);
        const source = sources[row * columns + column];
        if (!weight || !source) continue;
        const [u, v] = [x + offsets[2 * source - 2], y + offsets[2 * source - 1]];
        if (u < 0 || u >= w || v < 0 || v >= h || !known[v * w + u]) continue;
        total += weight;
        for (let c = 0; c < sums.length; c++) sums[c] += weight * values[c][v * w + u];
      }
      if (!total) continue;
      there[i] = 1;
      bases.forEach((base, c) => (base[i] = Math.floor((2 * sums[c] + total) / (2 * total))));
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

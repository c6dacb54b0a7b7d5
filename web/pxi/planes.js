/** What the networks of chapter 8 share: convolutions over rows of several planes. */

/**
 * A 3 by 3 convolution of one row.
 *
 * `rows` are three arrays [inputs, width + 2], those above, at and below the row, each with a zero
 * at both ends; `out` is [outputs, stride] from `at` on.
 */
export function conv3(rows, inputs, width, weights, biases, outputs, out, at, stride) {
  const wide = width + 2;
  const used = []; // many planes are 0 in most rows
  for (let i = 0; i < inputs; i++) if (rows.some((row) => some(row, i * wide, wide))) used.push(i);
  for (let o = 0; o < outputs; o++) {
    const first = at + o * stride;
    out.fill(biases[o], first, first + width);
    for (const i of used) addConv3(rows, i * wide, width, weights, (o * inputs + i) * 9, out, first);
  }
}

function some(row, at, count) {
  for (let i = at; i < at + count; i++) if (row[i]) return true;
  return false;
}

/** Adds what one input gives to one output. */
function addConv3([up, mid, down], b, width, weights, w, out, at) {
  const w0 = weights[w], w1 = weights[w + 1], w2 = weights[w + 2];
  const w3 = weights[w + 3], w4 = weights[w + 4], w5 = weights[w + 5];
  const w6 = weights[w + 6], w7 = weights[w + 7], w8 = weights[w + 8];
  let a0 = up[b], a1 = up[b + 1], b0 = mid[b], b1 = mid[b + 1], c0 = down[b], c1 = down[b + 1];
  for (let x = 0; x < width; x++) {
    const a2 = up[b + x + 2], b2 = mid[b + x + 2], c2 = down[b + x + 2];
    out[at + x] +=
      a0 * w0 + a1 * w1 + a2 * w2 + b0 * w3 + b1 * w4 + b2 * w5 + c0 * w6 + c1 * w7 + c2 * w8;
    a0 = a1, a1 = a2, b0 = b1, b1 = b2, c0 = c1, c1 = c2;
  }
}

/** A stream of rows: makes each when it is first asked for, and keeps the last few. */
export class Rows {
  /** `make(y, row)` fills a row of `size` numbers, which is 0 before. Rows outside are 0. */
  constructor(count, size, make) {
    this.count = count;
    this.make = make;
    this.zero = new Float64Array(size);
    this.kept = [0, 1, 2, 3].map(() => ({ y: -1, row: new Float64Array(size) }));
  }

  at(y) {
    if (y < 0 || y >= this.count) return this.zero;
    const slot = this.kept[y & 3];
    if (slot.y !== y) {
      slot.row.fill(0);
      this.make(y, slot.row);
      slot.y = y;
    }
    return slot.row;
  }

  around(y) {
    return [this.at(y - 1), this.at(y), this.at(y + 1)];
  }
}

/** Values of a plane less those of their 3 by 3 neighbours in the mean, times 9 (PYR-20, PYR-33). */
export function rough(plane, rows, columns, y, each) {
  const up = Math.max(y - 1, 0) * columns;
  const mid = y * columns;
  const down = Math.min(y + 1, rows - 1) * columns;
  for (let x = 0; x < columns; x++) {
    const left = Math.max(x - 1, 0);
    const right = Math.min(x + 1, columns - 1);
    const sum =
      plane[up + left] + plane[up + x] + plane[up + right] +
      plane[mid + left] + plane[mid + x] + plane[mid + right] +
      plane[down + left] + plane[down + x] + plane[down + right];
    each(x, 9 * plane[mid + x] - sum);
  }
}

/** PYR-17: where an index outside of the low or high half of a line of `size` values points to. */
export function mirrored(i, size, high) {
  const count = (size + 1 - high) >> 1;
  if (i < 0) i = -i - high;
  if (i >= count) i = size - 1 - high - i;
  return Math.max(Math.min(i, count - 1), 0);
}

/** Rows and columns of the positions of a level of a PLAN; at level 0 of its samples (PYR-4). */
export function shapeOf({ model, size: [w, h], levels }, level) {
  if (model === 1) return [h, w].map((n) => Math.ceil(n / 2 ** levels) * 2 ** (levels - level));
  return [h, w].map((n) => Math.ceil(n / 2 ** level));
}

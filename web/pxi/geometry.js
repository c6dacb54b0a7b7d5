/**
 * Chapter 5: boundaries and their coverage.
 *
 * A path is a flat array x0, y0, x1, y1, .. of control points.
 */

import { decodeSigned } from "./entropy.js";
import { need } from "./errors.js";
import { clamp, dotDiv, sumDiv } from "./integers.js";

export const FULL = 131072;
const COORDINATE_MAX = 2 ** 26;
const SCALED_MAX = 2 ** 30;

/** The paths of a LAYR, or null if it covers the canvas. */
export function decodeBoundary({ segments, classes, deltas }) {
  if (!segments.length) return null;
  const total = segments.reduce((a, b) => a + b, 0);
  const rows = decodeSigned(classes, deltas, 6, 1, total);
  const paths = [];
  let origin = [0, 0];
  let s = 0;
  for (const count of segments) {
    const path = new Float64Array(6 * count);
    let [x, y] = origin;
    for (let k = 0; k < 6 * count; k += 6, s++) {
      for (let row = 0; row < 6; row += 2) {
        x += rows[row * total + s];
        y += rows[(row + 1) * total + s];
        need(Math.abs(x) < COORDINATE_MAX && Math.abs(y) < COORDINATE_MAX, "a point is too far out");
        path[k + row] = x;
        path[k + row + 1] = y;
      }
    }
    origin = [path[0], path[1]];
    paths.push(path);
  }
  return paths;
}

/** Paths in 1/256 sample (GEO-7); the view has `region` of the canvas on columns by rows. */
export function scalePaths(paths, unit, [x0, y0, w, h], columns, rows) {
  const axis = (origin, size, samples) => (p) => {
    const e = size * 2 ** unit;
    const scaled = dotDiv(p - origin * 2 ** unit, 512 * samples, 0, 0, e, 2 * e);
    return clamp(scaled, -SCALED_MAX, SCALED_MAX);
  };
  const [across, down] = [axis(x0, w, columns), axis(y0, h, rows)];
  return paths.map((path) => path.map((p, i) => (i & 1 ? down(p) : across(p))));
}

/** Calls `each(xa, ya, xb, yb)` for the chords of segment k of a path (GEO-8, GEO-9). */
function flatten(path, k, budget, each) {
  const p = [0, 1, 2, 3].map((i) => (k + 2 * i) % path.length);
  const bend = (axis) => {
    const [a, b, c, d] = p.map((i) => path[i + axis]);
    return Math.max(Math.abs(a - 2 * b + c), Math.abs(b - 2 * c + d));
  };
  const d = Math.max(bend(0), bend(1));
  let log2 = 0;
  while (log2 < 8 && 3 * d > 64 * 4 ** log2) log2++;
  const n = 1 << log2;
  const weights = [0, 0, 0, 0];
  const xs = p.map((i) => path[i]);
  const ys = p.map((i) => path[i + 1]);
  let [x, y] = [xs[0], ys[0]];
  budget.spend("work", n);
  for (let i = 1; i <= n; i++) {
    const j = n - i;
    weights[0] = j * j * j;
    weights[1] = 3 * j * j * i;
    weights[2] = 3 * j * i * i;
    weights[3] = i * i * i;
    const nextX = sumDiv(weights, xs, 0, n * n * n);
    const nextY = sumDiv(weights, ys, 0, n * n * n);
    each(x, y, nextX, nextY);
    [x, y] = [nextX, nextY];
  }
}

/**
 * Coverage 0..FULL of the samples in rows top..bottom - 1 and columns 0..columns - 1.
 *
 * `paths` are in 1/256 sample; what it takes is taken from `budget` (SEC-11).
 */
export function coverage(paths, columns, top, bottom, budget) {
  const area = new Float64Array(columns * (bottom - top));
  const carry = new Float64Array(area.length); // what goes to all columns from here on
  const canvas = { area, carry, columns, top, bottom, budget };
  for (const path of paths) {
    for (let k = 0; k < path.length; k += 6) {
      let [low, high, left] = [Infinity, -Infinity, Infinity];
      for (let i = 0; i < 4; i++) {
        const at = (k + 2 * i) % path.length;
        low = Math.min(low, path[at + 1]);
        high = Math.max(high, path[at + 1]);
        left = Math.min(left, path[at]);
      }
      // Chords stay between their control points; what is right of the samples adds nothing.
      if (low >= 256 * bottom || high <= 256 * top || left >= 256 * columns) continue;
      flatten(path, k, budget, (xa, ya, xb, yb) => addChord(canvas, xa, ya, xb, yb));
    }
  }
  for (let at = 0; at < area.length; at += columns) {
    let sum = 0;
    for (let c = at; c < at + columns; c++) {
      sum += carry[c];
      area[c] = Math.min(Math.abs(area[c] + sum), FULL);
    }
  }
  return area;
}

/** GEO-11 and GEO-12. */
function addChord(canvas, xa, ya, xb, yb) {
  if (ya === yb) return;
  const sign = ya < yb ? 1 : -1;
  if (sign < 0) [xa, ya, xb, yb] = [xb, yb, xa, ya];
  const first = Math.max(Math.floor(ya / 256), canvas.top);
  const last = Math.min(Math.floor((yb - 1) / 256), canvas.bottom - 1);
  const at = (y) => xa + dotDiv(y - ya, xb - xa, 0, 0, 0, yb - ya);
  let pieces = 0;
  for (let row = first; row <= last; row++) {
    const yIn = Math.max(ya, 256 * row);
    const yOut = Math.min(yb, 256 * row + 256);
    const [xIn, xOut] = [at(yIn), at(yOut)];
    pieces += addPiece(canvas, row, Math.min(xIn, xOut), Math.max(xIn, xOut), yOut - yIn, sign);
  }
  if (pieces) canvas.budget.spend("work", pieces);
}

/** GEO-13; what the piece counts as: itself, and its samples but one. */
function addPiece({ area, carry, columns, top }, row, left, right, rise, sign) {
  const at = (row - top) * columns;
  const first = Math.max(Math.floor(left / 256), 0);
  const last = Math.min(Math.floor(right / 256), columns - 1);
  const climbed = (x) =>
    x <= left ? 0 : x >= right ? rise : Math.floor(((x - left) * rise) / (right - left));
  let before = climbed(256 * first);
  for (let c = first; c <= last; c++) {
    const low = 256 * c;
    const after = climbed(low + 256);
    const mean2 = Math.max(left, low) + Math.min(right, low + 256) - 2 * low;
    area[at + c] += sign * (512 * before + (after - before) * (512 - mean2));
    before = after;
  }
  const next = Math.max(last + 1, first);
  if (next < columns) carry[at + next] += 512 * sign * rise;
  return 1 + Math.max(last - first, 0);
}

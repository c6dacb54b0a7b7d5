/** Closed paths of cubic Bézier curves: 3 n control points, of which each third lies on the curve. */

/** Points that a segment is taken apart into. */
const PIECES = 16;

/** Path data of control points. @param {number[][][]} paths @param {(x: number, y: number) => number[]} [place] */
export function pathData(paths, place = (x, y) => [x, y]) {
  return paths.map((p) => {
    const q = p.map(([x, y]) => place(x, y).map((v) => v.toFixed(2)).join(" "));
    let d = `M${q[0]}`;
    for (let k = 0; k < q.length; k += 3) d += `C${q[k + 1]} ${q[k + 2]} ${q[(k + 3) % q.length]}`;
    return `${d}Z`;
  }).join("");
}

/** Weights of the four control points of a segment at PIECES moments of it. */
const WEIGHTS = Array.from({ length: PIECES }, (_, i) => {
  const t = i / PIECES;
  return [(1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t * t * (1 - t), t ** 3];
});

/** Points along a path, flat. @param {number[][]} path */
export function sampled(path) {
  const out = [];
  for (let k = 0; k < path.length; k += 3) {
    const c = [0, 1, 2, 3].map((i) => path[(k + i) % path.length]);
    for (const w of WEIGHTS) for (const axis of [0, 1]) out.push(w[0] * c[0][axis] + w[1] * c[1][axis] + w[2] * c[2][axis] + w[3] * c[3][axis]);
  }
  return out;
}

/** How far each of these points goes along with a control point, 0..1. @param {number[][]} path @param {number} point */
export function shares(path, point) {
  const out = [];
  for (let k = 0; k < path.length; k += 3) {
    const mine = [0, 1, 2, 3].filter((i) => (k + i) % path.length === point);
    for (const w of WEIGHTS) out.push(mine.reduce((t, i) => t + w[i], 0));
  }
  return out;
}

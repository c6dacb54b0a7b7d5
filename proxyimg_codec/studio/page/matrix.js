/** Affine maps [a, b, c, d, e, f]: x' = a x + c y + e, y' = b x + d y + f. */

/** @typedef {number[]} Matrix */

/** @returns {Matrix} */
export const identity = () => [1, 0, 0, 1, 0, 0];

/** The map that does `n`, then `m`. @param {Matrix} m @param {Matrix} n @returns {Matrix} */
export const product = (m, n) => [
  m[0] * n[0] + m[2] * n[1], m[1] * n[0] + m[3] * n[1],
  m[0] * n[2] + m[2] * n[3], m[1] * n[2] + m[3] * n[3],
  m[0] * n[4] + m[2] * n[5] + m[4], m[1] * n[4] + m[3] * n[5] + m[5],
];

/** @param {Matrix} m @returns {Matrix} */
export function inverse(m) {
  const [a, b, c, d, e, f] = m, det = a * d - b * c || 1e-12;
  return [d / det, -b / det, -c / det, a / det, (c * f - d * e) / det, (b * e - a * f) / det];
}

/** @param {Matrix} m @param {number} x @param {number} y @returns {[number, number]} */
export const apply = (m, x, y) => [m[0] * x + m[2] * y + m[4], m[1] * x + m[3] * y + m[5]];

/** @param {Matrix} m @param {number} x @param {number} y @returns {Matrix} */
export const about = (m, x, y) => product([1, 0, 0, 1, x, y], product(m, [1, 0, 0, 1, -x, -y]));

/** @param {number} degrees clockwise, as y points down @returns {Matrix} */
export function rotation(degrees) {
  const c = Math.cos((degrees * Math.PI) / 180), s = Math.sin((degrees * Math.PI) / 180);
  return [c, s, -s, c, 0, 0];
}

/** Colour matrix [12] of the operation `recolour`, on top of another. As `edit/appearance.py`. */
const LUMA = [0.2126, 0.7152, 0.0722];

/** @param {{hue: number, saturation: number, brightness: number, tint: string|null}} change @param {number[]|null} before */
export function recoloured({ hue, saturation, brightness, tint }, before) {
  const [r, g, b] = LUMA, c = Math.cos((hue * Math.PI) / 180), s = Math.sin((hue * Math.PI) / 180);
  const skew = [[-r, -g, 1 - b], [0.143, 0.14, -0.283], [-(1 - r), g, b]];
  const one = [0, 1, 2].map((i) => [0, 1, 2].map((j) => Number(i === j)));
  const steps = [
    one.map((row, i) => row.map((v, j) => LUMA[j] + c * (v - LUMA[j]) + s * skew[i][j])),
    one.map((row) => row.map((v, j) => saturation * v + (1 - saturation) * LUMA[j])),
    one.map((row) => row.map((v) => v * brightness)),
  ];
  if (tint) {
    const t = [1, 3, 5].map((i) => parseInt(tint.slice(i, i + 2), 16) / 255);
    const level = Math.max(t[0] * r + t[1] * g + t[2] * b, 0.25);
    steps.push(t.map((v) => LUMA.map((l) => (v / level) * l)));
  }
  let m = [0, 1, 2].map((i) => [0, 1, 2, 3].map((j) => (before ? before[4 * i + j] : Number(i === j))));
  for (const step of steps) m = m.map((_, i) => [0, 1, 2, 3].map((j) => step[i][0] * m[0][j] + step[i][1] * m[1][j] + step[i][2] * m[2][j]));
  return m.flat();
}

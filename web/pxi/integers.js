/** Exact integer arithmetic: numbers where 53 bits are enough, BigInt where they are not. */

const SAFE = Number.MAX_SAFE_INTEGER;

export const clamp = (x, low, high) => (x < low ? low : x > high ? high : x);

/** Quotient of BigInts, rounded down. */
function floorDiv(a, b) {
  const quotient = a / b;
  return (a % b < 0n) !== (b < 0n) && a % b !== 0n ? quotient - 1n : quotient;
}

/** (a b + c d + e) // f for integers, f > 0. */
export function dotDiv(a, b, c, d, e, f) {
  const p = a * b;
  const q = c * d;
  if (Math.abs(p) + Math.abs(q) + Math.abs(e) < SAFE) return Math.floor((p + q + e) / f);
  const [A, B, C, D, E, F] = [a, b, c, d, e, f].map(BigInt);
  return Number(floorDiv(A * B + C * D + E, F));
}

/** sum(weights[i] values[i]) + e, over f and rounded down. */
export function sumDiv(weights, values, e, f) {
  let sum = e;
  let size = Math.abs(e);
  for (let i = 0; i < weights.length; i++) {
    sum += weights[i] * values[i];
    size += Math.abs(weights[i] * values[i]);
  }
  if (size < SAFE) return Math.floor(sum / f);
  let exact = BigInt(e);
  for (let i = 0; i < weights.length; i++) exact += BigInt(weights[i]) * BigInt(values[i]);
  return Number(floorDiv(exact, BigInt(f)));
}

/** Chapter 8, "Model": the registered networks. */

import { need, supported } from "./errors.js";

const LEVEL_SETS = 4;

/** Arrays of a set of networks in their order (PYR-36): name, type, shape; H and C are widths. */
const CONTEXT = [
  ["first", "int8", "C", 12, 3, 3], ["first_bias", "int32", "C"], ["first_by_step", "int32", "C"],
  ["second", "int8", "C", "C", 3, 3], ["second_bias", "int32", "C"],
  ["causal", "int8", "C", 18, 12],
  ["mix", "int8", "C", "C"], ["mix_bias", "int32", "C"],
  ["luma", "int8", 6, "C"], ["luma_bias", "int32", 6],
  ["from_luma", "int8", "C", 6], ["from_luma_bias", "int32", "C"],
  ["chroma", "int8", 12, "C"], ["chroma_bias", "int32", 12],
];
const SYNTHESIS = [
  ["delta", "int8", 12, 12, 5, 5], ["gain", "int32", 9], ["gain_by_step", "int32", 9],
  ["first", "int8", "H", 12, 3, 3], ["first_bias", "int32", "H"], ["first_by_step", "int32", "H"],
  ["second", "int8", "H", "H"], ["second_bias", "int32", "H"],
  ["third", "int8", 12, "H", 3, 3], ["third_bias", "int32", 12],
];

/**
 * A model: `to_colour`, and of each level set the networks `context` and `synthesis`.
 *
 * Arrays of a context are integers, with their exponent in `exponents`; those of a synthesis are
 * the numbers that they stand for (PYR-37).
 */
export function decodeModel(bytes) {
  const magic = new TextDecoder().decode(bytes.subarray(0, 8));
  supported(magic === "PXIMODL1", "the file of the model is not one");
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  const widths = { H: view.getUint16(8, true), C: view.getUint16(10, true) };
  let at = 12;
  const read = (type, shape) => {
    const count = shape.map((n) => widths[n] ?? n).reduce((a, b) => a * b);
    const exponent = view.getInt8(at++);
    const values = Float64Array.from({ length: count }, () => {
      const value = type === "int8" ? view.getInt8(at) : view.getInt32(at, true);
      at += type === "int8" ? 1 : 4;
      return value;
    });
    return { values, exponent };
  };
  const scaled = ({ values, exponent }) => values.map((v) => v * 2 ** exponent);
  const to_colour = scaled(read("int32", [3, 3]));
  const sets = [];
  for (let k = 0; k < LEVEL_SETS; k++) {
    const context = { width: widths.C, exponents: {} };
    for (const [name, type, ...shape] of CONTEXT) {
      const { values, exponent } = read(type, shape);
      context[name] = values;
      context.exponents[name] = exponent;
    }
    const synthesis = { width: widths.H };
    for (const [name, type, ...shape] of SYNTHESIS) synthesis[name] = scaled(read(type, shape));
    sets.push({ context, synthesis });
  }
  need(at === bytes.length, "the file of the model has another length");
  return { to_colour, sets, of: (level) => sets[Math.min(level, LEVEL_SETS) - 1] };
}

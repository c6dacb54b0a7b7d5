/** What a caller of `render` asks for: checked and completed, as the Python package does it. */

import { PxiError, within } from "./errors.js";

const SIDE_MAX = 2 ** 21; // output columns or rows
const NAMES = ["t", "width", "height", "scale", "region", "layers", "background", "dtype",
  "limits", "progress"];

export const DTYPES = {
  uint8: { array: Uint8ClampedArray, top: 255 },
  uint16: { array: Uint16Array, top: 65535 },
  float32: { array: Float32Array, top: 1 },
};

function usage(ok, message) {
  if (!ok) throw new PxiError("usage", message);
}

/** The nearest integer, ties to even. */
export function nearest(value) {
  const low = Math.floor(value);
  return value - low > 0.5 || (value - low === 0.5 && low % 2 !== 0) ? low + 1 : low;
}

/**
 * Region, output size, numbers of the layers to draw, time in microseconds or null, and type of the
 * samples; `options` are those of `render`.
 */
export function requested(image, options) {
  for (const name of Object.keys(options)) {
    usage(NAMES.includes(name), `render has no option ${name}; there are ${NAMES.join(", ")}`);
  }
  const dtype = options.dtype ?? "float32";
  usage(Object.hasOwn(DTYPES, dtype), `dtype ${dtype} is not ${Object.keys(DTYPES).join(", ")}`);
  const time = timeOf(image, options.t ?? null);
  const drawn = layersOf(image, options.layers ?? null, options.background ?? true);
  const region = regionOf(image, options.region ?? null);
  const [width, height] = sizeOf(options, region[2], region[3]);
  usage(width >= 1 && height >= 1, `output size ${width}x${height} is empty`);
  within(Math.max(width, height), SIDE_MAX, "side of the output");
  return { region, width, height, drawn, time, dtype };
}

function timeOf({ motion }, t) {
  if (t === null) return null;
  usage(motion, "the picture does not move");
  const finite = typeof t === "number" && Number.isFinite(t * 1e6);
  usage(finite, `t = ${t} is not a time in seconds`);
  return nearest(t * 1e6);
}

/** Numbers of layers, back to front. */
function layersOf({ names, head }, layers, background) {
  usage(layers === null || Array.isArray(layers), "layers is not a list of names and positions");
  const wanted = layers?.map((key) => positionOf(names, key));
  const drawn = names.flatMap(({ hidden }, k) => {
    const shown = wanted ? wanted.includes(k) : !hidden;
    return shown && (background || k > 0 || !head.opaque) ? [k] : [];
  });
  usage(drawn.length || (!wanted && background), "no layer is left to draw");
  return drawn;
}

function positionOf(names, key) {
  const count = names.length;
  const at = Number.isInteger(key) && key < 0 ? key + count : key;
  const found = typeof key === "string" ? names.findIndex(({ name }) => name === key) : at;
  const all = names.map(({ name }) => `'${name}'`).join(", ");
  usage(Number.isInteger(found) && found >= 0 && found < count,
    `there is no layer ${JSON.stringify(key)}; the picture has ${all}`);
  return found;
}

function regionOf({ width, height }, region) {
  if (region === null) return [0, 0, width, height];
  const four = Array.isArray(region) || ArrayBuffer.isView(region) ? [...region] : [];
  usage(four.length === 4 && four.every(Number.isInteger), "a region is four integers");
  const [x, y, w, h] = four;
  usage(w >= 1 && h >= 1 && x >= 0 && y >= 0 && x + w <= width && y + h <= height,
    `region ${four} is empty or leaves the canvas of ${width}x${height}`);
  return four;
}

/** Output columns and rows: given, scaled, or one of them from the other and the aspect ratio. */
function sizeOf({ width: columns, height: rows, scale }, w, h) {
  for (const size of [columns, rows]) {
    usage(size == null || Number.isInteger(size), "width and height are integers");
  }
  if (scale != null) {
    usage(columns == null && rows == null, "give either a scale or a width and height");
    const positive = typeof scale === "number" && Number.isFinite(scale) && scale > 0;
    usage(positive, `scale ${scale} is not a positive number`);
    within(scale * Math.max(w, h), SIDE_MAX, "side of the output");
    return [w, h].map((n) => Math.max(nearest(n * scale), 1));
  }
  if (columns == null && rows == null) return [w, h];
  if (rows == null) return [columns, Math.max(ratio(h, columns, w), 1)];
  if (columns == null) return [Math.max(ratio(w, rows, h), 1), rows];
  return [columns, rows];
}

/** The integer nearest to a b / c, ties to even, exactly. */
function ratio(a, b, c) {
  const [twice, over] = [2n * BigInt(a) * BigInt(b), 2n * BigInt(c)];
  const low = twice >= 0n ? twice / over : 0n; // what is negative is refused
  const rest = 2n * (twice - low * over);
  return Number(rest > over || (rest === over && low % 2n === 1n) ? low + 1n : low);
}

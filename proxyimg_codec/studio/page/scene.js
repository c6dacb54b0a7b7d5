/** The layers as they are drawn now: what the server sent, and what is being dragged on top of it. */
import { get, pixels } from "./server.js";
import { attach } from "./arap.js";
import { pathData, sampled } from "./bezier.js";
import { apply, inverse, product } from "./matrix.js";
import { emit, layerOf, on, store } from "./store.js";

/** @typedef {{nodes: Float32Array, bent: Float32Array, faces: number[], uvs: Float32Array, box: string, rest: Float32Array,
 *   skirt: number[][], triangles: Uint32Array, key: string}} Mesh */

/** Changes that are not yet with the server, by name of layer; `clip` is another outline on the canvas.
 * @type {Map<string, {matrix?: number[], bent?: Float32Array, opacity?: number, colour?: number[], hidden?: boolean, clip?: number[][][]}>} */
export const preview = new Map();

/** Displacements of nodes at the moment that is played, by name of layer. @type {Map<string, Float32Array>} */
export const sway = new Map();

/** @type {Map<string, {box: number[], scale: number}>} */
const textures = new Map();
/** The texture that was last there for a layer: drawn until a new one has come. @type {Map<string, string>} */
const latest = new Map();
/** @type {Map<string, Mesh>} */
const meshes = new Map();
/** @type {Map<string, Promise<any>>} */
const pending = new Map();
/** @type {Map<string, number[][][]|null>} */
const outlines = new Map();
/** The outline that was last there for a layer: pointed at until a new one has come. @type {Map<string, number[][][]|null>} */
const recent = new Map();
/** @type {any} */
let painter = null;

/** @param {any} value */
export function paintWith(value) { painter = value; }

/** Whether anything differs from the state of the server. */
export const changed = () => preview.size > 0 || sway.size > 0;

/** @template T @param {string} key @param {() => Promise<T>} work @returns {Promise<T>} */
function once(key, work) {
  const running = pending.get(key);
  if (running) return running;
  const made = work().finally(() => pending.delete(key));
  pending.set(key, made);
  return made;
}

/** Fetches the texture of a layer. @param {import("./store.js").Layer} layer @param {number} scale @param {boolean} [whole] also beyond its outline */
async function texture(layer, scale, whole = false) {
  const key = whole ? wholeKey(layer) : layer.texture;
  await once(`${key} ${scale}`, async () => {
    const got = await pixels(`/api/layers/${layer.index}/texture?scale=${scale}${whole ? "&whole=1" : ""}&key=${encodeURIComponent(layer.texture)}`);
    if (layerOf(layer.name)?.texture !== layer.texture) return;
    textures.set(key, { box: got.box, scale });
    painter?.give(key, got);
    if (!whole) latest.set(layer.name, key);
    tidy();
    emit("drawn");
  });
}

const wholeKey = (/** @type {any} */ layer) => `whole ${layer.texture}`;

/** Fetches what lies beyond the outline of a layer, too, so that the outline can be dragged. @param {string} name */
export async function wholeOf(name) {
  const layer = layerOf(name);
  if (layer && !textures.has(wholeKey(layer))) await texture(layer, textures.get(layer.texture)?.scale ?? 1, true);
}

/** Fetches the texture that a layer has now, if it is not there. @param {string} name */
export async function textureOf(name) {
  const layer = layerOf(name);
  if (layer && !textures.has(layer.texture)) await texture(layer, 1);
}

/** Fetches the mesh of a layer. @param {string} name @returns {Promise<Mesh>} */
export async function meshOf(name) {
  const layer = layerOf(name);
  if (!layer) throw new Error(name);
  const have = meshes.get(name);
  if (have?.key === layer.mesh) return have;
  return once(`mesh ${name} ${layer.mesh}`, async () => {
    const sent = await get(`/api/layers/${layer.index}/mesh?motion=1&key=${encodeURIComponent(layer.mesh)}`);
    const nodes = Float32Array.from(sent.nodes.flat());
    const count = nodes.length / 2 + sent.skirt.length;
    const made = {
      nodes, bent: sent.bent ? Float32Array.from(sent.bent.flat()) : nodes, faces: sent.faces.flat(), skirt: sent.skirt,
      triangles: Uint32Array.from(sent.triangles.flat()), uvs: new Float32Array(2 * count), box: "", rest: new Float32Array(2 * count), key: layer.mesh,
    };
    spread(made, nodes, made.rest);
    if (layerOf(name)?.mesh === layer.mesh) meshes.set(name, made);
    return made;
  });
}

/** Mesh that was fetched, or undefined. @param {string} name */
export const mesh = (name) => meshes.get(name);

/** Places of all vertices from those of the nodes. @param {Mesh} mesh @param {Float32Array} nodes @param {Float32Array} into */
function spread({ skirt }, nodes, into) {
  into.set(nodes);
  let at = nodes.length;
  for (const [i, j, k, a, b, c] of skirt) {
    into[at++] = a * nodes[2 * i] + b * nodes[2 * j] + c * nodes[2 * k];
    into[at++] = a * nodes[2 * i + 1] + b * nodes[2 * j + 1] + c * nodes[2 * k + 1];
  }
}

/** Lets go of textures that nothing shows any more. */
function tidy() {
  const { layers } = store.state, names = new Set(layers.map((/** @type {any} */ l) => l.name));
  for (const name of latest.keys()) if (!names.has(name)) latest.delete(name);
  const kept = new Set([...latest.values(), ...layers.flatMap((/** @type {any} */ l) => [l.texture, wholeKey(l)])]);
  for (const key of [...textures.keys()]) if (!kept.has(key)) { textures.delete(key); painter?.drop(key); }
}

/** Fetches what the present state needs. @param {number} scale device pixels in a canvas pixel */
export function load(scale) {
  const { state } = store;
  if (state.stage !== "editing") return;
  const area = state.size[0] * state.size[1];
  const wanted = [1, 2, 4].find((s) => s >= scale * 0.8 || area * s * s * 4 > 12e6) ?? 4;
  const names = new Set(state.layers.map((/** @type {any} */ l) => l.name));
  tidy();
  for (const name of meshes.keys()) if (!names.has(name)) meshes.delete(name);
  for (const layer of state.layers) {
    const have = textures.get(layer.texture);
    if (have) latest.set(layer.name, layer.texture);
    if (!have) texture(layer, 1).catch(() => {});
    else if (have.scale < wanted && !layer.hidden && preview.size === 0) texture(layer, wanted).catch(() => {});
    if (outline(layer.name) === undefined) outlineOf(layer.name).then(() => emit("drawn"), () => {});
    if (layer.bent && meshes.get(layer.name)?.key !== layer.mesh) meshOf(layer.name).then(() => emit("drawn"), () => {});
  }
}

/** Whether every layer can be drawn and pointed at. */
export function ready() {
  return store.state.layers.every((/** @type {any} */ l) => outline(l.name) !== undefined && painter?.has(l.texture) && (!l.bent || meshes.get(l.name)?.key === l.mesh));
}

/** @param {string} name */
export function matrixOf(name) { return preview.get(name)?.matrix ?? layerOf(name)?.matrix ?? [1, 0, 0, 1, 0, 0]; }

/** Present places of the nodes of a layer on the canvas, flat. @param {string} name @param {Mesh} mesh */
export function present(name, mesh, bent = preview.get(name)?.bent ?? mesh.bent) {
  const m = matrixOf(name), out = new Float64Array(bent.length);
  for (let i = 0; i < bent.length; i += 2) [out[i], out[i + 1]] = apply(m, bent[i], bent[i + 1]);
  return out;
}

/** Point of a layer at rest that is at a point of the canvas. @param {string} name @param {number} x @param {number} y @returns {number[]} */
export function atRest(name, x, y) {
  const mesh = meshes.get(name), [u, v] = apply(inverse(matrixOf(name)), x, y);
  return mesh && layerOf(name)?.bent ? carried(mesh, mesh.bent, mesh.nodes, u, v) : [u, v];
}

/** Point of the canvas at which a point of a layer at rest is. @param {string} name @param {number} u @param {number} v @returns {[number, number]} */
export function onCanvas(name, u, v) {
  const mesh = meshes.get(name), [x, y] = mesh && layerOf(name)?.bent ? carried(mesh, mesh.nodes, mesh.bent, u, v) : [u, v];
  return apply(matrixOf(name), x, y);
}

/** Where a point goes with the nodes of a mesh. @param {Mesh} mesh @param {Float32Array} from @param {Float32Array} to @param {number} x @param {number} y */
function carried(mesh, from, to, x, y) {
  const { triangle, weights } = attach(from, mesh.faces, x, y);
  return [0, 1].map((axis) => weights.reduce((/** @type {number} */ t, /** @type {number} */ w, /** @type {number} */ k) => t + w * to[2 * mesh.faces[3 * triangle + k] + axis], 0));
}

/** Vector on the canvas of one before the matrix of a layer. @param {string} name @param {number[]} vector @param {boolean} [back] the other way */
export function turned(name, [x, y], back = false) {
  const m = back ? inverse(matrixOf(name)) : matrixOf(name);
  return [m[0] * x + m[2] * y, m[1] * x + m[3] * y];
}

/** How much the matrix of a layer enlarges it. @param {string} name */
export function enlarged(name) { const [a, b, c, d] = matrixOf(name); return Math.sqrt(Math.abs(a * d - b * c)) || 1; }

/** Shows a layer bent: its nodes at places on the canvas, flat. @param {string} name @param {ArrayLike<number>} places */
export function bend(name, places) {
  const back = inverse(matrixOf(name)), bent = new Float32Array(places.length);
  for (let i = 0; i < places.length; i += 2) [bent[i], bent[i + 1]] = apply(back, places[i], places[i + 1]);
  preview.set(name, { ...preview.get(name), bent });
}

/** What to draw, back to front. @param {{sway: Map<string, Float32Array>, share: number}[]} ghosts faint copies @returns {import("./painter.js").Item[]} */
export function items(ghosts = []) {
  const out = [];
  for (const layer of store.state.layers) {
    const change = preview.get(layer.name);
    if (change?.hidden ?? layer.hidden) continue;
    const clip = change?.clip && textures.has(wholeKey(layer)) ? change.clip : null;
    const key = clip ? wholeKey(layer) : textures.has(layer.texture) ? layer.texture : latest.get(layer.name) ?? layer.texture;
    const item = {
      key, clip, matrix: change?.matrix ?? layer.matrix, box: textures.get(key)?.box ?? layer.box,
      colour: change?.colour ?? layer.colour, opacity: change?.opacity ?? layer.opacity, mesh: /** @type {any} */ (null),
    };
    const mesh = meshes.get(layer.name), moves = sway.get(layer.name), bent = change?.bent;
    if (mesh) for (const { sway: other, share } of ghosts) {
      const shift = other.get(layer.name);
      if (shift) out.push({ ...item, opacity: item.opacity * share, mesh: bentMesh(mesh, item.box, mesh.bent, shift) });
    }
    if (mesh && (bent || moves || layer.bent)) item.mesh = bentMesh(mesh, item.box, bent ?? mesh.bent, moves);
    out.push(item);
  }
  return out;
}

/** @param {Mesh} mesh @param {number[]} box @param {Float32Array} bent @param {Float32Array|undefined} moves */
function bentMesh(mesh, [x, y, w, h], bent, moves) {
  let nodes = bent;
  if (moves && moves.length === bent.length) nodes = bent.map((v, i) => v + moves[i]);
  const positions = new Float32Array(mesh.rest.length);
  spread(mesh, nodes, positions);
  if (mesh.box !== `${x} ${y} ${w} ${h}`) {
    mesh.box = `${x} ${y} ${w} ${h}`;
    mesh.uvs = mesh.rest.map((v, i) => (i % 2 ? (v - y) / h : (v - x) / w));
  }
  return { key: mesh.key, positions, uvs: mesh.uvs, triangles: mesh.triangles };
}

const pen = /** @type {CanvasRenderingContext2D|null} */ (typeof document === "undefined" ? null : document.createElement("canvas").getContext("2d"));
/** @type {WeakMap<number[][][], Path2D>} */
const shapes = new WeakMap();

/** Front layer whose outline holds a point of the canvas. @param {number} x @param {number} y @returns {string|null} */
export function hit(x, y) {
  const [w, h] = store.state.size;
  for (const layer of [...store.state.layers].reverse()) {
    if (layer.hidden || store.locked.has(layer.name)) continue;
    const now = outline(layer.name), paths = now === undefined ? recent.get(layer.name) : now;
    if (!paths) {
      if (paths === null && x >= 0 && y >= 0 && x <= w && y <= h) return layer.name;
      continue;
    }
    if (!shapes.has(paths)) shapes.set(paths, new Path2D(pathData(paths)));
    const [u, v] = apply(product(layer.matrix, inverse(matrixOf(layer.name))), x, y);
    if (pen?.isPointInPath(/** @type {Path2D} */ (shapes.get(paths)), u, v)) return layer.name;
  }
  return null;
}

/** Present outline of a layer as the server has it; null covers the canvas. @param {string} name @returns {Promise<number[][][]|null>} */
export async function outlineOf(name) {
  const layer = layerOf(name);
  if (!layer) return null;
  const key = outlineKey(layer);
  if (!outlines.has(key)) {
    const sent = await once(`outline ${key}`, () => get(`/api/layers/${layer.index}/outline`));
    if (outlines.size > 200) outlines.clear();
    outlines.set(key, sent.paths);
    recent.set(name, sent.paths);
  }
  return outlines.get(key) ?? null;
}

/** The same, if it was fetched. @param {string} name */
export function outline(name) {
  const layer = layerOf(name);
  return layer && outlines.get(outlineKey(layer));
}

const outlineKey = (/** @type {any} */ l) => `${l.name}|${l.texture}|${l.mesh}|${l.matrix}|${l.paths}|${store.state.at}`;

/** Oriented box of a layer before its matrix: x0, y0, x1, y1. @param {string} name */
export function localBox(name) {
  const layer = layerOf(name), paths = outline(name);
  if (!layer) return null;
  if (!paths) return layer.index === 0 && store.state.opaque ? [0, 0, ...store.state.size] : layer.box.length && [layer.box[0], layer.box[1], layer.box[0] + layer.box[2], layer.box[1] + layer.box[3]];
  const back = inverse(layer.matrix);
  let [x0, y0, x1, y1] = [Infinity, Infinity, -Infinity, -Infinity];
  for (const p of paths.map(sampled)) {
    for (let i = 0; i < p.length; i += 2) {
      const [x, y] = apply(back, p[i], p[i + 1]);
      x0 = Math.min(x0, x); x1 = Math.max(x1, x); y0 = Math.min(y0, y); y1 = Math.max(y1, y);
    }
  }
  return [x0, y0, x1, y1];
}

on("state", () => {
  for (const name of [...preview.keys()]) if (!layerOf(name)) preview.delete(name);
});

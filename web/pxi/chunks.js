/** Chapter 3: the values of every chunk, and the rules between chunks. */

import { sourcesShape } from "./copies.js";
import { need, supported, within } from "./errors.js";
import { MODEL_FILES } from "./registered.js";
import { Values } from "./msgpack.js";

const BYTES_MAX = 2 ** 31 - 1;
const int = (low, high) => ({ read: (v) => v.int(), ok: (n) => n >= low && n <= high });
const ints = (low, high, count) => ({
  read: (v) => v.array(() => v.int()),
  ok: (a) => (count === undefined || a.length === count) && a.every((n) => n >= low && n <= high),
});
const bytes = { read: (v) => v.binary(), ok: (b) => b.length <= BYTES_MAX };
const text = (low, high) => ({
  read: (v) => v.string(),
  ok: (s) => [...s].length >= low && [...s].length <= high,
});

/** Keys, types and ranges of payloads, in their order (CHK-1). */
const TABLES = {
  HEAD: {
    size: ints(1, 2 ** 24, 2), channels: int(3, 4), opaque: int(0, 1), depth: int(8, 16),
    layers: int(1, 2 ** 16), networks: int(0, 2 ** 16),
  },
  LAYR: {
    name: text(1, 255), box: ints(-(2 ** 24), 2 ** 24, 4), sampling: int(0, 255), unit: int(0, 6),
    segments: ints(1, 2 ** 24), classes: bytes, deltas: bytes,
  },
  MESH: {
    layer: int(0, 2 ** 16), origin: ints(-(2 ** 24), 2 ** 24, 2), step: ints(1, 2 ** 24, 2),
    vertices: int(3, 2 ** 16), gates: int(3, 2 ** 20), symbols: bytes, far: ints(0, 2 ** 16),
    classes: bytes, deltas: bytes, levels: int(0, 4), splits: bytes,
  },
  POSE: {
    layer: int(0, 2 ** 16), matrix: ints(1 - 2 ** 31, 2 ** 31 - 1, 4),
    shift: ints(1 - 2 ** 33, 2 ** 33 - 1, 2), opacity: int(0, 2 ** 16 - 1), hidden: int(0, 1),
    colour: ints(-(2 ** 20), 2 ** 20), node_classes: bytes, node_deltas: bytes,
    place_classes: bytes, place_deltas: bytes,
  },
  NETW: {
    dim: int(1, 64), octaves: int(0, 12), hidden: int(1, 1024), depth: int(1, 8),
    channels: int(3, 4), bits: int(2, 8), steps: bytes, biases: bytes, weights: bytes,
  },
  PLAN: {
    model: int(0, 2 ** 16 - 1), size: ints(1, 2 ** 24, 2), components: int(1, 3),
    step: int(0, 640), levels: int(1, 8), grey: int(0, 8), lowest: ints(0, 63),
    shifts: ints(0, 15), cell: int(1, 8), support: bytes, tile: int(0, 12), details: ints(0, 255),
    escapes: bytes, data: bytes,
  },
  mOTN: {
    duration: int(1, 3600000), fps: int(1, 240), loop: int(0, 1), intervals: int(1, 2 ** 16),
    unit: int(0, 6), layers: ints(0, 2 ** 16), bodies: ints(0, 2 ** 16), modes: int(1, 64),
    curve_classes: bytes, curve_deltas: bytes, shape_classes: bytes, shape_deltas: bytes,
    size: int(0, BYTES_MAX), script: bytes,
  },
};

/** Tables of TEXR by `coder`: shared, implicit, pyramid. */
const TEXTURES = [
  { coder: int(0, 255), texture: int(0, 2 ** 16) },
  {
    coder: int(0, 255), network: int(0, 2 ** 16), grid: ints(2, 2 ** 24, 2), bits: int(2, 8),
    steps: bytes, stored: bytes, codes: bytes,
  },
  {
    coder: int(0, 255), planes: int(0, 2 ** 16), alpha: int(0, 2 ** 16),
    part: ints(0, 2 ** 24, 4), cell: int(0, 6), mask: bytes, cuts: ints(0, 2 ** 16),
    behind: int(0, 2 ** 16), behind_alpha: int(0, 2 ** 16), grain: int(0, 6),
    offsets: ints(-(2 ** 24), 2 ** 24), sources: bytes, unmix: int(0, 1), matte: int(0, 2 ** 16),
  },
];

/** What pyramid textures have in files of versions before these minor ones (CON-19). */
const ADDED = [
  [11, {
    behind: 0, behind_alpha: 0, grain: 0, offsets: [], sources: new Uint8Array(), unmix: 0,
  }],
  [12, { matte: 0 }],
];

/** A layer without POSE has this one (chapter 3). */
export const REST = Object.freeze({
  matrix: [2 ** 24, 0, 0, 2 ** 24], shift: [0, 0], opacity: 65535, hidden: 0, colour: [],
  node_classes: [], node_deltas: [], place_classes: [], place_deltas: [],
});

/** Values of a payload by their keys (CON-14 to CON-18); that of an old file may be a map. */
function unpack({ kind, payload, minor }) {
  let table = TABLES[kind];
  if (kind === "TEXR") {
    const values = new Values(payload);
    if (values.header().map) need(values.string() === "coder", "the first key is not coder");
    const coder = values.int();
    need(coder >= 0, "coder is out of range");
    supported(coder <= 2, `texture coder ${coder}`);
    table = TEXTURES[coder];
  }
  const values = new Values(payload);
  const { map, count } = values.header();
  need(!map || minor <= 3, `${kind} is a map`);
  const newer = table === TEXTURES[2] ? ADDED.filter(([since]) => minor < since) : [];
  const absent = Object.assign({}, ...newer.map(([, fields]) => fields));
  if (kind === "PLAN" && minor < 12) Object.assign(absent, { tile: 0, details: [] });
  const keys = Object.keys(table).filter((key) => !(key in absent));
  need(count === keys.length, `${kind} has ${count} values instead of ${keys.length}`);
  const content = { ...absent };
  for (const key of keys) {
    if (map) need(values.string() === key, `${kind} lacks the key ${key} in its place`);
    content[key] = table[key].read(values);
    need(table[key].ok(content[key]), `${key} of ${kind} is out of range`);
  }
  values.end();
  return content;
}

/** All chunks that decide about pixels, checked: {head, layers, meshes, poses, ...}. */
export function readFile(chunks, limits) {
  const all = (kind) => chunks.filter((c) => c.kind === kind).map(unpack);
  const [head] = all("HEAD");
  within(Math.max(...head.size), limits.side, "side");
  within(head.layers, limits.layers, "layers");
  within(head.networks, limits.networks, "networks");
  need(head.depth === 8 || head.depth === 16, "depth is neither 8 nor 16");
  const file = {
    head, layers: all("LAYR"), meshes: all("MESH"), poses: all("POSE"), networks: all("NETW"),
    plans: all("PLAN"), textures: all("TEXR"), motion: all("mOTN")[0],
  };
  need(file.layers.length === head.layers, "the number of LAYR is wrong");
  need(file.textures.length === head.layers, "the number of TEXR is wrong");
  need(file.networks.length === head.networks, "the number of NETW is wrong");
  file.meshes = byLayer(file.meshes, head, "MESH");
  file.poses = byLayer(file.poses, head, "POSE");
  checkLayers(file);
  checkPoses(file);
  file.networks.forEach((n) => need(n.channels <= head.channels, "a network has too many channels"));
  checkPlans(file, limits);
  file.textures.forEach((texr, k) => checkTexture(file, texr, k));
  checkOpaque(file);
  checkMotion(file);
  checkLimits(file, limits);
  return file;
}

/** CHK-9 and CHK-10: one a layer, in the order of the layers. */
function byLayer(contents, head, kind) {
  const found = new Map();
  let last = -1;
  for (const content of contents) {
    need(content.layer > last && content.layer < head.layers, `${kind} of a wrong layer`);
    last = content.layer;
    found.set(last, content);
  }
  return found;
}

function checkLayers({ layers, meshes }) {
  need(new Set(layers.map((l) => l.name)).size === layers.length, "two layers have one name");
  layers.forEach((layr, i) => {
    need(layr.box[2] >= 1 && layr.box[3] >= 1, "a box is empty");
    supported(layr.sampling <= 3, `sampling ${layr.sampling}`);
    need(![1, 2].includes(layr.sampling) || meshes.has(i), "node sampling without a mesh");
    if (!layr.segments.length) {
      const empty = !layr.unit && !layr.classes.length && !layr.deltas.length;
      need(empty, "a layer without segments has a boundary");
    }
  });
}

export const identity = ({ matrix, shift }) =>
  [...matrix, ...shift].every((v, i) => v === [2 ** 24, 0, 0, 2 ** 24, 0, 0][i]);

function checkPoses({ poses, meshes }) {
  for (const [layer, pose] of poses) {
    const [a, b, c, d] = pose.matrix.map(BigInt);
    need(a * d !== b * c, "a matrix is singular");
    need([0, 12].includes(pose.colour.length), "a colour matrix has not 12 items");
    for (const kind of ["node", "place"]) {
      const some = pose[`${kind}_classes`].length;
      need(some || !pose[`${kind}_deltas`].length, "displacements without classes");
      need(!some || meshes.has(layer), "displacements without a mesh");
    }
    const plain = identity(pose) && pose.opacity === 65535 && !pose.hidden;
    const still = !pose.node_classes.length && !pose.place_classes.length;
    need(!(plain && still && !pose.colour.length), "a pose does nothing");
  }
}

/** PYR-1 to PYR-3, PYR-54 and PYR-55, and the limits of SEC-2. */
function checkPlans({ plans, textures }, limits) {
  for (const plan of plans) {
    supported(plan.model in MODEL_FILES, `model ${plan.model}`);
    need(plan.components !== 2, "planes of two components");
    need(plan.grey <= plan.levels, "more grey levels than levels");
    need(plan.components === 3 || plan.grey === plan.levels, "grey planes with chroma");
    need(plan.lowest.length === plan.components, "the number of lowest scales is wrong");
    need(plan.shifts.length === 2 * plan.levels, "the number of shifts is wrong");
    const [columns, rows] = plan.size.map((n) => Math.ceil(n / 2 ** plan.levels) * 2 ** plan.levels);
    limits.spend("samples", columns * rows);
    limits.spend("wavefronts", columns + 3 * rows);
    need(!plan.tile || plan.tile >= 6, "a tile is too small");
    need([0, plan.levels].includes(plan.details.length), "the number of details is wrong");
  }
  const met = new Set();
  for (const { coder, planes, alpha, behind, behind_alpha: soft, matte } of textures) {
    if (coder !== 2) continue;
    const named = [planes + 1, alpha, behind, soft, matte];
    for (const number of named.filter((n) => n)) met.add(number - 1);
  }
  need([...met].every((number) => number < plans.length), "planes that do not exist");
  need(met.size === plans.length, "planes that no texture uses");
}

function checkTexture({ head, layers, networks, plans, textures }, texr, k) {
  const layr = layers[k];
  if (texr.coder === 0) {
    need(texr.texture < k, "a shared texture is not an earlier one");
    const source = textures[texr.texture];
    need(source.coder !== 0, "a shared texture is shared itself");
    const same = (layr.sampling === 1) === (layers[texr.texture].sampling === 1);
    need(same, "a shared texture has other features");
    need(source.coder === 1 || layr.sampling === 0, "a pyramid texture is sampled at nodes");
  } else if (texr.coder === 1) {
    need(texr.network < networks.length, "a network does not exist");
    need(layr.sampling !== 1 || networks[texr.network].dim % 2 === 0, "dim is odd");
  } else {
    need(layr.sampling === 0, "a pyramid texture is sampled at nodes");
    checkView({ head, layers, plans }, texr, k);
  }
}

/** PYR-38 to PYR-40, and PYR-53. */
function checkView({ head, layers, plans }, texr, k) {
  const { planes, alpha, part, cell, mask, cuts, matte } = texr;
  const [x, y, w, h] = part;
  const { size } = plans[planes];
  need(w >= 1 && h >= 1 && x + w <= size[0] && y + h <= size[1], "a part is not in its raster");
  if (alpha) {
    const other = plans[alpha - 1];
    need(other.components === 1 && head.channels === 4, "alpha from planes of colour");
    need(other.size.every((n, i) => n === size[i]), "planes of alpha have another size");
  }
  if (matte) {
    const own = plans[matte - 1];
    need(own.components === 1 && head.channels === 4, "a matte from planes of colour");
    need(own.size[0] === w && own.size[1] === h, "a matte has another size than the part");
    need(texr.behind && !texr.unmix, "a matte without planes behind, or with unmix");
  }
  need(mask.length || !cell, "a cell without a mask");
  checkHidden(plans, texr);
  if (!cuts.length) return;
  need(w === layers[k].box[2] && h === layers[k].box[3], "a part with cuts is not as its box");
  cuts.forEach((c, i) => {
    need(c >= (i ? cuts[i - 1] + 1 : k) && c < layers.length, "cuts do not ascend in front");
    need(layers[c].segments.length, "a cut has no boundary");
  });
}

/** PYR-47 and PYR-48, but for what `sources` decode to. */
function checkHidden(plans, texr) {
  const { planes, alpha, part, behind, behind_alpha: soft, grain, offsets, sources } = texr;
  need(!soft || (behind && alpha), "behind_alpha without behind, or without alpha");
  for (const [number, components] of [[behind, [plans[planes].components, 3]], [soft, [1]]]) {
    if (!number) continue;
    const own = plans[number - 1];
    need(own.size[0] === part[2] && own.size[1] === part[3], "planes behind are not as the part");
    need(components.includes(own.components), "planes behind have other components");
  }
  need(offsets.length % 2 === 0 && offsets.length <= 510, "offsets are not up to 255 pairs");
  need(!offsets.length === !sources.length, "sources or offsets without the other");
  need(offsets.length || !grain, "a grain without sources");
  const cells = Math.ceil(part[2] / 2 ** grain) * Math.ceil(part[3] / 2 ** grain);
  need(!offsets.length || cells <= 65536, "too many cells of sources");
}

/** CHK-3. */
function checkOpaque({ head, layers, poses, networks, textures }) {
  if (!head.opaque) return;
  const [texr] = textures;
  need(!layers[0].segments.length, "the back layer of an opaque file has a boundary");
  const clear = texr.coder === 1 ? networks[texr.network].channels === 4 :
    texr.alpha !== 0 || texr.matte !== 0;
  need(!clear, "the back layer of an opaque file has alpha");
  const pose = poses.get(0) ?? REST;
  const still = identity(pose) && pose.opacity === 65535 && !pose.hidden;
  need(still && !pose.node_classes.length, "the back layer of an opaque file has moved");
}

/** MOT-1. */
function checkMotion({ head, meshes, motion }) {
  if (!motion) return;
  const { layers, bodies, size, script } = motion;
  need(layers.length && layers.length === bodies.length, "motion of no layer, or without bodies");
  layers.forEach((layer, i) => {
    need(!i || layer > layers[i - 1], "layers of a motion do not ascend");
    need(meshes.has(layer), "motion of a layer without a mesh");
    need(layer || !head.opaque, "motion of the back layer of an opaque file");
  });
  need((size === 0) === (script.length === 0), "size and script of a motion do not agree");
}

/** Numbers of values of a linear network, layer by layer (TEX-14). */
export function networkSizes({ dim, octaves, hidden, depth, channels }) {
  return [dim * (2 * octaves + 1), ...new Array(depth).fill(hidden), channels];
}

/** SEC-2, as far as it can be told before anything is decoded (SEC-5). */
function checkLimits({ layers, meshes, networks, textures, motion }, limits) {
  const add = (name, count) => limits.spend(name, count);
  layers.forEach((layr) => layr.segments.forEach((count) => add("segments", count)));
  meshes.forEach((mesh) => add("gates", mesh.gates));
  if (motion) add("metadata_bytes", motion.size);
  for (const netw of networks) {
    const sizes = networkSizes(netw);
    sizes.slice(1).forEach((outputs, i) => add("parameters", outputs * (sizes[i] + 1)));
  }
  textures.forEach((texr, k) => {
    if (texr.coder === 1) {
      const [columns, rows] = texr.grid;
      add("wavefronts", columns + 2 * rows);
      add("codes", networks[texr.network].dim * columns * rows);
    } else if (texr.coder === 2) {
      const [, , w, h] = texr.part;
      if (texr.mask.length) {
        const [columns, rows] = [w, h].map((n) => Math.ceil(n / 2 ** texr.cell));
        add("wavefronts", columns + 2 * rows);
        add("codes", columns * rows);
      }
      if (texr.sources.length) {
        const [channels, rows, columns] = sourcesShape(texr);
        add("wavefronts", columns + 2 * rows);
        add("codes", channels * columns * rows);
      }
      const fills = texr.sources.length ? 2 : 1;
      if (texr.mask.length || texr.cuts.length || texr.matte) add("filled", fills * w * h);
      add("covered", w * h * (texr.cuts.length + (texr.cuts.includes(k) ? k : 0)));
    }
  });
}

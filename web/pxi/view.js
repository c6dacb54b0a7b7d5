/** Chapter 8, "Views": the part of a raster that a layer shows, and what of it may be seen. */

import { REST } from "./chunks.js";
import { FILL_ONE, copy, decodeSources } from "./copies.js";
import { decodeMask } from "./entropy.js";
import { FULL, coverage, scalePaths } from "./geometry.js";
import { Budget } from "./limits.js";
import { Diffusion } from "./implicit.js";
import { clamp } from "./integers.js";

/** Whether a layer rests on layer n, which shows TEXR k (PYR-46, MOT-9). */
function rest({ layers, textures, poses, bodies, drawn }, n, k, other) {
  const texr = textures[other].coder === 0 ? textures[textures[other].texture] : textures[other];
  const [mine, its] = [layers[k].box, layers[other].box];
  if (!drawn.includes(other) || texr.coder !== 2 || texr.planes !== textures[k].planes) return false;
  const offset = (box, part, i) => box[i] - part[i];
  const registered = [0, 1].every((i) =>
    offset(mine, textures[k].part, i) === offset(its, texr.part, i) &&
    its[i + 2] === texr.part[i + 2]);
  const poseOf = (i) => poses.get(i) ?? REST;
  const [one, two] = [n, other].map(poseOf);
  const plain = (p) => !p.node_classes.length && !p.place_classes.length && p.opacity === 65535;
  const same = (key) =>
    one[key].length === two[key].length && one[key].every((v, i) => v === two[key][i]);
  return registered && plain(one) && plain(two) && ["matrix", "shift", "colour"].every(same) &&
    bodies.get(n) === bodies.get(other);
}

/** Marks what is not within some samples of a spoilt one, in both directions. */
function far(spoilt, w, h, reach = 2) {
  const spread = (from, count, step, lines, stride) => {
    const to = new Uint8Array(from.length);
    for (let line = 0; line < lines; line++) {
      for (let i = 0, at = line * stride; i < count; i++, at += step) {
        if (!from[at]) continue;
        const [first, last] = [Math.max(-reach, -i), Math.min(reach, count - 1 - i)];
        for (let k = first; k <= last; k++) to[at + k * step] = 1;
      }
    }
    return to;
  };
  return spread(spread(spoilt, w, 1, h, w), h, w, w, 1).map((v) => 1 - v);
}

/**
 * Which samples of the part that layer n shows show, and which are trusted (PYR-39 to PYR-41 and
 * PYR-46): two masks, or nulls if all do. And what is to be unmixed, or null (PYR-52).
 *
 * `scene` has layers, textures, poses, boundaries, bodies and the numbers of the layers that are
 * drawn; `k` is the number of the TEXR.
 */
function masksOf(scene, n, k) {
  const found = hardMasksOf(scene, n, k);
  const soft = softOf(scene, k);
  if (!soft) return { ...found, soft };
  const { part } = scene.textures[k];
  const [, , w, h] = part;
  const all = new Uint8Array(w * h).fill(1);
  const apart = scene.drawn.some((b) => b < n && !rest(scene, n, k, b));
  const still = found.lost && !apart ? far(found.lost, w, h) : new Uint8Array(w * h);
  const shown = (found.shown ?? all).map((v, i) => v & (!soft[i] || still[i]));
  const trusted = (found.trusted ?? all).map((v, i) => v & !soft[i]);
  return { ...found, shown, trusted, soft };
}

/** Which samples of a part are soft (PYR-53); null without a matte. */
function softOf({ textures, plans }, k) {
  const { matte, part: [, , w, h] } = textures[k];
  return matte ? storedOf(plans[matte - 1], w, h) : null;
}

/** Which samples of a raster lie in cells that are stored (PYR-5). */
function storedOf({ cell, support }, w, h) {
  const stored = new Uint8Array(w * h).fill(1);
  if (!support.length) return stored;
  const wide = Math.ceil(w / 2 ** cell);
  const bits = decodeMask(support, Math.ceil(h / 2 ** cell), wide);
  return stored.map((v, i) => bits[(Math.floor(i / w) >> cell) * wide + ((i % w) >> cell)]);
}

/** The same without what a matte does; `lost` are the samples that are bare to the layer itself. */
function hardMasksOf(scene, n, k) {
  const { layers, textures, limits } = scene;
  const { part, mask, cell, cuts, unmix: unmixed } = textures[k];
  const [, , w, h] = part;
  const masked = new Uint8Array(w * h).fill(1);
  if (mask.length) {
    const wide = Math.ceil(w / 2 ** cell);
    const bits = decodeMask(mask, Math.ceil(h / 2 ** cell), wide);
    for (let y = 0, i = 0; y < h; y++) {
      for (let x = 0; x < w; x++, i++) masked[i] = bits[(y >> cell) * wide + (x >> cell)];
    }
    if (!cuts.length) return { shown: masked, trusted: masked, edge: null };
  }
  if (!cuts.length) return { shown: null, trusted: null, edge: null };
  const covered = (c) => {
    if (!layers[c].segments.length) return null;
    const [left, top] = layers[k].box;
    const paths = scalePaths(scene.boundaries[c], layers[c].unit, [0, 0, 1, 1], 1, 1).map((path) =>
      path.map((p, i) => p - 256 * (i & 1 ? top : left)));
    return coverage(paths, w, 0, h, new Budget(limits));
  };
  const fronts = new Uint8Array(w * h); // takes something
  const bare = new Uint8Array(w * h);
  const open = masked.slice();
  for (const c of cuts) {
    if (c === k) continue;
    const cover = covered(c);
    const rests = rest(scene, n, k, c);
    for (let i = 0; i < w * h; i++) {
      if (!cover[i]) continue;
      fronts[i] = 1;
      if (cover[i] === FULL) open[i] = 0;
      if (!rests) bare[i] = 1;
    }
  }
  const own = cuts[0] === k ? covered(k) : null;
  let shown = own ? open.map((v, i) => v & (own[i] > 0)) : open.slice();
  if (!shown.includes(1)) shown = masked;
  const some = own ? fronts.map((v, i) => v | (own[i] < FULL)) : fronts;
  let trusted = far(some, w, h).map((v, i) => v & masked[i]);
  if (!trusted.includes(1)) trusted = shown;
  far(bare, w, h).forEach((v, i) => (open[i] &= v));
  const lost = own && bareBehind(scene, n, k, covered, w * h);
  if (own && !unmixed) {
    const clear = far(own.map((v, i) => v < FULL && lost[i]), w, h);
    const left = open.map((v, i) => v & (own[i] > 0) & clear[i]);
    return { shown: left.includes(1) ? left : shown, trusted, edge: null, lost };
  }
  const edge = own && edgeOf(own, open, lost, w, h);
  const left = open.map((v, i) => v & (!own || (own[i] > 0 && !edge.outer[i])));
  if (!left.includes(1)) return { shown, trusted, edge: null, lost };
  if (edge) {
    const beyond = far(own, w, h, 1);
    edge.free = masked.map((v, i) => v & beyond[i] & !fronts[i]);
  }
  return { shown: left, trusted, edge, lost };
}

/** The samples at the boundary of the layer, which has the coverage `own` (PYR-52). */
function edgeOf(own, open, bare, w, h) {
  const away = far(own.map((v, i) => v < FULL && bare[i]), w, h, 1);
  const outer = new Uint8Array(w * h);
  const share = new Map();
  const at = (x, y) => own[clamp(y, 0, h - 1) * w + clamp(x, 0, w - 1)];
  for (let i = 0; i < w * h; i++) {
    if (!open[i] || away[i]) continue;
    if (2 * own[i] < FULL) {
      outer[i] = 1;
      continue;
    }
    const [x, y] = [i % w, Math.floor(i / w)];
    const row = (y) => at(x - 1, y) + 4 * at(x, y) + at(x + 1, y);
    share.set(i, Math.max((row(y - 1) + 4 * row(y) + row(y + 1)) / (36 * FULL), 0.5));
  }
  return { share, outer };
}

/** The numbers of the samples of a part that are at most `reach` away from sample i. */
function around(i, reach, w, h) {
  const [x, y] = [i % w, Math.floor(i / w)];
  const found = [];
  for (let v = Math.max(y - reach, 0); v <= Math.min(y + reach, h - 1); v++) {
    for (let u = Math.max(x - reach, 0); u <= Math.min(x + reach, w - 1); u++) found.push(v * w + u);
  }
  return found;
}

/** Replaces straight colours, and alpha if there is any, at the boundary; `mixed` are those of the
 * raster (PYR-52). */
function unmix({ share, outer, free }, mixed, colours, alpha, w, h) {
  const mean = (values, places) => places.reduce((sum, i) => sum + values[i], 0) / places.length;
  for (const [i, own] of share) {
    const beyond = around(i, 3, w, h).filter((j) => free[j]);
    if (!beyond.length) continue;
    mixed.forEach((values, c) => {
      const value = (values[i] - (1 - own) * mean(values, beyond)) / own;
      colours[c][i] = clamp(value, 0, 1);
    });
  }
  outer.forEach((there, i) => {
    const beside = there ? around(i, 1, w, h).filter((j) => share.has(j)) : [];
    if (!beside.length) return;
    for (const values of [...colours, ...(alpha ? [alpha] : [])]) values[i] = mean(values, beside);
  });
}

/** The samples that are bare to layer k itself (PYR-46, second case). */
function bareBehind(scene, n, k, covered, size) {
  const found = new Uint8Array(size);
  const hidden = new Uint8Array(size);
  for (let b = k - 1; b >= 0; b--) {
    const rests = rest(scene, n, k, b);
    const cover = covered(b);
    if (rests && matteOf(scene, b)) continue;
    for (let i = 0; i < size; i++) {
      const value = cover ? cover[i] : FULL;
      if (rests && value === FULL) hidden[i] = 1;
      else if (!rests && value > 0 && !hidden[i]) found[i] = 1;
    }
  }
  return found;
}

/** The matte of the texture that a layer shows, its own or shared; 0 if there is none. */
function matteOf({ textures }, layer) {
  const { coder, texture } = textures[layer];
  return (coder === 0 ? textures[texture] : textures[layer]).matte;
}

/** Components [h, w] of a part of a raster. */
function componentsOf({ columns, planes }, [x0, y0, w, h]) {
  return planes.map((from) => {
    const out = new Float32Array(w * h);
    for (let y = 0; y < h; y++) {
      const at = (y0 + y) * columns + x0;
      out.set(from.subarray(at, at + w), y * w);
    }
    return out;
  });
}

/**
 * The samples that layer n shows, premultiplied [h, w, 3 or 4] (PYR-42, PYR-44).
 *
 * `rasters(number)` gives the samples of a PLAN.
 */
export function viewOf(scene, n, k, rasters) {
  const { planes, alpha, behind, part, matte } = scene.textures[k];
  const [, , w, h] = part;
  const { shown, trusted, edge, soft } = masksOf(scene, n, k);
  const sources = decodeSources(scene.textures[k]);
  let colours = componentsOf(rasters(planes), part);
  let share = alpha ? componentsOf(rasters(alpha - 1), part)[0] : null;
  if (edge || shown?.includes(0)) {
    const count = Math.max(colours.length, behind ? scene.plans[behind - 1].components : 1);
    const own = evenly(colours, count).concat(share ?? []);
    const hidden = hiddenOf(scene, k, own, trusted, rasters, sources);
    const merged = own.map((values, c) => values.map((v, i) => (shown[i] ? v : hidden[c][i] / FILL_ONE)));
    share = share && merged.pop();
    if (edge) unmix(edge, own.slice(0, merged.length), merged, share, w, h);
    colours = merged;
  }
  if (soft) {
    share = share ?? new Float32Array(w * h).fill(1);
    if (soft.some((v, i) => v && !shown[i])) {
      const [own] = componentsOf(rasters(matte - 1), [0, 0, w, h]);
      share = share.map((v, i) => (soft[i] && !shown[i] ? v * own[i] : v));
    }
  }
  const channels = share ? 4 : 3;
  const samples = new Float32Array(w * h * channels);
  for (let i = 0, to = 0; i < w * h; i++, to += channels) {
    const a = share ? share[i] : 1;
    for (let c = 0; c < 3; c++) samples[to + c] = colours[Math.min(c, colours.length - 1)][i] * a;
    if (share) samples[to + 3] = a;
  }
  return { samples, channels, w, h };
}

/** Components of colour in a greater number: grey stands for three. */
function evenly(colours, count) {
  return colours.length < count ? new Array(count).fill(colours[0]) : colours;
}

/** Values of a component as whole numbers in 1/65280. */
const whole = (values) => Int32Array.from(values, (v) => Math.round(FILL_ONE * v));

/**
 * Samples of TEXR k for what does not show, component by component in 1/65280 (PYR-42, PYR-47).
 *
 * `own` are those of its raster, alpha last.
 */
function hiddenOf({ textures, plans }, k, own, trusted, rasters, sources) {
  const texr = textures[k];
  const { part, alpha, behind, behind_alpha: soft } = texr;
  const [, , w, h] = part;
  const known = trusted.slice();
  const values = own.map(whole);
  if (behind) {
    const stored = storedOf(plans[behind - 1], w, h);
    const at = [0, 0, w, h];
    const count = values.length - (alpha ? 1 : 0);
    const others = evenly(componentsOf(rasters(behind - 1), at), count).map(whole);
    if (alpha) {
      const ones = () => new Int32Array(w * h).fill(FILL_ONE);
      others.push(soft ? whole(componentsOf(rasters(soft - 1), at)[0]) : ones());
    }
    stored.forEach((there, i) => {
      if (known[i] || !there) return;
      known[i] = 1;
      values.forEach((value, c) => (value[i] = others[c][i]));
    });
  }
  if (sources) copy(texr, sources, values, known);
  const diffusion = new Diffusion(known, h, w);
  values.forEach((value) => diffusion.fill(value));
  return values;
}

/** Weights of cubic convolution (PYR-43). */
function keys(f, out) {
  out[0] = (((2 - f) * f - 1) * f) / 2;
  out[1] = ((3 * f - 5) * f * f + 2) / 2;
  out[2] = (((4 - 3 * f) * f + 1) * f) / 2;
  out[3] = ((f - 1) * f * f) / 2;
}
const across = new Float64Array(4);
const down = new Float64Array(4);
const sums = new Float64Array(4);

/** Puts the colour at a texture point into out[at .. at + 3] (PYR-43, PYR-44). */
export function sampleView({ samples, channels, w, h }, box, x, y, out, at) {
  const u = clamp(((x - box[0]) * w) / box[2] - 0.5, 0, w - 1);
  const v = clamp(((y - box[1]) * h) / box[3] - 0.5, 0, h - 1);
  const [i, j] = [Math.floor(u), Math.floor(v)];
  keys(u - i, across);
  keys(v - j, down);
  sums.fill(0);
  sums[3] = channels === 3 ? 1 : 0;
  for (let n = 0; n < 4; n++) {
    if (!down[n]) continue;
    const row = clamp(j + n - 1, 0, h - 1) * w;
    for (let m = 0; m < 4; m++) {
      const weight = down[n] * across[m];
      if (!weight) continue;
      const from = (row + clamp(i + m - 1, 0, w - 1)) * channels;
      for (let c = 0; c < channels; c++) sums[c] += weight * samples[from + c];
    }
  }
  const a = clamp(sums[3], 0, 1);
  for (let c = 0; c < 3; c++) out[at + c] = clamp(sums[c], 0, a);
  out[at + 3] = a;
}

/** Chapter 9: from layers to pixels. */

import { Bent, Straight } from "./chart.js";
import { FULL, coverage, scalePaths } from "./geometry.js";
import { anchors, featuresAt, featuresOf, globalFeature, runNetwork } from "./implicit.js";
import { ANCHOR_COST, Budget, SAMPLE_COST } from "./limits.js";
import { outline } from "./pose.js";
import { DTYPES, nearest, requested } from "./request.js";
import { sampleView } from "./view.js";

const SAMPLES_MAX = 64; // a pixel, in each direction
const BAND = 2 ** 16; // samples that are computed together, about

/**
 * Renders the picture, or part of it, at any size. Throws PxiError, of kind "usage" if the options
 * contradict each other, are out of range or of another type.
 *
 * `options` are those of `Image.render` in Python; null or undefined is the default:
 * `t`, time in seconds, by default the still; `width` and `height` in pixels, where one of them alone
 * keeps the aspect ratio; `scale`, output pixels per canvas pixel, instead of both; `region`,
 * [x, y, width, height] in canvas pixels, by default the canvas; `layers`, names or positions, by
 * default all that are not hidden; `background`, whether to draw the back layer of an opaque picture;
 * `dtype`, "float32" in 0..1 (default), "uint8" or "uint16", rounded; `limits`, changes of the limits
 * of the image; `progress`, called with the number of pixels that were just drawn.
 *
 * Returns {width, height, channels, data}: straight colour, and alpha if there are 4 channels.
 */
export function render(image, options = {}) {
  const { region, width, height, drawn, time, dtype } = requested(image, options);
  const budget = new Budget({ ...image.limits, ...options.limits });
  budget.spend("output_pixels", width * height);
  const moves = time === null ? new Map() : image.motion.at(time);
  const view = viewOf(region, width, height);
  budget.spend("multiply_adds", drawn.length * view.columns * view.rows * SAMPLE_COST);
  const order = [...drawn].sort((a, b) => b - a);
  const sheets = order.map((n) => new Sheet(image, n, drawn, moves, view, budget));
  const opaque = image.head.opaque && drawn.includes(0);
  const channels = opaque ? 3 : 4;
  const data = new Float32Array(width * height * channels);
  const step = Math.max(1, Math.floor(BAND / (view.columns * view.sy)));
  for (let y = 0; y < height; y += step) {
    const band = bandOf(view, y * view.sy, Math.min(y + step, height) * view.sy);
    average(view, band, composite(sheets, band), channels, data);
    options.progress?.(width * ((band.bottom - band.top) / view.sy));
  }
  return { width, height, channels, data: converted(data, dtype) };
}

/** Samples of a type of `DTYPES`, rounded, from those in 0..1. */
function converted(data, dtype) {
  const { array, top } = DTYPES[dtype];
  return top === 1 ? data : array.from(data, (v) => nearest(Math.fround(v * top)));
}

/** REN-2 and REN-3. */
function viewOf(region, width, height) {
  const sx = Math.min(Math.ceil(region[2] / width), SAMPLES_MAX);
  const sy = Math.min(Math.ceil(region[3] / height), SAMPLES_MAX);
  return { region, width, height, sx, sy, columns: width * sx, rows: height * sy };
}

/** Rows of samples, and where they lie on the canvas. */
function bandOf({ region: [x0, y0, w, h], columns, rows }, top, bottom) {
  return {
    columns, top, bottom,
    x: (column) => x0 + ((column + 0.5) * w) / columns,
    y: (row) => y0 + ((row + 0.5) * h) / rows,
    columnAt: (x) => ((x - x0) * columns) / w - 0.5,
    rowAt: (y) => ((y - y0) * rows) / h - 0.5,
  };
}

/** Colour and alpha of the samples of a band [samples, 4] (REN-7). */
function composite(sheets, band) {
  const size = band.columns * (band.bottom - band.top);
  const result = new Float64Array(4 * size);
  const clear = new Float64Array(size).fill(1);
  for (const sheet of sheets) {
    const cover = sheet.coverage(band);
    const samples = [];
    for (let i = 0; i < size; i++) if (clear[i] > 0 && (!cover || cover[i] > 0)) samples.push(i);
    if (!samples.length) continue;
    const colours = sheet.colours(band, samples);
    samples.forEach((i, k) => {
      const share = cover ? cover[i] / FULL : 1;
      for (let c = 0; c < 4; c++) result[4 * i + c] += clear[i] * share * colours[4 * k + c];
      clear[i] *= 1 - share * colours[4 * k + 3];
    });
  }
  return result;
}

/** Means of the samples of each pixel, as they are put out (REN-11, REN-12). */
function average({ width, sx, sy, columns }, { top, bottom }, samples, channels, data) {
  const count = sx * sy;
  const sum = new Float64Array(4);
  for (let row = top; row < bottom; row += sy) {
    for (let column = 0; column < width; column++) {
      sum.fill(0);
      for (let j = 0; j < sy; j++) {
        const first = ((row - top + j) * columns + column * sx) * 4;
        for (let i = first; i < first + 4 * sx; i++) sum[i & 3] += samples[i];
      }
      const at = ((row / sy) * width + column) * channels;
      const alpha = channels === 4 ? Math.max(sum[3] / count, 1e-6) : 1;
      for (let c = 0; c < 3; c++) data[at + c] = Math.min(sum[c] / count / alpha, 1);
      if (channels === 4) data[at + 3] = Math.min(sum[3] / count, 1);
    }
  }
}

/** One layer in one view. */
class Sheet {
  constructor(image, n, drawn, moves, view, budget) {
    Object.assign(this, { image, n, drawn, budget });
    this.layr = image.layers[n];
    this.pose = image.pose(n);
    this.mesh = image.meshes.get(n);
    this.source = image.source(n);
    this.texr = image.textures[this.source];
    const shifts = sum(image.moved.get(n), moves.get(n));
    const places = image.places.get(n) ?? null;
    const { paths, unit } = outline(
      image.boundaries[n], this.layr.unit, image.head.size, this.pose, shifts, this.mesh,
      budget);
    this.paths = paths && scalePaths(paths, unit, view.region, view.columns, view.rows);
    const consulted = shifts || places || [1, 2].includes(this.layr.sampling);
    this.chart = consulted
      ? new Bent(this.pose, shifts, places, this.mesh, budget)
      : new Straight(this.pose);
    this.paint = this.texr.coder === 2 ? this.#ofView(moves.size > 0) : this.#ofPlane();
  }

  /** Coverage of the samples of a band, or null if all are covered. */
  coverage({ columns, top, bottom }) {
    return this.paths && coverage(this.paths, columns, top, bottom, this.budget);
  }

  /** Premultiplied colour and alpha of some samples of a band (REN-6). */
  colours(band, samples) {
    const count = samples.length;
    const [xs, ys, us, vs] = [0, 1, 2, 3].map(() => new Float64Array(count));
    samples.forEach((i, k) => {
      const row = Math.floor(i / band.columns);
      xs[k] = band.x(i - row * band.columns);
      ys[k] = band.y(band.top + row);
    });
    this.chart.prepare?.(band);
    this.chart.locate(samples, xs, ys, us, vs);
    const out = new Float64Array(4 * count);
    this.paint(us, vs, out);
    this.#recolour(out);
    return out;
  }

  #ofView(moving) {
    const view = this.image.view(this.n, moving, this.drawn);
    return (us, vs, out) => {
      for (let i = 0; i < us.length; i++) sampleView(view, this.layr.box, us[i], vs[i], out, 4 * i);
    };
  }

  #ofPlane() {
    const plane = this.image.plane(this.source);
    const network = this.image.networks[this.texr.network];
    const points = this.#anchors();
    const features = this.layr.sampling
      ? this.#nodeFeatures(plane, points)
      : (u, v, i, point) => featuresAt(plane, this.layr.box, u, v, point, 0);
    const weights = network.layers.reduce((sum, v) => sum + (v.inputs + 1) * v.outputs, 0);
    const cost = weights + ((points?.length ?? 0) / 2) * plane.dim * ANCHOR_COST;
    return (us, vs, out) => {
      this.budget.spend("multiply_adds", us.length * cost);
      runNetwork(network, us.length, (i, point) => features(us[i], vs[i], i, point), out);
    };
  }

  /** The anchors of a layer with a global feature, else null. */
  #anchors() {
    const { image, layr } = this;
    const global = [1, 3].includes(layr.sampling);
    return global ? anchors(image.boundaries[this.n], layr.unit, image.head.size) : null;
  }

  /** The input of the network for node sampling (TEX-20 to TEX-23). */
  #nodeFeatures(plane, points) {
    const { sampling, box } = this.layr;
    const { mesh, chart } = this;
    const { dim } = plane;
    const nodes = sampling !== 3 ? featuresOf(plane, box, mesh.nodes.map((v) => v / 1024)) : null;
    const there = points && featuresOf(plane, box, points);
    return (u, v, i, point) => {
      point.fill(0);
      if (nodes) {
        for (let corner = 3 * i; corner < 3 * i + 3; corner++) {
          const from = chart.corners[corner] * dim;
          for (let f = 0; f < dim; f++) point[f] += chart.weights[corner] * nodes[from + f];
        }
      }
      if (points) globalFeature(points, there, dim, u, v, point, nodes ? dim : 0);
    };
  }

  /** MSH-34 and MSH-35. */
  #recolour(out) {
    const { colour, opacity } = this.pose;
    if (!colour.length && opacity === 65535) return;
    const before = new Float64Array(4);
    for (let at = 0; at < out.length; at += 4) {
      if (colour.length) {
        before.set(out.subarray(at, at + 4));
        for (let c = 0; c < 3; c++) {
          let mixed = 0;
          for (let k = 0; k < 4; k++) mixed += (colour[4 * c + k] * before[k]) / 4096;
          out[at + c] = Math.min(Math.max(mixed, 0), before[3]);
        }
      }
      for (let c = 0; c < 4; c++) out[at + c] *= opacity / 65535;
    }
  }
}

/** Displacements of nodes in 1/1024 pixel: those of a pose, in 1/16, and of a motion (MOT-8). */
function sum(posed, moving) {
  if (!posed && !moving) return null;
  if (!posed) return moving;
  return posed.map((v, i) => 64 * v + (moving ? moving[i] : 0));
}

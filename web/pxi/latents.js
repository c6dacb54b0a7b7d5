/** Chapter 8 up to PYR-28: from the stream of a PLAN to its latents. All of it is exact. */

import { Rans, decodeMask } from "./entropy.js";
import { need } from "./errors.js";
import { clamp } from "./integers.js";
import { Rows, conv3, mirrored, rough, shapeOf } from "./planes.js";
import { DECAY, REACHES } from "./scales.js";

const STEP_ORIGIN = 293;
const SHIFT_ORIGIN = 8;
const LIMIT = 65536;
const CERTAIN = 4;
const DIRECT = 40;

/** P(k, n) of PYR-11, for n below 16 * 33. */
const powers = memo((k) => {
  const values = new Float64Array(16 * 33);
  let value = 1n << 30n;
  for (let n = 0; n < values.length; n++) {
    values[n] = Number(value);
    value = (value * BigInt(DECAY[k]) + (1n << 29n)) >> 30n;
  }
  return values;
});

/** Cumulative frequencies of the distribution of (s', p) = (key >> 4, key & 15) (PYR-11). */
const distribution = memo((key) => {
  const [scale, part] = [key >> 4, key & 15];
  const reach = REACHES[scale];
  const below = (i) => {
    const z = 16 * (i - reach) - part;
    const tail = 7 * powers(scale)[Math.abs(z)] + powers(scale + 8)[Math.abs(z)];
    return z < 0 ? tail : 2 ** 34 - tail;
  };
  const starts = Uint16Array.from({ length: 2 * reach + 3 }, (_, i) => {
    return Math.floor(((below(i) - below(0)) * (2 ** 14 - 2 * reach - 2)) / 2 ** 34) + i;
  });
  starts[2 * reach + 2] = 2 ** 14;
  return starts;
});

function memo(make) {
  const made = [];
  return (key) => (made[key] ??= make(key));
}

/** The latents of one stream, set by set (PYR-8 to PYR-13). */
class Coder {
  /** `most` is the number of latents of the largest set. */
  constructor({ data, escapes }, most) {
    this.rans = new Rans(data);
    this.data = data;
    this.escapes = escapes;
    this.escaped = 0;
    this.low = new Uint16Array(most);
  }

  /** Puts `count` latents into `out`; `means` and `scales` are what is expected of them. */
  set(means, scales, out, count) {
    const { rans, low } = this;
    const lanes = rans.lanes - 1;
    let coded = 0;
    let raw = 0;
    for (let i = 0; i < count; i++) {
      let scale = scales[i];
      let mean = means[i];
      if (scale <= CERTAIN && mean >= -4 && mean <= 4) {
        out[i] = 0;
        continue;
      }
      const shift = rawBits(scale);
      if (shift) {
        raw++;
        scale -= (11 * shift + 1) >> 1;
        mean = (mean >> shift) - 8 + (8 >> shift);
      }
      const centre = (mean + 8) >> 4;
      const reach = REACHES[scale];
      const starts = distribution((scale << 4) | (mean + 8 - 16 * centre));
      const symbol = rans.symbol(coded++ & lanes, starts, 0, 2 * reach + 2);
      // Escapes come after raw bits, so they are marked for now.
      out[i] = symbol > 2 * reach ? ESCAPE - centre : centre + symbol - reach;
    }
    let lane = 0;
    for (let i = 0; i < count; i++) {
      const shift = raw ? rawBits(scales[i]) : 0;
      low[i] = shift ? rans.raw(lane++ & lanes, shift) : 0;
    }
    for (let i = 0; i < count; i++) {
      if (out[i] < ESCAPE / 2) out[i] = ESCAPE - out[i] + this.#escape();
      const shift = raw ? rawBits(scales[i]) : 0;
      const value = out[i] * 2 ** shift + low[i];
      need(Math.abs(value) < LIMIT, "a latent is out of range");
      out[i] = value;
    }
  }

  /** PYR-13. */
  #escape() {
    let value = 0;
    for (let shift = 0; shift < 28; shift += 7) {
      need(this.escaped < this.escapes.length, "escapes end early");
      const byte = this.escapes[this.escaped++];
      value |= (byte & 127) << shift;
      if (byte < 128) return value & 1 ? -((value + 1) >> 1) : value >> 1;
    }
    need(false, "an escape has more than four bytes");
  }

  finish() {
    this.rans.finish();
    need(this.rans.end === this.data.length, "there are bytes after the latents");
    need(this.escaped === this.escapes.length, "escapes are left over");
  }
}
const ESCAPE = -(2 ** 30);

/** PYR-10. */
const RAW_BITS = Uint8Array.from({ length: 64 }, (_, scale) => {
  let bits = 0;
  while (scale - ((11 * bits + 1) >> 1) > DIRECT) bits++;
  return bits;
});
const rawBits = (scale) => RAW_BITS[scale];

/** S(x, u) of PYR-18. */
function squashed(x, unit) {
  const v = Math.min(Math.abs(x), 508 * unit);
  const under = 4 * unit + v;
  const value = Math.floor((128 * v + Math.floor(under / 2)) / under);
  return x < 0 ? -value : value;
}

/** G(x) of PYR-18 by |x|, and S(x, 1) by |x|. */
const LOGS = Int32Array.from({ length: 53 }, (_, x) => Math.round(32 * Math.log(1 + x)));
const SQUASHED = Int32Array.from({ length: 509 }, (_, x) => squashed(x, 1));
const logOf = (x) => LOGS[Math.min(Math.abs(x), 52)];
const squash = (x) => (x < 0 ? -SQUASHED[Math.min(-x, 508)] : SQUASHED[Math.min(x, 508)]);

/** round(x, bits) as of the beginning of chapter 8, as a function of x. */
function rounding(bits) {
  if (bits <= 0) return (x) => x * 2 ** -bits;
  const half = 1 << (bits - 1);
  return (x) => (x + half) >> bits;
}

/** The lowest planes [3][rows * columns] (PYR-14). */
function decodeLowest(coder, scales, rows, columns) {
  const planes = [0, 1, 2].map(() => new Int32Array(rows * columns));
  const count = scales.length;
  const most = count * Math.min(rows, columns);
  const [means, wanted, found] = [new Int32Array(most), new Uint8Array(most), new Int32Array(most)];
  for (let t = 0; t < rows + columns - 1; t++) {
    const first = Math.max(0, t - columns + 1);
    const last = Math.min(rows - 1, t);
    let i = 0;
    for (let y = first; y <= last; y++) {
      const x = t - y;
      const at = y * columns + x;
      for (let c = 0; c < count; c++, i++) {
        const up = y ? planes[c][at - columns] : x ? planes[c][at - 1] : 0;
        const left = x ? planes[c][at - 1] : up;
        means[i] = 8 * (up + left);
        wanted[i] = scales[c];
      }
    }
    coder.set(means, wanted, found, i);
    i = 0;
    for (let y = first; y <= last; y++) {
      for (let c = 0; c < count; c++) planes[c][y * columns + t - y] = found[i++];
    }
  }
  return planes;
}

const LOW_TAPS = [[0, -10, 202, -10, 0], [0, -17, 107, 107, -17]];
const HIGH_TAPS = [[6, -97, -97, 6, 0], [10, -28, 218, -28, 10]];

/** J of PYR-16 for one line that becomes `size` values, with strides of the inputs and the output. */
function join(low, high, at, size, step, scale, out, to, stride) {
  const length = ((size + 1) >> 1) + 4;
  const line = (values, isHigh, factor) =>
    Int32Array.from({ length }, (_, i) => factor * values[at + mirrored(i - 2, size, isHigh) * step]);
  const a = line(low, 0, 1);
  const b = line(high, 1, scale);
  for (let n = 0; n < size; n++) {
    const [l, h] = [LOW_TAPS[n & 1], HIGH_TAPS[n & 1]];
    let sum = 128;
    for (let k = 0; k < 5; k++) sum += l[k] * a[(n >> 1) + k] + h[k] * b[(n >> 1) + k];
    out[to + n * stride] = sum >> 8;
  }
}

/**
 * The plain plane of the next finer level, of `rows` and `columns`, from that of a level and its
 * three bands (PYR-15).
 */
function nextPlain(plain, bands, [rows, columns]) {
  const sixteenfold = bands[0].map((v) => 16 * v);
  const half = (columns + 1) >> 1;
  const left = new Int32Array(rows * half);
  const right = new Int32Array(left.length);
  for (let x = 0; x < half; x++) {
    join(plain, bands[1], x, rows, half, 16, left, x, half);
    join(sixteenfold, bands[2], x, rows, half, 16, right, x, half);
  }
  const out = new Int32Array(rows * columns);
  for (let y = 0; y < rows; y++) join(left, right, y * half, columns, 1, 1, out, y * columns, 1);
  return out.map((v) => clamp(v, -(2 ** 20), 2 ** 20));
}

/** Which positions of a level lie over a stored sample (PYR-5, PYR-6): a byte for each. */
function supportOf({ cell, size: [w, h] }, cells, level, rows, columns) {
  const wide = Math.ceil(w / 2 ** cell);
  const side = 2 ** level;
  const reach = (from, size) => [
    Math.floor(from / 2 ** cell), Math.floor((Math.min(from + side, size) - 1) / 2 ** cell)];
  const support = new Uint8Array(rows * columns);
  for (let y = 0; y * side < h; y++) {
    const [top, bottom] = reach(y * side, h);
    for (let x = 0; x * side < w; x++) {
      const [left, right] = reach(x * side, w);
      let any = cells ? 0 : 1;
      for (let j = top; j <= bottom && !any; j++) {
        for (let i = left; i <= right; i++) any |= cells[j * wide + i];
      }
      support[y * columns + x] = any;
    }
  }
  return support;
}

/** A support with the eight neighbours of each position. */
function grown(support, rows, columns) {
  const out = new Uint8Array(support.length);
  for (let y = 0; y < rows; y++) {
    for (let x = 0; x < columns; x++) {
      if (!support[y * columns + x]) continue;
      for (let j = Math.max(y - 1, 0); j <= Math.min(y + 1, rows - 1); j++) {
        out.fill(1, j * columns + Math.max(x - 1, 0), j * columns + Math.min(x + 2, columns));
      }
    }
  }
  return out;
}

/** Which latents of a level are coded (PYR-6): a byte for each position, with bit b for band b. */
function bandsOf(plan, cells, level) {
  const [rows, columns] = shapeOf(plan, level);
  let support = supportOf(plan, cells, level, rows, columns);
  if (plan.model > 1 && level >= plan.cell) support = grown(support, rows, columns);
  const [finerRows, finerColumns] = shapeOf(plan, level - 1);
  return support.map((some, at) => {
    const across = at % columns < finerColumns >> 1;
    const down = at < (finerRows >> 1) * columns;
    return some && (across ? 1 : 0) + (down ? 2 : 0) + (across && down ? 4 : 0);
  });
}

/** One level: its context networks, and the waves in which it is coded (PYR-18 to PYR-28). */
class Level {
  constructor(net, { step }, [rows, columns], bands) {
    Object.assign(this, { net, rows, columns, bands });
    this.width = net.width;
    this.latents = Array.from({ length: 9 }, () => new Int32Array(rows * columns));
    this.some = new Uint8Array(rows * columns); // whether a position has a latent that is not 0
    this.bias = net.first_bias.map((b, i) => {
      return b + Math.floor((net.first_by_step[i] * (step - STEP_ORIGIN) + 128) / 256);
    });
    this.round = {};
    for (const [name, bits] of Object.entries({
      first: 0, second: 3, causal: 3, mix: 0, from_luma: 3,
      luma_mean: -1, luma_scale: -2, chroma_mean: -1, chroma_scale: -2,
    })) {
      this.round[name] = rounding(-net.exponents[name.replace(/_(mean|scale)$/, "")] - bits);
    }
    this.sums = new Float64Array(this.width);
    this.total = new Float64Array(this.width);
    this.#arrange();
  }

  /** Weights of `causal` as [position][latent][S, G][output], and of `mix` as [input][output]. */
  #arrange() {
    const { width, net } = this;
    this.mix = net.mix.map((_, i) => net.mix[(i % width) * width + Math.floor(i / width)]);
    this.causal = new Float64Array(12 * 18 * width);
    for (let o = 0; o < width; o++) {
      for (let f = 0; f < 18; f++) {
        for (let p = 0; p < 12; p++) {
          const at = ((p * 9 + (f % 9)) * 2 + (f < 9 ? 0 : 1)) * width + o;
          this.causal[at] = net.causal[(o * 18 + f) * 12 + p];
        }
      }
    }
  }

  /** The results of the second layer [rows, columns, width] (PYR-20 to PYR-22). */
  ahead(plain, parent) {
    const { rows, columns, width, net, bands } = this;
    const wide = columns + 2;
    const inputs = new Rows(rows, 12 * wide, (y, row) => {
      for (let c = 0; c < 3; c++) {
        rough(plain[c], rows, columns, y, (x, v) => (row[c * wide + x + 1] = squashed(v, 144)));
      }
      if (!parent) return;
      for (let c = 0; c < 9; c++) {
        const from = (y >> 1) * ((columns + 1) >> 1);
        const to = (3 + c) * wide + 1;
        for (let x = 0; x < columns; x++) row[to + x] = logOf(parent[c][from + (x >> 1)]);
      }
    });
    const first = new Rows(rows, width * wide, (y, row) => {
      conv3(inputs.around(y), 12, columns, net.first, this.bias, width, row, 1, wide);
      for (let o = 0; o < width; o++) {
        for (let x = o * wide + 1; x <= o * wide + columns; x++) {
          row[x] = clamp(this.round.first(row[x]), 0, 255);
        }
      }
    });
    const out = new Int16Array(rows * columns * width);
    const sums = new Float64Array(width * columns);
    for (let y = 0; y < rows; y++) {
      if (!bands.subarray(y * columns, (y + 1) * columns).some((b) => b)) continue;
      conv3(first.around(y), width, columns, net.second, net.second_bias, width, sums, 0, columns);
      for (let o = 0; o < width; o++) {
        let to = y * columns * width + o;
        for (let x = o * columns; x < (o + 1) * columns; x++, to += width) {
          out[to] = clamp(this.round.second(sums[x]), -32768, 32767);
        }
      }
    }
    return out;
  }

  /** Decodes the latents of a tile {top, bottom, left, right}, which may be the whole level. */
  decode(coder, ahead, shifts, grey, tile) {
    const { columns, bands, width } = this;
    const { top, bottom, left, right } = tile;
    this.tile = tile;
    const most = Math.min(bottom - top, Math.ceil((right - left) / 3));
    const hidden = new Int32Array(most * width);
    const places = new Uint32Array(most);
    const means = new Int32Array(6 * most);
    const scales = new Uint8Array(6 * most);
    const found = new Int32Array(6 * most);
    for (let t = left + 3 * top; t < right + 3 * bottom - 3; t++) {
      let count = 0;
      const last = Math.min(bottom - 1, Math.floor((t - left) / 3));
      for (let y = Math.max(top, Math.ceil((t - right + 1) / 3)); y <= last; y++) {
        const at = y * columns + t - 3 * y;
        if (bands[at]) places[count++] = at;
      }
      if (!count) continue;
      for (let i = 0; i < count; i++) {
        this.#hidden(places[i], ahead, hidden, i * width);
        this.#expect("luma", hidden, i * width, shifts[0], means, scales, 3 * i, 3, bands[places[i]]);
      }
      coder.set(means, scales, found, 3 * count);
      this.#store(places, count, found, 0, 3);
      if (grey) continue;
      for (let i = 0; i < count; i++) {
        this.#withLuma(places[i], hidden, i * width);
        this.#expect("chroma", hidden, i * width, shifts[1], means, scales, 6 * i, 6, bands[places[i]]);
      }
      coder.set(means, scales, found, 6 * count);
      this.#store(places, count, found, 3, 6);
    }
  }

  /** Whether any position of a tile has latents. */
  anyOf({ top, bottom, left, right }) {
    for (let y = top; y < bottom; y++) {
      const from = y * this.columns;
      if (this.bands.subarray(from + left, from + right).some((b) => b)) return true;
    }
    return false;
  }

  #store(places, count, found, first, channels) {
    for (let i = 0, k = 0; i < count; i++) {
      for (let c = 0; c < channels; c++, k++) {
        if (!found[k]) continue;
        this.latents[first + c][places[i]] = found[k];
        this.some[places[i]] = 1;
      }
    }
  }

  /** Hidden values of a position into out[to ..] (PYR-23, PYR-24). */
  #hidden(at, ahead, out, to) {
    const { width, columns, latents, some, sums, total } = this;
    const { top, left, right } = this.tile;
    sums.fill(0);
    const y = Math.floor(at / columns);
    const x = at - y * columns;
    for (let p = 0; p < 12; p++) {
      const near = x + BEFORE_X[p];
      const place = at + BEFORE_Y[p] * columns + BEFORE_X[p];
      if (y + BEFORE_Y[p] < top || near < left || near >= right || !some[place]) continue;
      for (let c = 0; c < 9; c++) {
        const value = latents[c][place];
        if (value) this.#addCausal((p * 9 + c) * 2 * width, squash(value), logOf(value));
      }
    }
    total.set(this.net.mix_bias);
    for (let i = 0; i < width; i++) {
      const z = (ahead[at * width + i] + this.round.causal(sums[i]) + 4) >> 3;
      if (z > 0) this.#addMix(i * width, z > 255 ? 255 : z);
    }
    for (let o = 0; o < width; o++) out[to + o] = clamp(this.round.mix(total[o]), 0, 255);
  }

  #addCausal(w, s, g) {
    const { width, causal, sums } = this;
    for (let o = 0; o < width; o++) sums[o] += s * causal[w + o] + g * causal[w + width + o];
  }

  #addMix(w, z) {
    const { width, mix, total } = this;
    for (let o = 0; o < width; o++) total[o] += z * mix[w + o];
  }

  /** Means and scales of `count` latents (PYR-25); 0, which is certain, for bands not there. */
  #expect(name, hidden, at, shift, means, scales, to, count, bands) {
    const { width, net } = this;
    const weights = net[name];
    const bias = net[`${name}_bias`];
    const [ofMean, ofScale] = [this.round[`${name}_mean`], this.round[`${name}_scale`]];
    for (let k = 0; k < 2 * count; k++) {
      let total = bias[k];
      for (let i = 0; i < width; i++) total += weights[k * width + i] * hidden[at + i];
      if (k < count) means[to + k] = clamp(ofMean(total), -16384, 16384);
      else scales[to + k - count] = clamp(ofScale(total) + 32 + shift, 0, 63);
    }
    if (bands === 7) return;
    for (let k = 0; k < count; k++) {
      if (!((bands >> k % 3) & 1)) means[to + k] = scales[to + k] = 0;
    }
  }

  /** What chroma sees, in place of the hidden values (PYR-26). */
  #withLuma(at, hidden, to) {
    const { width, net, latents } = this;
    const y = [latents[0][at], latents[1][at], latents[2][at]];
    const inputs = [...y.map(squash), ...y.map(logOf)];
    for (let o = 0; o < width; o++) {
      let total = net.from_luma_bias[o];
      for (let i = 0; i < 6; i++) total += net.from_luma[o * 6 + i] * inputs[i];
      hidden[to + o] = clamp((8 * hidden[to + o] + this.round.from_luma(total) + 4) >> 3, 0, 255);
    }
  }
}
const BEFORE = [-2, -1, 0].flatMap((j) => [-2, -1, 0, 1, 2].map((i) => [j, i])).slice(0, 12);
const BEFORE_Y = Int32Array.from(BEFORE, ([j]) => j);
const BEFORE_X = Int32Array.from(BEFORE, ([, i]) => i);

/** Tiles of a level (PYR-54); one, if it has none. */
function tilesOf({ tile }, rows, columns) {
  const side = tile ? 2 ** tile : Math.max(rows, columns);
  const tiles = [];
  for (let top = 0; top < rows; top += side) {
    for (let left = 0; left < columns; left += side) {
      tiles.push({
        top, bottom: Math.min(top + side, rows), left, right: Math.min(left + side, columns) });
    }
  }
  return tiles;
}

/** The coder of the first tile in some bytes, and the bytes behind it (PYR-54). */
function tileCoder(bytes, most) {
  let count = 0;
  let at = 0;
  for (let scale = 1; ; scale *= 128) {
    need(at < bytes.length && at < 5, "a tile ends early");
    count += (bytes[at] & 127) * scale;
    if (bytes[at++] < 128) break;
  }
  const start = at + count;
  need(start <= bytes.length, "the escapes of a tile end early");
  const end = start + new Rans(bytes.subarray(start)).end;
  const own = { data: bytes.subarray(start, end), escapes: bytes.subarray(at, start) };
  return [new Coder(own, most), bytes.subarray(end)];
}

/** Latents of a PLAN: `lowest` [3][positions], and `levels` 1, 2, .. {rows, columns, latents}. */
export function decodeLatents(plan, model) {
  const [w, h] = plan.size;
  const count = plan.levels;
  const cells = plan.support.length
    ? decodeMask(plan.support, Math.ceil(h / 2 ** plan.cell), Math.ceil(w / 2 ** plan.cell))
    : null;
  const most = 6 * Math.min(...shapeOf(plan, 0)) + 6;
  const first = plan.tile ? new Rans(plan.data).end : plan.data.length;
  const coder = new Coder({ data: plan.data.subarray(0, first), escapes: plan.escapes }, most);
  let rest = plan.data.subarray(first);
  const lowest = decodeLowest(coder, plan.lowest, ...shapeOf(plan, count));
  let plain = lowest.map((plane) => plane.map((v) => 16 * v));
  let parent = null;
  const levels = [];
  for (let l = count; l >= 1; l--) {
    const [rows, columns] = shapeOf(plan, l);
    const level = new Level(model.of(l).context, plan, [rows, columns], bandsOf(plan, cells, l));
    const shifts = plan.shifts.slice(2 * l - 2, 2 * l).map((v) => v - SHIFT_ORIGIN);
    const ahead = level.ahead(plain, parent);
    const tiles = tilesOf(plan, rows, columns);
    for (const tile of tiles) {
      if (tiles.length > 1 && !level.anyOf(tile)) continue;
      let own = coder;
      if (tiles.length > 1) [own, rest] = tileCoder(rest, most);
      level.decode(own, ahead, shifts, l <= plan.grey, tile);
      if (tiles.length > 1) own.finish();
    }
    const { latents } = level;
    levels.unshift({ rows, columns, latents });
    if (l > 1) {
      const finer = shapeOf(plan, l - 1);
      plain = plain.map((p, c) => nextPlain(p, latents.slice(3 * c, 3 * c + 3), finer));
    }
    parent = latents;
  }
  coder.finish();
  need(rest.length === 0, "there are bytes after the last tile");
  return { lowest, levels };
}

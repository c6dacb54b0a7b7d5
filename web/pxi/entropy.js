/** Chapter 4: rANS streams, coded arrays and signed integers. */

import { need } from "./errors.js";

const LOW = 65536;
const SLOTS = 1 << 14;
const COUNT_START = 8;
const COUNT_STEP = 32;

/** A rANS stream (ENT-3 to ENT-7); it begins at byte 0 of `data` and ends at `end`. */
export class Rans {
  constructor(data) {
    need(data.length > 0 && data[0] <= 10, "a stream has too many lanes, or none");
    this.lanes = 1 << data[0];
    this.data = data;
    this.at = 1 + 4 * this.lanes + 4;
    need(data.length >= this.at, "a stream ends in its states");
    const view = new DataView(data.buffer, data.byteOffset);
    this.states = new Uint32Array(this.lanes);
    for (let i = 0; i < this.lanes; i++) {
      this.states[i] = view.getUint32(1 + 4 * i, true);
      need(this.states[i] >= LOW, "a state is too low");
    }
    this.words = view.getUint32(this.at - 4, true);
    this.end = this.at + 2 * this.words;
    need(data.length >= this.end, "a stream ends in its words");
  }

  /** Refuses more symbols than the stream can hold (SEC-7). */
  reserve(symbols, alphabet) {
    const most = (2 ** 18 * (this.words + this.lanes)) / (alphabet - 1);
    need(symbols <= most, "a stream is too short for its symbols");
  }

  /** A symbol, by the cumulative frequencies from `first` of `starts` on. */
  symbol(lane, starts, first, alphabet) {
    const state = this.states[lane];
    const slot = state & (SLOTS - 1);
    let low = 0;
    let high = alphabet;
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (starts[first + middle] <= slot) low = middle;
      else high = middle;
    }
    const start = starts[first + low];
    this.#advance(lane, state, slot - start, starts[first + low + 1] - start);
    return low;
  }

  /** A symbol of `bits` bits that are all as likely. */
  raw(lane, bits) {
    const state = this.states[lane];
    const slot = state & (SLOTS - 1);
    const shift = 14 - bits;
    this.#advance(lane, state, slot & ((1 << shift) - 1), 1 << shift);
    return slot >> shift;
  }

  #advance(lane, state, offset, frequency) {
    let next = frequency * (state >>> 14) + offset;
    if (next < LOW) {
      need(this.at < this.end, "a stream has too few words");
      next = next * LOW + (this.data[this.at] | (this.data[this.at + 1] << 8));
      this.at += 2;
    }
    this.states[lane] = next;
  }

  finish() {
    need(this.at === this.end, "a stream has words left over");
    need(this.states.every((state) => state === LOW), "a stream ends in wrong states");
  }
}

/** Raw bits, most significant first. */
export class Bits {
  constructor(data) {
    this.data = data;
    this.at = 0;
  }

  take(count) {
    need(this.at + count <= 8 * this.data.length, "raw bits end early");
    let value = 0;
    for (let i = 0; i < count; i++, this.at++) {
      value = 2 * value + ((this.data[this.at >> 3] >> (7 - (this.at & 7))) & 1);
    }
    return value;
  }

  finish() {
    const rest = 8 * this.data.length - this.at;
    need(rest < 8 && this.take(rest) === 0, "raw bits are left over");
  }
}

/** Counts of symbols by context, and the frequencies they make (ENT-12 to ENT-14). */
class Model {
  constructor(contexts, alphabet) {
    this.alphabet = alphabet;
    this.counts = new Uint32Array(contexts * alphabet).fill(COUNT_START);
    this.sums = new Uint32Array(contexts).fill(COUNT_START * alphabet);
    this.starts = new Uint16Array(contexts * (alphabet + 1));
    for (let context = 0; context < contexts; context++) this.#renew(context);
  }

  #renew(context) {
    const { alphabet, counts, starts } = this;
    const at = context * alphabet;
    const first = context * (alphabet + 1);
    let start = 0;
    for (let s = 0; s < alphabet - 1; s++) {
      start += Math.floor(((SLOTS - alphabet) * counts[at + s]) / this.sums[context]) + 1;
      starts[first + s + 1] = start;
    }
    starts[first + alphabet] = SLOTS;
  }

  /** Learns the `count` symbols of a wavefront. */
  learn(contexts, symbols, count) {
    const { alphabet, counts, sums } = this;
    const used = new Set();
    for (let i = 0; i < count; i++) {
      counts[contexts[i] * alphabet + symbols[i]] += COUNT_STEP;
      sums[contexts[i]] += COUNT_STEP;
      used.add(contexts[i]);
    }
    for (const context of used) {
      if (sums[context] > SLOTS) {
        sums[context] = 0;
        for (let s = context * alphabet; s < (context + 1) * alphabet; s++) {
          counts[s] = (counts[s] + 1) >>> 1;
          sums[context] += counts[s];
        }
      }
      this.#renew(context);
    }
  }
}

/**
 * Values [channels, height, width] of a coded array (ENT-1); 0 where nothing is stored.
 *
 * `stored` has a byte for each position (y, x), or is null if all are stored.
 */
export function decodeArray(data, channels, height, width, bits, stored = null) {
  const high = Math.min(bits, 4);
  const alphabet = 1 << high;
  const size = height * width;
  const rans = new Rans(data);
  const present = stored ? stored.reduce((sum, bit) => sum + bit, 0) : size;
  rans.reserve(present * channels, alphabet);
  const symbols = new Int8Array(channels * size).fill(-1);
  const contexts = alphabet === 2 ? 16 : alphabet + 1;
  const model = new Model(channels * contexts, alphabet);
  const used = new Uint32Array(channels * Math.min(height, width));
  const found = new Uint8Array(used.length);

  for (let t = 0; t < width + 2 * height - 2; t++) {
    let i = 0;
    const last = Math.min(height - 1, t >> 1);
    for (let y = Math.max(0, Math.ceil((t - width + 1) / 2)); y <= last; y++) {
      const x = t - 2 * y;
      if (stored && !stored[y * width + x]) continue;
      for (let c = 0; c < channels; c++, i++) {
        const at = c * size + y * width + x;
        const left = x ? symbols[at - 1] : -1;
        const up = y ? symbols[at - width] : -1;
        const upLeft = x && y ? symbols[at - width - 1] : -1;
        const upRight = y && x < width - 1 ? symbols[at - width + 1] : -1;
        const context = c * contexts + contextOf(left, up, upLeft, upRight, alphabet);
        const symbol = rans.symbol(
          i & (rans.lanes - 1), model.starts, context * (alphabet + 1), alphabet);
        symbols[at] = symbol;
        used[i] = context;
        found[i] = symbol;
      }
    }
    model.learn(used, found, i);
  }
  rans.finish();
  return withLowBits(symbols, data.subarray(rans.end), bits - high);
}

/** ENT-10 and ENT-11; neighbours that are not known are -1. */
function contextOf(left, up, upLeft, upRight, alphabet) {
  if (alphabet === 2) {
    return (left > 0 ? 1 : 0) + (up > 0 ? 2 : 0) + (upLeft > 0 ? 4 : 0) + (upRight > 0 ? 8 : 0);
  }
  let total = 0;
  let weight = 0;
  if (left >= 0) (total += 2 * left), (weight += 2);
  if (up >= 0) (total += 2 * up), (weight += 2);
  if (upLeft >= 0) (total += upLeft), (weight += 1);
  if (upRight >= 0) (total += upRight), (weight += 1);
  return weight ? Math.floor((2 * total + weight) / (2 * weight)) : alphabet;
}

/** ENT-15 and ENT-16. */
function withLowBits(symbols, data, low) {
  const raw = new Bits(data);
  const values = new Uint8Array(symbols.length);
  for (let i = 0; i < symbols.length; i++) {
    if (symbols[i] >= 0) values[i] = (symbols[i] << low) | raw.take(low);
  }
  raw.finish();
  return values;
}

/** A mask of 1 bit that has at least one 1 and one 0, as the masks of the format must. */
export function decodeMask(data, height, width) {
  const mask = decodeArray(data, 1, height, width, 1);
  need(mask.includes(0) && mask.includes(1), "a mask has only one value");
  return mask;
}

/** Signed integers (ENT-17 to ENT-20) [channels, height, width]. */
export function decodeSigned(classes, deltas, channels, height, width) {
  const sizes = decodeArray(classes, channels, height, width, 4);
  const raw = new Bits(deltas);
  const values = Float64Array.from(sizes, (size) => {
    if (!size) return 0;
    const sign = raw.take(1) ? -1 : 1;
    if (size < 15) return sign * (2 ** (size - 1) + raw.take(size - 1));
    const magnitude = raw.take(31);
    need(magnitude >= 2 ** 14, "a signed integer has the wrong class");
    return sign * magnitude;
  });
  raw.finish();
  return values;
}

/** A small decoder of one Zstandard frame without a dictionary (RFC 8878). */

import { need, within } from "./errors.js";

const BLOCK_MAX = 2 ** 17;
const WINDOW_MAX = 2 ** 27;

const DEFAULTS = [
  { log: 6, counts: [4, 3, ...Array(11).fill(2), 1, 1, 1, ...Array(9).fill(2), 3, 2, 1, 1, 1, 1, 1,
    -1, -1, -1, -1] }, // literal lengths
  { log: 5, counts: [...Array(6).fill(1), 2, 2, 2, ...Array(15).fill(1), ...Array(5).fill(-1)] },
  { log: 6, counts: [1, 4, 3, ...Array(6).fill(2), ...Array(37).fill(1), ...Array(7).fill(-1)] },
];
const KINDS = [{ log: 9, most: 36 }, { log: 8, most: 32 }, { log: 9, most: 53 }];

/** Lengths by their code: what they begin at, by the extra bits of each code. */
function lengths(start, extra) {
  let base = start;
  return extra.map((bits) => ({ bits, base: (base += 2 ** bits) - 2 ** bits }));
}
const LITERALS = lengths(0, [
  ...Array(16).fill(0), 1, 1, 1, 1, 2, 2, 3, 3, 4, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16]);
const MATCHES = lengths(3, [
  ...Array(32).fill(0), 1, 1, 1, 1, 2, 2, 3, 3, 4, 4, 5, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16]);

/** Bits from the first byte on, the least significant first. */
class Forward {
  constructor(bytes) {
    this.bytes = bytes;
    this.at = 0;
  }

  take(count) {
    need(this.at + count <= 8 * this.bytes.length, "zstd: a table ends early");
    let value = 0;
    for (let i = 0; i < count; i++, this.at++) {
      value |= ((this.bytes[this.at >> 3] >> (this.at & 7)) & 1) << i;
    }
    return value;
  }
}

/** Bits from the last byte on, which ends with a 1; before the first byte there are zeros. */
class Backward {
  constructor(bytes) {
    need(bytes.length && bytes[bytes.length - 1], "zstd: a stream has no end mark");
    this.bytes = bytes;
    this.left = 8 * bytes.length - 1 - Math.clz32(bytes[bytes.length - 1]) + 24;
  }

  take(count) {
    let value = 0;
    for (let i = 0; i < count; i++) {
      this.left--;
      const bit = this.left < 0 ? 0 : (this.bytes[this.left >> 3] >> (this.left & 7)) & 1;
      value = 2 * value + bit;
    }
    return value;
  }
}

/** An FSE decoding table: symbols, bits and bases by state (section 4.1). */
function fseTable({ log, counts }) {
  const size = 1 << log;
  const symbols = new Uint8Array(size);
  const next = counts.map((count) => Math.abs(count));
  let high = size;
  counts.forEach((count, s) => count < 0 && (symbols[--high] = s));
  const step = (size >> 1) + (size >> 3) + 3;
  let at = 0;
  counts.forEach((count, s) => {
    for (let i = 0; i < count; i++) {
      symbols[at] = s;
      do at = (at + step) & (size - 1);
      while (at >= high);
    }
  });
  need(at === 0, "zstd: a table is not consistent");
  const bits = new Uint8Array(size);
  const bases = new Uint16Array(size);
  symbols.forEach((s, state) => {
    const n = next[s]++;
    bits[state] = log - (31 - Math.clz32(n));
    bases[state] = (n << bits[state]) - size;
  });
  return { log, symbols, bits, bases };
}

/** Reads the description of an FSE table; returns it and its bytes (section 4.1.1). */
function readFse(bytes, { log: mostLog, most }) {
  const input = new Forward(bytes);
  const log = input.take(4) + 5;
  need(log <= mostLog, "zstd: a table is too large");
  const counts = [];
  let left = 1 << log;
  while (left > 0) {
    need(counts.length < most, "zstd: a table has too many symbols");
    const width = 32 - Math.clz32(left + 1);
    const low = (1 << (width - 1)) - 1;
    const short = (1 << width) - 2 - left;
    let value = input.take(width - 1);
    if (value >= short && input.take(1)) value += low + 1 - short;
    counts.push(value - 1);
    left -= Math.abs(value - 1);
    need(left >= 0, "zstd: counts of a table exceed their sum");
    if (value !== 1) continue;
    let zeros;
    do {
      zeros = input.take(2);
      for (let i = 0; i < zeros; i++) counts.push(0);
    } while (zeros === 3);
  }
  need(counts.length <= most, "zstd: a table has too many symbols");
  return { table: fseTable({ log, counts }), used: Math.ceil(input.at / 8) };
}

/** A table of one symbol. */
const single = (symbol) => ({ log: 0, symbols: [symbol], bits: [0], bases: [0] });

/** Decodes one of the FSE states of a stream. */
class State {
  constructor(table, stream) {
    Object.assign(this, { table, stream, state: stream.take(table.log) });
  }

  get symbol() {
    return this.table.symbols[this.state];
  }

  advance() {
    this.state = this.table.bases[this.state] + this.stream.take(this.table.bits[this.state]);
  }
}

/** Reads a Huffman tree; returns its decoding table and its bytes (section 4.2.1). */
function readHuffman(bytes) {
  need(bytes.length, "zstd: a tree is missing");
  const head = bytes[0];
  const used = 1 + (head < 128 ? head : Math.ceil((head - 127) / 2));
  need(used <= bytes.length, "zstd: a tree ends early");
  const weights = [];
  if (head >= 128) {
    for (let i = 0; i < head - 127; i++) weights.push((bytes[1 + (i >> 1)] >> (i & 1 ? 0 : 4)) & 15);
  } else {
    const { table, used: at } = readFse(bytes.subarray(1, used), { log: 6, most: 256 });
    const stream = new Backward(bytes.subarray(1 + at, used));
    const states = [new State(table, stream), new State(table, stream)];
    for (let i = 0; ; i ^= 1) {
      weights.push(states[i].symbol);
      states[i].advance();
      need(weights.length < 255, "zstd: a tree has too many symbols");
      if (stream.left >= 0) continue;
      weights.push(states[i ^ 1].symbol);
      break;
    }
  }
  return { tree: huffmanTable(weights), used };
}

function huffmanTable(weights) {
  const sum = weights.reduce((total, w) => total + (w ? 2 ** (w - 1) : 0), 0);
  need(sum > 0 && sum < 2 ** 11, "zstd: a tree is not consistent");
  const log = 32 - Math.clz32(sum);
  const last = Math.log2(2 ** log - sum) + 1;
  need(Number.isInteger(last), "zstd: a tree is not complete");
  const all = [...weights, last];
  const symbols = [];
  const bits = [];
  for (let w = 1; w <= log; w++) {
    all.forEach((weight, s) => {
      for (let i = 0; weight === w && i < 2 ** (w - 1); i++) {
        symbols.push(s);
        bits.push(log + 1 - w);
      }
    });
  }
  return { log, symbols, bits };
}

function readHuffmanStream({ log, symbols, bits }, bytes, out) {
  const stream = new Backward(bytes);
  let window = stream.take(log);
  for (let i = 0; i < out.length; i++) {
    out[i] = symbols[window];
    const count = bits[window];
    window = ((window << count) & (2 ** log - 1)) | stream.take(count);
  }
  need(stream.left === -log, "zstd: a stream of literals has another length");
}

/** The literals of a block; moves `input.at` past them (section 3.1.1.3.1). */
function readLiterals(input, memory) {
  const kind = input.peek(0) & 3;
  const format = (input.peek(0) >> 2) & 3;
  if (kind < 2) {
    const width = [1, 2, 1, 3][format];
    const size = input.number(width) >> (width === 1 ? 3 : 4);
    need(size <= BLOCK_MAX, "zstd: too many literals");
    return kind ? new Uint8Array(size).fill(input.take(1)[0]) : input.take(size);
  }
  const width = [10, 10, 14, 18][format];
  const head = input.number([3, 3, 4, 5][format]);
  const size = Math.floor(head / 16) % 2 ** width;
  const packed = input.take(Math.floor(head / 2 ** (4 + width)));
  need(size <= BLOCK_MAX, "zstd: too many literals");
  let at = 0;
  if (kind === 2) {
    const { tree, used } = readHuffman(packed);
    memory.tree = tree;
    at = used;
  }
  need(memory.tree, "zstd: there is no tree to repeat");
  const out = new Uint8Array(size);
  if (!format) {
    readHuffmanStream(memory.tree, packed.subarray(at), out);
    return out;
  }
  need(at + 6 <= packed.length, "zstd: the streams of literals end early");
  const part = (size + 3) >> 2;
  let from = at + 6;
  for (let i = 0; i < 4; i++) {
    const length = packed[at + 2 * i] | (packed[at + 2 * i + 1] << 8);
    const end = i < 3 ? from + length : packed.length;
    need(end <= packed.length && i * part <= size, "zstd: the streams of literals end early");
    const to = out.subarray(i * part, i < 3 ? Math.min((i + 1) * part, size) : size);
    readHuffmanStream(memory.tree, packed.subarray(from, end), to);
    from = end;
  }
  return out;
}

/** Bytes one after the other. */
class Input {
  constructor(bytes) {
    this.bytes = bytes;
    this.at = 0;
  }

  peek(ahead) {
    need(this.at + ahead < this.bytes.length, "zstd: a frame ends early");
    return this.bytes[this.at + ahead];
  }

  take(count) {
    need(this.at + count <= this.bytes.length, "zstd: a frame ends early");
    this.at += count;
    return this.bytes.subarray(this.at - count, this.at);
  }

  number(count) {
    return this.take(count).reduceRight((value, byte) => 256 * value + byte, 0);
  }

  rest() {
    return this.take(this.bytes.length - this.at);
  }
}

/** The bytes that a frame makes, at most `size`. */
class Output {
  constructor(size, window) {
    Object.assign(this, { bytes: new Uint8Array(size), at: 0, window });
  }

  add(bytes) {
    need(this.at + bytes.length <= this.bytes.length, "zstd: a frame has more bytes than announced");
    this.bytes.set(bytes, this.at);
    this.at += bytes.length;
  }

  repeat(offset, count) {
    need(offset <= Math.min(this.at, this.window), "zstd: a match begins before its window");
    need(this.at + count <= this.bytes.length, "zstd: a frame has more bytes than announced");
    for (let i = 0; i < count; i++, this.at++) this.bytes[this.at] = this.bytes[this.at - offset];
  }
}

/** Tables of the three codes of sequences (section 3.1.1.3.2.1). */
function readTables(input, memory) {
  const modes = input.number(1);
  need(!(modes & 3), "zstd: reserved bits are set");
  KINDS.forEach((kind, k) => {
    const mode = (modes >> (6 - 2 * k)) & 3;
    if (mode === 0) memory.tables[k] = fseTable(DEFAULTS[k]);
    if (mode === 1) {
      memory.tables[k] = single(input.number(1));
      need(memory.tables[k].symbols[0] < kind.most, "zstd: a code does not exist");
    }
    if (mode === 2) {
      const { table, used } = readFse(input.bytes.subarray(input.at), kind);
      input.take(used);
      memory.tables[k] = table;
    }
    need(memory.tables[k], "zstd: there is no table to repeat");
  });
}

/** One compressed block (section 3.1.1.3). */
function readBlock(bytes, memory, output) {
  const input = new Input(bytes);
  const literals = readLiterals(input, memory);
  let count = input.number(1);
  if (count === 255) count = input.number(2) + 0x7f00;
  else if (count >= 128) count = ((count - 128) << 8) + input.number(1);
  let used = 0;
  if (count) {
    readTables(input, memory);
    const stream = new Backward(input.rest());
    const [ll, of, ml] = memory.tables.map((table) => new State(table, stream));
    for (let i = 0; i < count; i++) {
      const code = 2 ** of.symbol + stream.take(of.symbol);
      const match = MATCHES[ml.symbol].base + stream.take(MATCHES[ml.symbol].bits);
      const length = LITERALS[ll.symbol].base + stream.take(LITERALS[ll.symbol].bits);
      need(stream.left >= 0 && used + length <= literals.length, "zstd: sequences end early");
      output.add(literals.subarray(used, used + length));
      used += length;
      output.repeat(offsetOf(code, length, memory.offsets), match);
      if (i < count - 1) for (const state of [ll, ml, of]) state.advance();
    }
    need(stream.left === 0, "zstd: sequences have another length");
  }
  need(input.at === bytes.length, "zstd: a block has bytes left over");
  output.add(literals.subarray(used));
}

/** Section 3.1.1.5: offsets that repeat; `recent` are the last three. */
function offsetOf(code, length, recent) {
  const index = code > 3 ? 3 : code - 1 + (length ? 0 : 1);
  const offset = code > 3 ? code - 3 : index < 3 ? recent[index] : recent[0] - 1;
  need(offset > 0, "zstd: an offset is 0");
  if (index) recent.splice(0, 3, offset, recent[0], recent[index === 1 ? 2 : 1]);
  return offset;
}

/** The `size` bytes of a frame (CHK-16). Its checksum, if it has one, is not compared. */
export function unzstd(bytes, size) {
  const input = new Input(bytes);
  need(input.number(4) === 0xfd2fb528, "zstd: this is not a frame");
  const flags = input.number(1);
  const whole = (flags >> 5) & 1;
  need(!(flags & 8), "zstd: a reserved bit is set");
  const shape = whole ? 0 : input.number(1);
  need(!(flags & 3) || input.number([0, 1, 2, 4][flags & 3]) === 0, "zstd: a dictionary");
  const width = [whole, 2, 4, 8][flags >> 6];
  const announced = input.number(width) + (width === 2 ? 256 : 0);
  need(!width || announced === size, "zstd: a frame announces another size");
  const window = whole ? size : 2 ** (10 + (shape >> 3)) * (1 + (shape & 7) / 8);
  within(window, WINDOW_MAX, "window");
  const output = new Output(size, window);
  const memory = { tree: null, tables: [null, null, null], offsets: [1, 4, 8] };
  for (let last = 0; !last; ) {
    const head = input.number(3);
    last = head & 1;
    const kind = (head >> 1) & 3;
    const length = head >> 3;
    need(kind !== 3 && length <= BLOCK_MAX, "zstd: a block is not of a known kind or size");
    if (kind === 0) output.add(input.take(length));
    else if (kind === 1) output.add(new Uint8Array(length).fill(input.number(1)));
    else readBlock(input.take(length), memory, output);
  }
  if (flags & 4) input.take(4);
  need(input.at === bytes.length, "zstd: there are bytes after the frame");
  need(output.at === size, "zstd: a frame has fewer bytes than announced");
  return output.bytes;
}

/** Canonical MessagePack: the few forms of CON-15, and only the shortest of each. */

import { need } from "./errors.js";

const UTF8 = new TextDecoder("utf-8", { fatal: true, ignoreBOM: true });
const ITEMS_MAX = 2 ** 20;

/** Reads one value after the other. */
export class Values {
  constructor(bytes) {
    this.bytes = bytes;
    this.view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
    this.at = 0;
  }

  #skip(count) {
    need(this.at + count <= this.bytes.length, "a value runs past the end of its payload");
    this.at += count;
    return this.at - count;
  }

  #byte() {
    return this.bytes[this.#skip(1)];
  }

  /** An unsigned number of 1, 2, 4 or 8 bytes that does not fit half as many. */
  #unsigned(size, least) {
    const at = this.#skip(size);
    const value =
      size === 1 ? this.view.getUint8(at)
      : size === 2 ? this.view.getUint16(at)
      : size === 4 ? this.view.getUint32(at)
      : Number(this.view.getBigUint64(at));
    need(value >= least, "a value is not in its shortest form");
    return value;
  }

  #negative(size, most) {
    const at = this.#skip(size);
    const value =
      size === 1 ? this.view.getInt8(at)
      : size === 2 ? this.view.getInt16(at)
      : size === 4 ? this.view.getInt32(at)
      : Number(this.view.getBigInt64(at));
    need(value < most, "a value is not in its shortest form");
    return value;
  }

  /** A length: in the first byte from `fix` on, or after one of the bytes of `forms`. */
  #length(first, fix, fixed, forms) {
    if (fixed && first >= fix && first < fix + fixed) return first - fix;
    const form = forms.indexOf(first);
    need(form >= 0, "a value has the wrong type");
    // Arrays have no form of one byte of length, so their shortest is that of two.
    const size = [1, 2, 4][form];
    const below = size === 1 || (size === 2 && forms[0] === null) ? fixed : 2 ** (4 * size);
    return this.#unsigned(size, below);
  }

  /** Whether the payload is a map (CON-17), and how many items it has. */
  header() {
    const first = this.#byte();
    need(first >= 0x80 && first <= 0x9f, "a payload is neither array nor map of up to 15 items");
    return { map: first < 0x90, count: first & 15 };
  }

  int() {
    const first = this.#byte();
    if (first < 0x80) return first;
    if (first >= 0xe0) return first - 256;
    if (first >= 0xcc && first <= 0xcf) {
      return this.#unsigned(1 << (first - 0xcc), [128, 2 ** 8, 2 ** 16, 2 ** 32][first - 0xcc]);
    }
    need(first >= 0xd0 && first <= 0xd3, "a value is not an integer");
    const most = [-32, -(2 ** 7), -(2 ** 15), -(2 ** 31)][first - 0xd0];
    return this.#negative(1 << (first - 0xd0), most);
  }

  binary() {
    const length = this.#length(this.#byte(), 0, 0, [0xc4, 0xc5, 0xc6]);
    const at = this.#skip(length);
    return this.bytes.subarray(at, at + length);
  }

  string() {
    const length = this.#length(this.#byte(), 0xa0, 32, [0xd9, 0xda, 0xdb]);
    const at = this.#skip(length);
    try {
      return UTF8.decode(this.bytes.subarray(at, at + length));
    } catch {
      need(false, "a string is not UTF-8");
    }
  }

  /** Items that `read` reads. */
  array(read) {
    const length = this.#length(this.#byte(), 0x90, 16, [null, 0xdc, 0xdd]);
    need(length <= ITEMS_MAX, "an array is too long");
    need(length <= this.bytes.length - this.at, "an array runs past the end of its payload");
    return Array.from({ length }, read);
  }

  end() {
    need(this.at === this.bytes.length, "a payload goes on after its last value");
  }
}

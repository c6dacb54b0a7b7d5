/** Writes PNG files under Node. */

import { deflateSync } from "node:zlib";
import { crc32 } from "./pxi/container.js";

function chunk(kind, payload) {
  const body = Buffer.concat([Buffer.from(kind, "latin1"), payload]);
  const out = Buffer.alloc(body.length + 8);
  out.writeUInt32BE(payload.length, 0);
  body.copy(out, 4);
  out.writeUInt32BE(crc32(body), body.length + 4);
  return out;
}

/** The bytes of a picture {width, height, channels, data} of 0..1, with 8 or 16 bits a sample. */
export function encodePng({ width, height, channels, data }, bits) {
  const size = bits / 8;
  const row = width * channels * size;
  const raw = Buffer.alloc(height * (row + 1));
  const top = 2 ** bits - 1;
  for (let y = 0, from = 0; y < height; y++) {
    let to = y * (row + 1) + 1;
    for (let i = 0; i < width * channels; i++, from++, to += size) {
      const value = Math.round(data[from] * top);
      if (size === 1) raw[to] = value;
      else raw.writeUInt16BE(value, to);
    }
  }
  const head = Buffer.alloc(13);
  head.writeUInt32BE(width, 0);
  head.writeUInt32BE(height, 4);
  head.set([bits, channels === 4 ? 6 : 2], 8);
  return Buffer.concat([
    Buffer.from([0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a]),
    chunk("IHDR", head),
    chunk("IDAT", deflateSync(raw)),
    chunk("IEND", Buffer.alloc(0)),
  ]);
}

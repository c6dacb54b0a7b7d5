/** Writes PNG files, in browsers and under Node. */

import { crc32 } from "./pxi/container.js";

async function deflated(bytes) {
  const stream = new Blob([bytes]).stream().pipeThrough(new CompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

/** The same, not packed, in no time. */
function stored(bytes) {
  const most = 65535;
  const blocks = Math.max(Math.ceil(bytes.length / most), 1);
  const out = new Uint8Array(bytes.length + 5 * blocks + 6);
  out.set([0x78, 0x01]);
  let to = 2;
  let [a, b] = [1, 0]; // Adler-32
  for (let k = 0; k < blocks; k++) {
    const block = bytes.subarray(k * most, (k + 1) * most);
    const { length } = block;
    out.set([k === blocks - 1 ? 1 : 0, length & 255, length >> 8, ~length & 255, (~length >> 8) & 255], to);
    out.set(block, to + 5);
    to += 5 + length;
    for (let i = 0; i < length; ) { // sums of so many bytes are exact
      for (const end = Math.min(i + 4096, length); i < end; i++) b += a += block[i];
      a %= 65521;
      b %= 65521;
    }
  }
  new DataView(out.buffer).setUint16(to, b);
  new DataView(out.buffer).setUint16(to + 2, a);
  return out;
}

function chunk(kind, payload) {
  const out = new Uint8Array(payload.length + 12);
  const view = new DataView(out.buffer);
  view.setUint32(0, payload.length);
  out.set(new TextEncoder().encode(kind), 4);
  out.set(payload, 8);
  view.setUint32(payload.length + 8, crc32(out.subarray(4, payload.length + 8)));
  return out;
}

/** Rows without a filter; samples of 16 bits have their high byte first. */
function rowsOf({ width, height, channels, data }, kept) {
  const wide = data.BYTES_PER_ELEMENT === 2;
  const length = 1 + width * kept * data.BYTES_PER_ELEMENT;
  const raw = new Uint8Array(height * length);
  for (let y = 0, from = 0; y < height; y++) {
    for (let x = 0, to = y * length + 1; x < width; x++, from += channels) {
      for (let c = 0; c < kept; c++) {
        const value = data[from + c];
        if (wide) raw[to++] = value >> 8;
        raw[to++] = value;
      }
    }
  }
  return raw;
}

/**
 * The bytes of a picture {width, height, channels, opaque, data} of 8 or 16 bits a sample (Uint8ClampedArray,
 * Uint16Array); without alpha if it is opaque. `icc` is a profile, `cicp` two code points of H.273.
 * `packed: false` makes a large file at once.
 */
export async function encodePng(picture, { icc, cicp, packed = true } = {}) {
  const { width, height, channels, opaque, data } = picture;
  const kept = opaque ? 3 : channels;
  const head = new Uint8Array(13);
  new DataView(head.buffer).setUint32(0, width);
  new DataView(head.buffer).setUint32(4, height);
  head.set([8 * data.BYTES_PER_ELEMENT, kept === 4 ? 6 : 2], 8);
  const chunks = [chunk("IHDR", head)];
  if (cicp) chunks.push(chunk("cICP", Uint8Array.of(...cicp, 0, 1)));
  if (icc) chunks.push(chunk("iCCP", Uint8Array.of(112, 0, 0, ...(await deflated(icc)))));
  const rows = rowsOf(picture, kept);
  chunks.push(chunk("IDAT", packed ? await deflated(rows) : stored(rows)), chunk("IEND", new Uint8Array()));
  const signature = Uint8Array.of(137, 80, 78, 71, 13, 10, 26, 10);
  return new Uint8Array(await new Blob([signature, ...chunks]).arrayBuffer());
}

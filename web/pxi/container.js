/** Chapter 2: the prefix, and chunks with their checksums and order. */

import { need, supported, within } from "./errors.js";

const SIGNATURE = [0x89, 0x50, 0x58, 0x49, 0x0d, 0x0a, 0x1a, 0x0a];
const CRITICAL = ["HEAD", "LAYR", "MESH", "POSE", "NETW", "PLAN", "TEXR"];
const ANCILLARY = ["iCCp", "eXIf", "xMPd", "cICp", "iNFO", "tREE", "mOTN", "uNDO"];

const CRC = Uint32Array.from({ length: 256 }, (_, n) => {
  for (let k = 0; k < 8; k++) n = n & 1 ? 0xedb88320 ^ (n >>> 1) : n >>> 1;
  return n;
});

/** CRC-32 of bytes (CON-6). */
export function crc32(bytes) {
  let crc = 0xffffffff;
  for (let i = 0; i < bytes.length; i++) crc = CRC[(crc ^ bytes[i]) & 255] ^ (crc >>> 8);
  return (crc ^ 0xffffffff) >>> 0;
}

/** All chunks of a file as {kind, payload}, checked up to CON-13. */
export function readChunks(data, limits) {
  limits.spend("file_bytes", data.length);
  need(data.length >= 12, "the file is shorter than its prefix");
  need(SIGNATURE.every((byte, i) => data[i] === byte), "this is not a .pxi file");
  supported(data[8] === 0 && [1, 2, 3, 9, 10, 11, 12].includes(data[9]), `version ${data[8]}.${data[9]}`);
  need(data[10] === 0 && data[11] === 0, "the reserved field is not 0");
  const view = new DataView(data.buffer, data.byteOffset, data.byteLength);
  const chunks = [];
  let at = 12;
  while (at < data.length) {
    within(chunks.length + 1, limits.chunks, "chunks");
    need(at + 12 <= data.length, `the file ends in a chunk at offset ${at}`);
    const kind = String.fromCharCode(...data.subarray(at, at + 4));
    need(/^[A-Za-z]{2}[A-Z][A-Za-z]$/.test(kind), `bad chunk type at offset ${at}`);
    const end = at + 8 + view.getUint32(at + 4, true);
    need(end + 4 <= data.length && end - at - 8 < 2 ** 31, `${kind} runs past the end of the file`);
    const crc = crc32(data.subarray(at, end));
    need(view.getUint32(end, true) === crc, `the CRC of ${kind} at offset ${at} is wrong`);
    chunks.push({ kind, payload: data.subarray(at + 8, end), minor: data[9] });
    at = end + 4;
    if (kind === "TAIL") break;
  }
  need(at === data.length, "the file goes on after TAIL");
  checkOrder(chunks);
  return chunks;
}

/** CON-9 and CON-11 to CON-13. */
function checkOrder(chunks) {
  need(chunks.length > 1 && chunks[0].kind === "HEAD", "the first chunk is not HEAD");
  const tail = chunks[chunks.length - 1];
  need(tail.kind === "TAIL" && tail.payload.length === 0, "the last chunk is not an empty TAIL");
  const seen = new Set();
  let rank = 0;
  for (const { kind } of chunks.slice(0, -1)) {
    const critical = CRITICAL.indexOf(kind);
    const ancillary = ANCILLARY.includes(kind);
    if (critical < 0 && !ancillary) {
      supported(kind[0] >= "a", `critical chunk ${kind}`);
      continue;
    }
    const next = ancillary ? CRITICAL.length : critical;
    need(next >= rank, `${kind} stands too late`);
    need(!seen.has(kind) || (critical > 0), `there is a second ${kind}`);
    seen.add(kind);
    rank = next;
  }
}

#!/usr/bin/env node
/**
 * Decodes a .pxi file to PNG under Node: `node web/decode.mjs IN.pxi OUT.png [flags]`.
 *
 * Flags and exit codes are those of conformance/README.md, and those of `pxi-decode`.
 */

import { createHash } from "node:crypto";
import { readFileSync, rmSync, writeFileSync } from "node:fs";
import { createInterface } from "node:readline";
import { parseArgs } from "node:util";
import { encodePng } from "./png.mjs";
import { Image, MODEL_FILES, PxiError, render } from "./pxi/index.js";

const USAGE = `usage: node web/decode.mjs IN.pxi OUT.png [--width N] [--height N] [--scale S]
         [--region X,Y,W,H] [--time S] [--layer NAME].. [--no-background] [--bit-depth 8|16]
       node web/decode.mjs --latents IN.pxi
       node web/decode.mjs --batch`;
const EXIT = { usage: 2, io: 3, invalid: 4, unsupported: 5, limit: 6 };
const OPTIONS = {
  width: { type: "string" }, height: { type: "string" }, scale: { type: "string" },
  region: { type: "string" }, time: { type: "string" }, "bit-depth": { type: "string" },
  layer: { type: "string", multiple: true }, "no-background": { type: "boolean" },
  latents: { type: "boolean" }, batch: { type: "boolean" },
};

class UsageError extends Error {}

function number(text, pattern, name) {
  if (!pattern.test(text)) throw new UsageError(`--${name} ${text}: not a number of that kind`);
  return Number(text);
}

const COUNT = /^[1-9][0-9]{0,8}$/;
const DECIMAL = /^[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]+)?$/;

/** The nearest integer, ties to even, at least 1. */
function nearest(value) {
  const low = Math.floor(value);
  const up = value - low > 0.5 || (value - low === 0.5 && low % 2 === 1);
  return Math.max(low + up, 1);
}

/** What `render` needs, from the flags. */
function view(image, flags) {
  const region = (flags.region ?? `0,0,${image.width},${image.height}`).split(",").map((part) => {
    return number(part, /^[0-9]{1,8}$/, "region");
  });
  const [x, y, w, h] = region;
  const inside = region.length === 4 && x + w <= image.width && y + h <= image.height;
  if (!inside || w < 1 || h < 1) throw new UsageError("--region is not in the canvas");
  let width = flags.width && number(flags.width, COUNT, "width");
  let height = flags.height && number(flags.height, COUNT, "height");
  const scale = flags.scale ? number(flags.scale, DECIMAL, "scale") : 1;
  if (!(scale > 0)) throw new UsageError("--scale is not positive");
  if (width) height ??= nearest((h * width) / w);
  else if (height) width = nearest((w * height) / h);
  else [width, height] = [nearest(w * scale), nearest(h * scale)];
  const time = flags.time === undefined ? null : number(flags.time, DECIMAL, "time");
  if (time !== null && !image.motion) throw new UsageError("--time: this file has no motion");
  return {
    region, width, height, drawn: layers(image, flags),
    time: time === null ? null : Math.round(time * 1e6),
  };
}

function layers(image, flags) {
  const names = flags.layer;
  for (const name of names ?? []) {
    if (!image.names.some((l) => l.name === name)) throw new UsageError(`no layer ${name}`);
  }
  return image.names.flatMap(({ name, hidden }, k) => {
    const wanted = names ? names.includes(name) : !hidden;
    return wanted && !(k === 0 && flags["no-background"] && image.head.opaque) ? [k] : [];
  });
}

/** SHA-256 of all latents (PYR-29). */
function digest(image) {
  const hash = createHash("sha256");
  image.plans.forEach((_, number) => {
    const { lowest, levels } = image.latents(number);
    const planes = [...lowest, ...levels.reverse().flatMap((level) => level.latents)];
    for (const p of planes) hash.update(new Uint8Array(p.buffer, p.byteOffset, p.byteLength));
  });
  return hash.digest("hex");
}

/** Runs one command line; returns its exit code. Nothing is written unless that is 0. */
async function run(words) {
  let output = null;
  try {
    const { values: flags, positionals } = parse(words);
    if (positionals.length !== (flags.latents ? 1 : 2)) throw new UsageError(USAGE);
    const bits = flags["bit-depth"] ?? "8";
    if (!["8", "16"].includes(bits)) throw new UsageError("--bit-depth must be 8 or 16");
    const bytes = new Uint8Array(readFileSync(positionals[0]));
    const image = await Image.open(bytes, async (model) => readFileSync(MODEL_FILES[model]));
    if (flags.latents) {
      console.log(digest(image));
      return 0;
    }
    const png = encodePng(render(image, view(image, flags)), Number(bits));
    output = positionals[1];
    writeFileSync(output, png);
    return 0;
  } catch (error) {
    if (output) rmSync(output, { force: true });
    return explain(error);
  }
}

function parse(words) {
  // A negative time would be taken for a flag.
  const args = words.flatMap((word, i) =>
    word === "--time" ? [`--time=${words[i + 1]}`] : words[i - 1] === "--time" ? [] : [word]);
  try {
    return parseArgs({ args, options: OPTIONS, allowPositionals: true });
  } catch (error) {
    throw new UsageError(`${error.message}\n${USAGE}`);
  }
}

function explain(error) {
  console.error(error instanceof PxiError ? `${error.kind}: ${error.message}` : error.message);
  if (error instanceof PxiError) return EXIT[error.kind];
  if (error instanceof UsageError) return EXIT.usage;
  if (error instanceof RangeError) return EXIT.limit; // arrays that do not fit into memory
  if (error.code && error.syscall) return EXIT.io;
  throw error;
}

/** One run for each line of standard input, a JSON array of words; answers with exit codes. */
async function batch() {
  for await (const line of createInterface({ input: process.stdin })) {
    console.log(await run(JSON.parse(line)));
  }
}

const words = process.argv.slice(2);
if (words[0] === "--batch") await batch();
else process.exitCode = await run(words);

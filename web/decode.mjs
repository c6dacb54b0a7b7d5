#!/usr/bin/env node
/**
 * Decodes a .pxi file to PNG under Node: `node web/decode.mjs IN.pxi OUT.png [flags]`.
 *
 * Flags and exit codes are those of conformance/README.md, and those of `pxi-decode`. `--wasm` takes the decoder
 * of pxi-wasm/; `--latents` is of the plain one.
 */

import { createHash } from "node:crypto";
import { readFileSync, rmSync, writeFileSync } from "node:fs";
import { createInterface } from "node:readline";
import { parseArgs } from "node:util";
import { encodePng } from "./png.js";
import { MODEL_FILES, PxiError } from "./pxi/index.js";

const USAGE = `usage: node web/decode.mjs IN.pxi OUT.png [--width N] [--height N] [--scale S]
         [--region X,Y,W,H] [--time S] [--layer NAME|INDEX].. [--no-background] [--bit-depth 8|16] [--wasm]
       node web/decode.mjs --latents IN.pxi
       node web/decode.mjs --batch`;
const EXIT = { usage: 2, io: 3, invalid: 4, unsupported: 5, limit: 6 };
const OPTIONS = {
  width: { type: "string" }, height: { type: "string" }, scale: { type: "string" },
  region: { type: "string" }, time: { type: "string" }, "bit-depth": { type: "string" },
  layer: { type: "string", multiple: true }, "no-background": { type: "boolean" },
  wasm: { type: "boolean" }, latents: { type: "boolean" }, batch: { type: "boolean" },
};

class UsageError extends Error {}

function number(text, pattern, name) {
  if (!pattern.test(text)) throw new UsageError(`--${name} ${text}: not a number of that kind`);
  return Number(text);
}

const COUNT = /^[1-9][0-9]{0,8}$/;
const DECIMAL = /^[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]+)?$/;

/** Options of `render`, from the flags. */
function view(flags) {
  const whole = (name) => flags[name] && number(flags[name], COUNT, name);
  const decimal = (name) => flags[name] && number(flags[name], DECIMAL, name);
  return {
    t: decimal("time"), width: whole("width"), height: whole("height"), scale: decimal("scale"),
    region: flags.region?.split(",").map((part) => number(part, /^[0-9]{1,8}$/, "region")),
    layers: flags.layer?.map((key) => (/^-?[0-9]{1,9}$/.test(key) ? Number(key) : key)),
    background: !flags["no-background"],
  };
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

const weights = new Map();
let kept = { key: null }; // what was opened last: several views of a file are asked for one after the other

/** A model's bytes, read once. */
async function load(model) {
  if (!weights.has(model)) weights.set(model, readFileSync(MODEL_FILES[model]));
  return weights.get(model);
}

/** The picture of a file, and the function that draws it. */
async function opened(path, wasm) {
  const key = `${wasm} ${path}`;
  if (kept.key === key) return kept;
  const bytes = new Uint8Array(readFileSync(path));
  const { Image, render } = await import(wasm ? "./pxi-wasm/index.js" : "./pxi/index.js");
  return (kept = { key, image: await Image.open(bytes, load), render });
}

/** Runs one command line; returns its exit code. Nothing is written unless that is 0. */
async function run(words) {
  let output = null;
  try {
    const { values: flags, positionals } = parse(words);
    if (positionals.length !== (flags.latents ? 1 : 2)) throw new UsageError(USAGE);
    const bits = flags["bit-depth"] ?? "8";
    if (!["8", "16"].includes(bits)) throw new UsageError("--bit-depth must be 8 or 16");
    const { image, render } = await opened(positionals[0], Boolean(flags.wasm && !flags.latents));
    if (image.plain) throw new UsageError("WebAssembly is not there: make -C libpxi/wasm");
    if (flags.latents) {
      console.log(digest(image));
      return 0;
    }
    const png = await encodePng(render(image, { ...view(flags), dtype: `uint${bits}` }));
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

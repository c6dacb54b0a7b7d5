/**
 * Answers requests to draw a file: `node requests.mjs FILE`, one JSON object of options a line.
 *
 * Each answer is a line of JSON: {kind} of a refusal, or {shape, data}.
 */

import { readFileSync } from "node:fs";
import { Image, MODEL_FILES, PxiError, render } from "../../web/pxi/index.js";

const SPECIAL = { "<nan>": NaN, "<inf>": Infinity };

const bytes = new Uint8Array(readFileSync(process.argv[2]));
const image = await Image.open(bytes, async (model) => readFileSync(MODEL_FILES[model]));

function answer(line) {
  const options = JSON.parse(line, (_, value) => SPECIAL[value] ?? value);
  let drawn = 0;
  options.progress = (pixels) => (drawn += pixels);
  try {
    const { width, height, channels, data } = render(image, options);
    return { shape: [height, width, channels], data: [...data], drawn };
  } catch (error) {
    if (!(error instanceof PxiError)) throw error;
    return { kind: error.kind, message: error.message };
  }
}

for (const line of readFileSync(0, "utf8").trim().split("\n")) {
  console.log(JSON.stringify(answer(line)));
}

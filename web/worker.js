/** Decodes beside the page, so that it stays alive. Answers {id, ..} or {id, error, kind}. */

import { Image, MODEL_FILES, PxiError, render } from "./pxi/index.js";

let image = null;

async function loadModel(model) {
  const answer = await fetch(MODEL_FILES[model]);
  if (!answer.ok) throw new Error(`${MODEL_FILES[model]}: ${answer.status}`);
  return new Uint8Array(await answer.arrayBuffer());
}

const tasks = {
  async open({ bytes }) {
    image = await Image.open(new Uint8Array(bytes), loadModel);
    const { width, height, names, motion } = image;
    return { width, height, layers: names, duration: motion ? motion.duration / 1000 : 0 };
  },

  async render({ region, width, height, layers, t }) {
    if (!layers.length) {
      return { width, height, pixels: new Uint8ClampedArray(4 * width * height) };
    }
    return bytesOf(render(image, { region, width, height, layers, t, dtype: "uint8" }));
  },
};

/** RGBA of 8 bits. */
function bytesOf({ width, height, channels, data }) {
  const pixels = new Uint8ClampedArray(4 * width * height).fill(255);
  for (let i = 0, from = 0; i < pixels.length; i += 4, from += channels) {
    for (let c = 0; c < channels; c++) pixels[i + c] = data[from + c];
  }
  return { width, height, pixels };
}

onmessage = async ({ data: { id, task, ...request } }) => {
  try {
    const answer = await tasks[task](request);
    postMessage({ id, ...answer }, answer.pixels ? [answer.pixels.buffer] : []);
  } catch (error) {
    const kind = error instanceof PxiError ? error.kind : "error";
    postMessage({ id, error: error.message, kind });
  }
};

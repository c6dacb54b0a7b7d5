/** What beside.js asks for: {id, task, ..} is answered by {id, answer}, {id, share} or {id, error, ..}. */

import { Image, PxiError, prepare, render } from "./index.js";

prepare(); // while the file comes
let image = null;

async function encodePng(...given) {
  return (await import("../png.js")).encodePng(...given);
}

/** What PNG files say of the colours of the picture. */
function colours() {
  const icc = image.metadata.find(({ kind }) => kind === "icc")?.bytes;
  return { icc, cicp: image.primaries && [image.primaries, image.transfer] };
}

const tasks = {
  async open({ bytes, limits, plain }, progress) {
    image = await Image.open(bytes, undefined, limits, { progress, plain });
    const { width, height, names, motion, metadata } = image;
    return { width, height, names, motion, metadata };
  },

  async render({ options }, progress) {
    return render(image, { ...options, progress });
  },

  /** Browsers know how to show the colours of a PNG file: so those that are not sRGB become one. */
  async bitmap({ options }, progress) {
    const found = render(image, { ...options, dtype: "uint8", progress });
    const { icc, cicp } = colours();
    if (!icc && !cicp) return createImageBitmap(new ImageData(found.data, found.width, found.height));
    const png = await encodePng(found, { icc, cicp, packed: false });
    return createImageBitmap(new Blob([png], { type: "image/png" }));
  },

  async png({ options }, progress) {
    return encodePng(render(image, { dtype: "uint8", ...options, progress }), colours());
  },
};

let last = Promise.resolve();

async function answer({ id, task, wants, ...request }) {
  try {
    const progress = wants ? (share) => postMessage({ id, share }) : undefined;
    const found = await tasks[task](request, progress);
    const moved = [found.data?.buffer, found].filter((part) => part instanceof ArrayBuffer || isBitmap(part));
    postMessage({ id, answer: found }, moved);
  } catch (error) {
    const { message, rule, offset } = error;
    postMessage({ id, error: message, kind: error instanceof PxiError ? error.kind : null, rule, offset });
  }
}

function isBitmap(part) {
  return typeof ImageBitmap === "function" && part instanceof ImageBitmap;
}

// One after the other, as opening waits for the module and models.
onmessage = ({ data }) => {
  last = last.then(() => answer(data));
};

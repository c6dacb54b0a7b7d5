/**
 * Runs ONNX models in WebAssembly: `node onnx.mjs FOLDER`.
 *
 * jobs.json in FOLDER is an array of [model, inputs, output]: files there. Inputs are float64, the
 * two of pixel_size and then those of points; the output, float32, is written.
 */

import { readFileSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import * as ort from "onnxruntime-web/wasm";

ort.env.wasm.numThreads = 1;
const folder = process.argv[2];
const read = (name) => readFileSync(join(folder, name));

for (const [model, inputs, output] of JSON.parse(read("jobs.json"))) {
  const session = await ort.InferenceSession.create(new Uint8Array(read(model)));
  const numbers = new Float64Array(new Uint8Array(read(inputs)).buffer);
  const points = numbers.subarray(2);
  const { colour } = await session.run({
    points: new ort.Tensor("float64", points, [points.length / 2, 2]),
    pixel_size: new ort.Tensor("float64", numbers.subarray(0, 2), [2]),
  });
  writeFileSync(join(folder, output), colour.data);
  await session.release();
}

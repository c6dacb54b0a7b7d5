/** Default limits (SEC-2), and what is spent of them. */
import { within } from "./errors.js";

export const LIMITS = Object.freeze({
  file_bytes: 2 ** 30,
  chunks: 2 ** 16,
  side: 2 ** 20,
  layers: 2 ** 10,
  networks: 2 ** 6,
  segments: 2 ** 16,
  gates: 2 ** 16,
  faces: 2 ** 18,
  overlap: 64,
  beyond: 2 ** 28,
  codes: 2 ** 24,
  samples: 2 ** 26,
  filled: 2 ** 27,
  covered: 2 ** 31,
  wavefronts: 2 ** 17,
  motion: 2 ** 22,
  parameters: 2 ** 22,
  metadata_bytes: 2 ** 26,
  references: 2 ** 20,
  output_pixels: 2 ** 28,
  multiply_adds: 2 ** 43,
  work: 2 ** 30,
});

/** Limits, and what one file, or one picture that is drawn, has spent of each. */
export class Budget {
  constructor(limits) {
    Object.assign(this, limits, { spent: {} });
  }

  spend(name, amount) {
    this.spent[name] = (this.spent[name] ?? 0) + amount;
    within(this.spent[name], this[name], name);
  }
}

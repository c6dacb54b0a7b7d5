/** Default limits (SEC-2), and what is spent of them. */
import { within } from "./errors.js";

const SMALL_FILE = 2 ** 20;

export const LIMITS = Object.freeze({
  file_bytes: 2 ** 30,
  chunks: 2 ** 16,
  side: 2 ** 20,
  layers: 2 ** 10,
  networks: 2 ** 6,
  segments: 2 ** 16,
  gates: 2 ** 16,
  small_gates: 2 ** 15,
  faces: 2 ** 18,
  overlap: 64,
  beyond: 2 ** 28,
  codes: 2 ** 24,
  small_codes: 2 ** 23,
  samples: 2 ** 26,
  small_samples: 2 ** 24,
  filled: 2 ** 27,
  covered: 2 ** 31,
  wavefronts: 2 ** 17,
  motion: 2 ** 22,
  parameters: 2 ** 22,
  metadata_bytes: 2 ** 26,
  references: 2 ** 20,
  output_pixels: 2 ** 28,
  multiply_adds: 2 ** 43,
  work: 2 ** 28,
});

/** What a sample of a layer, or of a face, counts as in multiplications. */
export const SAMPLE_COST = 2 ** 10;

/** What a feature of an anchor counts as likewise, for each sample. */
export const ANCHOR_COST = 2 ** 7;

/** Limits, and what one file, or one picture that is drawn, has spent of each. */
export class Budget {
  /** Of another budget, all that it began with. */
  constructor(limits) {
    Object.assign(this, limits, { spent: {} });
  }

  spend(name, amount) {
    this.spent[name] = (this.spent[name] ?? 0) + amount;
    within(this.spent[name], this[name], name);
    const small = this.spent.file_bytes <= SMALL_FILE && `small_${name}`;
    if (small in this) within(this.spent[name], this[small], small);
  }
}

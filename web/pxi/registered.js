/** Chapter 8, "Model": where the weights are. */

/** Files of the registered models (PYR-35), relative to this module. */
const FIRST = new URL("../../proxyimg_codec/models/pyramid-1.bin", import.meta.url);
export const MODEL_FILES = { 1: FIRST, 2: FIRST };

/** A decoder of .pxi files. */

export { PxiError } from "./errors.js";
export { Image } from "./image.js";
export { LIMITS } from "./limits.js";
export { MODEL_FILES } from "./registered.js";
export { render } from "./render.js";

/** `<pxi-image src layers time alt>`. */

import type { Picture } from "./beside.js";

export class PxiImage extends HTMLElement {
  /** The picture that is shown, or null. */
  picture: Picture | null;
}
declare global {
  interface HTMLElementTagNameMap {
    "pxi-image": PxiImage;
  }
}

/** Pictures that a worker decodes beside the page. */

import type { Description, Limits, Rendered, RenderOptions, Samples, Stopping, View } from "./index.js";

export interface Picture extends Description {}
export class Picture {
  static open(
    source: string | URL | Blob | ArrayBuffer | Uint8Array,
    options?: Stopping & { limits?: Limits; plain?: boolean },
  ): Promise<Picture>;
  render<T extends keyof Samples = "uint8">(options?: RenderOptions<T>): Promise<Rendered<T>>;
  /** The same as ImageBitmap, its colours as its profile tells. */
  bitmap(options?: View & Stopping): Promise<ImageBitmap>;
  /** The same as bytes of a PNG file, with the profile. */
  png(options?: RenderOptions<"uint8" | "uint16">): Promise<Uint8Array>;
  /** Gives a coarse bitmap first, then the whole one. */
  show(
    options: View & Stopping & { width: number; height: number },
    show: (bitmap: ImageBitmap, coarse: boolean) => void,
  ): Promise<void>;
  /** Ends the worker and gives its memory up; the next call starts another one. */
  close(): void;
}

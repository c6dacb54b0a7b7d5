/** A decoder of .pxi files: libpxi as WebAssembly, or the plain decoder where there is none. */

/** Why a file or a request is refused. */
export class PxiError extends Error {
  kind: "usage" | "io" | "invalid" | "unsupported" | "limit";
  /** Id of the rule that a file breaks, such as "CON-7", or "". */
  rule?: string;
  /** Of the chunk in the file that is wrong, in bytes; -1 if that is not known. */
  offset?: number;
}

/** Limits by their names in chapter 13 of the specification, such as `output_pixels`. */
export type Limits = Record<string, number>;
/** Where the registered models are. */
export const MODEL_FILES: Readonly<Record<number, URL>>;
/** Begins to fetch and compile the decoder, before there is a file. */
export function prepare(): void;
/** The bytes of a registered model, fetched or read once. */
export function loadModel(model: number): Promise<Uint8Array>;

export interface Stopping {
  /** Stops the call, which then throws the reason of the signal. */
  signal?: AbortSignal;
  /** Told the share that is done, 0..1. */
  progress?: (share: number) => void;
}

export interface Description {
  /** Of the canvas in pixels. */
  readonly width: number;
  readonly height: number;
  /** Layers from back to front; hidden ones are drawn only when they are asked for. */
  readonly names: readonly { name: string; hidden: boolean }[];
  /** Milliseconds and frames a second of the motion; null if the picture is still. */
  readonly motion: { duration: number; fps?: number } | null;
  /** Blocks of the kinds "icc", "exif" and "xmp"; none where the plain decoder reads the file. */
  readonly metadata: readonly { kind: string; bytes: Uint8Array }[];
  /** Colour by the code points of ITU-T H.273; 0: not said, sRGB. */
  readonly primaries?: number;
  readonly transfer?: number;
}

export interface OpenOptions extends Stopping {
  /** Whether the plain decoder reads the file; by default, where there is no WebAssembly with SIMD. */
  plain?: boolean;
}

export interface Image extends Description {}
export class Image {
  static open(
    bytes: Uint8Array | ArrayBuffer,
    load?: (model: number) => Promise<Uint8Array>,
    limits?: Limits,
    options?: OpenOptions,
  ): Promise<Image>;
  /** Whether the plain decoder draws it. */
  get plain(): boolean;
}

export interface View {
  /** [x, y, width, height] in canvas pixels; by default the canvas. */
  region?: [number, number, number, number] | null;
  /** Of the output; one of them keeps the aspect ratio, none is the size of the region. */
  width?: number | null;
  height?: number | null;
  /** Instead of these: output pixels a canvas pixel. */
  scale?: number | null;
  /** Names and positions of layers; by default all that are not hidden. */
  layers?: (string | number)[] | null;
  /** Whether to draw the back layer of an opaque picture; true by default. */
  background?: boolean;
  /** Seconds; null is the picture at rest. */
  t?: number | null;
  limits?: Limits;
  /** Whether a small picture may be less exact than it could be, to be there at once; the plain decoder draws all. */
  draft?: boolean;
}
export type Samples = { uint8: Uint8ClampedArray; uint16: Uint16Array; float32: Float32Array };
export interface RenderOptions<T extends keyof Samples = "uint8"> extends View, Stopping {
  dtype?: T;
}

export interface Rendered<T extends keyof Samples = "uint8"> {
  width: number;
  height: number;
  channels: 4;
  /** Whether all alphas are 1. */
  opaque: boolean;
  /** Straight RGBA, row by row; floats are in 0..1. */
  data: Samples[T];
}

export function render<T extends keyof Samples = "uint8">(image: Image, options?: RenderOptions<T>): Rendered<T>;

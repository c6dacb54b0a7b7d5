/** Writes PNG files, in browsers and under Node. */

export function encodePng(
  picture: {
    width: number;
    height: number;
    channels: 3 | 4;
    opaque?: boolean;
    data: Uint8ClampedArray | Uint16Array;
  },
  options?: { icc?: Uint8Array; cicp?: [primaries: number, transfer: number]; packed?: boolean },
): Promise<Uint8Array>;

/**
 * Why a file is refused: `kind` is "invalid", "unsupported" or "limit" (spec, "Errors"); or why a
 * request to draw it is: "usage" or "limit".
 */
export class PxiError extends Error {
  constructor(kind, message) {
    super(message);
    this.name = "PxiError";
    this.kind = kind;
  }
}

/** Refuses the file as invalid unless `ok`. */
export function need(ok, message) {
  if (!ok) throw new PxiError("invalid", message);
}

/** Refuses the file as unsupported unless `ok`. */
export function supported(ok, message) {
  if (!ok) throw new PxiError("unsupported", message);
}

/** Refuses what exceeds a limit. */
export function within(value, limit, name) {
  if (!(value <= limit)) throw new PxiError("limit", `${name}: ${value} exceeds ${limit}`);
}

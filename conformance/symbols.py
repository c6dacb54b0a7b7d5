"""SHA-256 of the latents of a file's planes: ``python -m conformance.symbols FILE``."""

from __future__ import annotations

import hashlib
import sys
from pathlib import Path

import numpy as np

from proxyimg_codec import errors, from_bytes


def digest(data: bytes) -> str:
    """SHA-256 of the latents of a file, in hexadecimal [PYR-29]; empty if it has no planes.

    Raises:
        PxiError: The file cannot be read, or a stream is corrupt.
    """
    planes = from_bytes(data).planes
    hashed = hashlib.sha256()
    for levels, lowest in (source.latents for source in planes):
        for values in (lowest, *reversed(levels)):
            hashed.update(np.ascontiguousarray(values, "<i4").tobytes())
    return hashed.hexdigest() if planes else ""


def main() -> int:
    """Entry point; returns the exit code."""
    try:
        print(digest(Path(sys.argv[1]).read_bytes()))
    except errors.PxiError as error:
        print(error, file=sys.stderr)
        return error.exit_code
    return 0


if __name__ == "__main__":
    sys.exit(main())

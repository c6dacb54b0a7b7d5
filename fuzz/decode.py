"""Fuzz target of the decoder: valid files are drawn and saved, others are refused.

A saved file must draw alike. `pxi-validate` must agree with the decoder on whether a file is valid.
"""

from __future__ import annotations

import contextlib
import logging
import warnings
import zlib
from typing import Any

import numpy as np

from fuzz import run

with run.imports(__name__):
    from proxyimg_codec import from_bytes
    from proxyimg_codec.api import Image
    from proxyimg_codec.errors import FormatError, LimitError, PxiError, UnsupportedError
    from proxyimg_codec.limits import Limits
    from proxyimg_codec.validation import validate
    from proxyimg_codec.validation.warnings import ERROR

LIMITS = Limits(
    chunks=256, side=1 << 16, layers=16, networks=4, segments=512, gates=512, faces=1024,
    overlap=8, beyond=1 << 16, codes=1 << 14, samples=1 << 14, filled=1 << 14, covered=1 << 16,
    wavefronts=1024, motion=1 << 12, parameters=1 << 14, metadata_bytes=1 << 14,
    references=1 << 10, output_pixels=1 << 14,
)  # fmt: skip
"""Limits that are so low that no input takes long."""

logging.disable()

SIDE = 24
"""Largest width and height that are drawn, in pixels."""


def drawn(image: Image, **options: Any) -> Any:
    """Draws an image at a small size; None if that exceeds the limits."""
    width, height = min(image.width, SIDE), min(image.height, SIDE)
    try:
        return image.render(width=width, height=height, limits=LIMITS, **options)
    except LimitError:
        return None


def one_input(data: bytes) -> None:
    """Decodes a file in all ways."""
    # One in eight runs without the kernel. A warning of numpy counts as a failure.
    way = run.numpy_only() if zlib.crc32(data) % 8 == 0 else contextlib.nullcontext()
    with way, warnings.catch_warnings(), np.errstate(all="warn", under="ignore"):
        warnings.simplefilter("error")
        _decode(data)


def _decode(data: bytes) -> None:
    """Validates, decodes, draws and saves a file, and compares the results."""
    wrong = [v for v in validate.validate(data, LIMITS) if v.severity == ERROR]
    try:
        image = from_bytes(data, LIMITS)
    except PxiError as error:
        if not wrong:
            raise AssertionError("it is valid, but refused") from error
        _salvage(data)
        return
    try:
        shown = drawn(image)
    except (FormatError, UnsupportedError) as error:
        if not wrong:
            raise AssertionError("it is valid, but cannot be drawn") from error
        return
    if wrong or shown is None:
        return
    again = from_bytes(image.to_bytes())
    assert np.array_equal(drawn(again), shown), "it is not drawn alike once it was saved"
    if image.timeline is not None:
        drawn(image, t=image.timeline.seconds / 3)
    for step in range(len(image.history)):
        with contextlib.suppress(PxiError):
            image.undone(step + 1)


def _salvage(data: bytes) -> None:
    """Decodes a damaged file as far as possible."""
    with contextlib.suppress(PxiError):
        drawn(from_bytes(data, LIMITS, tolerant=True))


if __name__ == "__main__":
    run.main("decode", one_input, run.seeds(), files=True)

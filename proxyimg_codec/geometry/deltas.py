"""Coding of mostly small signed integers: an adaptively coded class of magnitude, and raw bits."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..entropy import arrays
from ..errors import FormatError

Ints = NDArray[np.int64]

_ESCAPE = 15
"""Class of values of 15 bits and more, whose magnitude is stored in 31 raw bits."""


def encode(values: Ints) -> tuple[bytes, bytes]:
    """Encodes signed integers.

    Args:
        values: int64 [C, N] or [C, H, N], less than 2**31 in magnitude.

    Returns:
        The classes as a coded array, and the raw bits: for each value but 0 a sign, and the bits of
        its magnitude that its class leaves open.
    """
    bits = np.where(values == 0, 0, np.floor(np.log2(np.maximum(np.abs(values), 1))) + 1)
    classes = np.minimum(bits.astype(np.int64), _ESCAPE)
    grid = classes.reshape(len(classes), -1, classes.shape[-1])
    coded = arrays.encode(grid, 4, np.ones(grid.shape[1:], bool))
    raw = "".join(
        f"{int(v < 0)}{_magnitude(int(abs(v)), int(c))}"
        for v, c in zip(values.ravel(), classes.ravel(), strict=True)
        if c
    )
    raw += "0" * (-len(raw) % 8)
    return coded, int(raw, 2).to_bytes(len(raw) // 8, "big") if raw else b""


def _magnitude(value: int, klass: int) -> str:
    if klass == _ESCAPE:
        return f"{value:031b}"
    return f"{value:b}"[1:]


def decode(
    coded: bytes, raw: bytes, channels: int, count: int, where: str, rows: int = 1
) -> Ints:  # fmt: skip
    """Decodes signed integers that `encode` coded.

    Args:
        coded: The coded array of classes.
        raw: The raw bits.
        channels: C of the encoded array.
        count: N of the encoded array.
        where: Name of the chunk in error messages.
        rows: H of the encoded array.

    Returns:
        int64 [channels, rows * count] values.

    Raises:
        FormatError: A stream is corrupt, the raw bits have a wrong length, or a class is larger
            than its value needs.
    """
    stored = np.ones((rows, count), bool)
    try:
        classes = arrays.decode(coded, (channels, rows, count), 4, stored).ravel().astype(np.int64)
    except FormatError as error:
        raise FormatError(str(error), where, rule=error.rule) from None
    return _read(raw, classes, where).reshape(channels, rows * count)


def _read(data: bytes, classes: Ints, where: str) -> Ints:
    """Reads signed values [N] of the classes [N] from the raw bits."""
    width = np.where(classes == _ESCAPE, 32, classes)
    ends = np.cumsum(width)
    total = int(ends[-1])
    if len(data) != (total + 7) // 8:
        raise FormatError("the raw bits of the deltas have the wrong length", where, rule="ENT-19")
    bits = np.unpackbits(np.frombuffer(data, np.uint8)).astype(np.int64)
    if bits[total:].any():
        raise FormatError("padding bits of the deltas are not zero", where, rule="ENT-19")
    out = np.zeros(len(classes), np.int64)
    for k in np.unique(classes[classes > 0]):
        at = np.flatnonzero(classes == k)
        n = 31 if k == _ESCAPE else int(k) - 1
        first = ends[at] - n
        weights = np.int64(1) << np.arange(n - 1, -1, -1, dtype=np.int64)
        value = bits[first[:, None] + np.arange(n)] @ weights
        if k == _ESCAPE and (value < 1 << (_ESCAPE - 1)).any():
            raise FormatError(
                "a delta is coded in a larger class than it needs", where, rule="ENT-20"
            )
        value += 0 if k == _ESCAPE else 1 << n
        out[at] = np.where(bits[first - 1] == 1, -value, value)
    return out

"""Implicit texture: a plane of codes over the box of a layer, decoded by a network of the file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..container import texr
from ..entropy import arrays
from ..errors import FormatError
from .diffusion import FRACTION_BITS, fill
from .network import Floats, Network, read_halves

Box = tuple[int, int, int, int]
"""Rectangle x, y, width, height, in canvas pixels or samples."""


class Taps(NamedTuple):
    """Places and weights for the bilinear interpolation of N points in a table of codes [rows, D].

    The four codes of a point are the rows base, base + 1, base + stride and base + stride + 1.

    Attributes:
        base: int32 [N] row of the upper left code.
        fx: float32 [N] horizontal fraction in 0..1.
        fy: float32 [N] vertical fraction in 0..1.
        stride: Number of rows from a code to the one below.
    """

    base: NDArray[np.int32]
    fx: Floats
    fy: Floats
    stride: int


def taps(x: NDArray[np.float64], y: NDArray[np.float64], box: Box, columns: int, rows: int) -> Taps:
    """Taps of points in a plane whose corner codes lie on the corners of a box.

    Points outside the box take the value at its rim.

    Args:
        x: float64 [N] x of the points in canvas pixels.
        y: float64 [N] y of the points.
        box: The rectangle over which the plane is stretched, in canvas pixels.
        columns: Columns of the plane.
        rows: Rows of the plane.
    """
    x0, y0, width, height = box
    ix, fx = _position(x, x0, width, columns)
    iy, fy = _position(y, y0, height, rows)
    iy *= columns
    iy += ix
    return Taps(iy, fx, fy, columns)


def _position(
    points: NDArray[np.float64], start: int, extent: int, codes: int
) -> tuple[NDArray[np.int32], Floats]:
    """Index of the code before each point along one axis, and the fraction to the next code."""
    grid = points - start
    grid *= (codes - 1) / extent
    np.clip(grid, 0, codes - 1, out=grid)
    before = grid.astype(np.int32)
    np.minimum(before, codes - 2, out=before)
    grid -= before
    return before, grid.astype(np.float32)


@dataclass(frozen=True, eq=False)
class ImplicitTexture:
    """Texture as a quantized plane of codes.

    Attributes:
        network: Index of the decoder network in the file.
        bits: Bits per code, 2..8.
        steps: float16 [D] quantization step of each feature.
        codes: int8 [D, rows, columns] codes; 0 where they are not stored.
        stored: bool [rows, columns], True at stored positions.
    """

    network: int
    bits: int
    steps: NDArray[np.float16]
    codes: NDArray[np.int8]
    stored: NDArray[np.bool_]

    @property
    def arrays(self) -> tuple[NDArray[Any], ...]:
        """Arrays of the texture."""
        return self.codes, self.stored

    def channels(self, networks: Sequence[Network]) -> int:
        """Number of outputs of its network, 3 or 4; `networks` are all networks of the file."""
        return networks[self.network].shape.channels

    @property
    def grid(self) -> tuple[int, int]:
        """Columns and rows of the plane."""
        return self.codes.shape[2], self.codes.shape[1]

    @cached_property
    def packed(self) -> Mapping[str, Any]:
        """Fields of TEXR: those that the texture was read from, otherwise newly coded ones."""
        return pack(self)

    @cached_property
    def table(self) -> Floats:
        """Dequantized codes float32 [rows * columns, D], filled by diffusion where not stored."""
        filled = fill(self.codes, self.stored)
        scale = self.steps.astype(np.float32) / (1 << FRACTION_BITS)
        return np.ascontiguousarray(
            np.moveaxis(filled, 0, -1).reshape(-1, len(self.steps)).astype(np.float32) * scale
        )

    def taps(self, x: NDArray[np.float64], y: NDArray[np.float64], box: Box) -> Taps:
        """Taps of canvas points x, y, float64 [N] each; `box` is the rectangle of the layer."""
        return taps(x, y, box, *self.grid)

    def features(self, at: Taps) -> Floats:
        """Features float32 [N, D] at N points, interpolated bilinearly."""
        dim = self.table.shape[1]
        # Repeated, because numpy broadcasts slowly along short rows.
        fx, fy = (f.repeat(dim).reshape(-1, dim) for f in (at.fx, at.fy))
        base = at.base.astype(np.intp)
        top = _mix(self.table.take(base, 0), self.table.take(base + 1, 0), fx)
        base += at.stride
        bottom = _mix(self.table.take(base, 0), self.table.take(base + 1, 0), fx)
        return _mix(top, bottom, fy)


def _mix(a: Floats, b: Floats, share: Floats) -> Floats:
    """Interpolates a + (b - a) * share; overwrites a, which is the result, and b."""
    b -= a
    b *= share
    a += b
    return a


def pack(texture: ImplicitTexture) -> dict[str, Any]:
    """Encodes a texture as the fields of TEXR."""
    stored = b""
    if not texture.stored.all():
        stored = arrays.encode(
            texture.stored[None].astype(np.int64), 1, np.ones(texture.stored.shape, bool)
        )
    values = texture.codes.astype(np.int64) + (1 << (texture.bits - 1))
    return {
        "coder": texr.IMPLICIT,
        "network": texture.network,
        "grid": list(texture.grid),
        "bits": texture.bits,
        "steps": texture.steps.astype("<f2").tobytes(),
        "stored": stored,
        "codes": arrays.encode(values, texture.bits, texture.stored),
    }


def unpack(
    fields: Mapping[str, Any],
    networks: tuple[Network, ...],
    where: str = "chunk TEXR",
    sampling: int = 0,
) -> ImplicitTexture:
    """Decodes an implicit texture.

    Args:
        fields: Values of TEXR.
        networks: All networks of the file.
        where: Name of the chunk in error messages.
        sampling: Sampling mode of the layer, which decides the number of features of a code.

    Raises:
        FormatError: A stream is corrupt or has a wrong length, a step is not positive, or the mask
            of stored codes is full or empty.
    """
    columns, rows = fields["grid"]
    dim = networks[fields["network"]].shape.dim
    if sampling == 1:  # a local and a global feature
        dim //= 2
    steps = read_halves(fields["steps"], dim, where, "TEX-3", positive=True)
    stored = np.ones((rows, columns), bool)
    if fields["stored"]:
        stored = arrays.decode(fields["stored"], (1, rows, columns), 1, stored)[0].astype(bool)
        if stored.all() or not stored.any():
            raise FormatError("the mask of stored codes is full or empty", where, rule="TEX-1")
    values = arrays.decode(fields["codes"], (dim, rows, columns), fields["bits"], stored)
    codes = (values.astype(np.int16) - (1 << (fields["bits"] - 1))).astype(np.int8)
    texture = ImplicitTexture(
        fields["network"], fields["bits"], steps, np.where(stored, codes, np.int8(0)), stored
    )
    texture.__dict__["packed"] = fields
    return texture

"""Completion by reference: hidden samples that copy known ones of the view [PYR-48 to PYR-51].

What a figure hides continues what lies around. So cells of the part name offsets, and their samples
copy what lies there. Cells overlap, as in overlapped block motion compensation. Each cell is lifted
so that neighbours agree in light, and a smooth correction takes the copies to the colours at their
rim. All of it is exact in integers.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..container import texr
from ..entropy import arrays
from ..errors import FormatError
from ..native import kernel
from . import completion_native
from .diffusion import FRACTION_BITS, Values, diffused
from .lifts import Copier, lifts_of

FILL_ONE = 255 << FRACTION_BITS
"""Integer that stands for the sample 1.0 where hidden samples are completed and filled."""

DRIFT = 12 << FRACTION_BITS
"""Largest correction, which takes care of drifts of light; what does not fit at all would stain."""

BAND = 1 << 18
"""Samples whose references are followed at a time, which bounds memory."""

Samples = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Copies:
    """References from cells of a part to other places of it.

    Attributes:
        grain: Binary logarithm of the side of a cell in samples, 0..`texr.GRAIN_MAX`.
        offsets: int32 [N, 2] offsets dx, dy in samples, 1 <= N <= `texr.OFFSETS_MAX`.
        sources: uint8 [rows, columns] for each cell, from the corner of the part on: n = offset
            n - 1; 0 = none. At least one is not 0.
    """

    grain: int
    offsets: NDArray[np.int32]
    sources: NDArray[np.uint8]

    @property
    def arrays(self) -> tuple[NDArray[Any], ...]:
        """Arrays of the references."""
        return self.offsets, self.sources

    @cached_property
    def coded(self) -> bytes:
        """Coded sources: those that were read, otherwise newly coded."""
        count, bits = texr.sources_bits(len(self.offsets))
        parts = [self.sources >> (bits * k) & ((1 << bits) - 1) for k in range(count)]
        return arrays.encode(np.stack(parts), bits, np.ones(self.sources.shape, bool))

    @property
    def fields(self) -> dict[str, Any]:
        """Fields `grain`, `offsets` and `sources` of TEXR."""
        return {
            "grain": self.grain,
            "offsets": self.offsets.ravel().tolist(),
            "sources": self.coded,
        }


def unpack(fields: Mapping[str, Any], where: str) -> Copies | None:
    """Decodes the references of a pyramid texture.

    Args:
        fields: Values of TEXR, checked.
        where: Name of the chunk in error messages.

    Raises:
        FormatError: The sources are corrupt, all 0, or name an offset that does not exist.
    """
    if not fields["sources"]:
        return None
    offsets = np.array(fields["offsets"], np.int32).reshape(-1, 2)
    shape = texr.cells_shape(fields, "grain")
    count, bits = texr.sources_bits(len(offsets))
    parts = arrays.decode(fields["sources"], (count, *shape), bits, np.ones(shape, bool))
    sources = parts[0] if count == 1 else parts[0] | parts[1] << bits
    if sources.max() > len(offsets) or not sources.any():
        raise FormatError(
            "sources are all 0, or name an offset that does not exist", where, rule="PYR-48"
        )
    copies = Copies(fields["grain"], offsets, sources)
    copies.__dict__["coded"] = fields["sources"]
    return copies


def completed(values: Values, known: Samples, copies: Copies) -> tuple[Values, Samples]:
    """Completes unknown samples by references to known ones [PYR-49 to PYR-51].

    Args:
        values: int32 [C, H, W] samples in 0..`FILL_ONE`; unknown ones have no influence.
        known: bool [H, W], True for known samples.
        copies: The references.

    Returns:
        int32 [C, H, W] values, and bool [H, W], True for samples known now. Both may be the
        arrays that were given.
    """
    if kernel.available():
        return completion_native.completed(
            values, known, copies.grain, copies.offsets, copies.sources, DRIFT, FILL_ONE
        )
    flat = known.ravel()
    copier = Copier(values, known, copies.offsets, copies.sources, 1 << copies.grain)
    at, base = _bases(values, known, copies, copier, lifts_of(copier))
    inside = flat[at]
    copied, rim = at[~inside], at[inside]
    if not len(copied):
        return values, known
    out = values.reshape(len(values), -1).copy()
    now, beside = flat.copy(), np.zeros_like(flat)
    now[copied], beside[rim] = True, True
    for own, found in zip(out, base, strict=True):
        drift = found[~inside]
        if len(rim):
            residual = np.zeros_like(own)
            residual[rim] = np.clip(own[rim] - found[inside], -DRIFT, DRIFT)
            drift += _spread(residual.reshape(1, *known.shape), beside, ~flat & now).ravel()[copied]
        own[copied] = np.clip(drift, 0, FILL_ONE)
    return out.reshape(values.shape), now.reshape(known.shape)


def _spread(value: Values, known: Samples, wanted: Samples) -> Values:
    """Values [1, H, W], spread by diffusion from those `known` [H * W] to those `wanted`."""
    shape = value.shape[1:]
    return diffused(value, known.reshape(shape), wanted.reshape(shape))


def _bases(
    values: Values, known: Samples, copies: Copies, copier: Copier, lifts: Values
) -> tuple[NDArray[np.int32], Values]:
    """Finds the samples that have a base, and the bases with what lifts them [PYR-49, PYR-51].

    Returns:
        int32 [n] flat numbers of the samples, ascending, and int32 [C, n] bases.
    """
    height, width = known.shape
    cells = np.pad(copies.sources, 1)
    number = np.pad(copier.number[:-1, :-1], 1, constant_values=-1)
    down, across = (_weights(n, copies.grain) for n in known.shape)
    # Where none of the four cells around a sample has a source, nothing is to be done.
    some = cells > 0
    near = some[:-1, :-1] | some[1:, :-1] | some[:-1, 1:] | some[1:, 1:]
    places, bases = [np.zeros(0, np.int32)], [np.zeros((len(values), 0), np.int32)]
    step = max(BAND // width, 1)
    for top in range(0, height, step):
        rows = down[0][top : top + step]
        y, x = np.nonzero(near[rows].take(across[0], 1))
        place = (y + top, x)
        there, base = _base(values, known, copies, (cells, number, lifts), place, (down, across))
        places.append(((y + top) * width + x)[there].astype(np.int32))
        bases.append(base)
    return np.concatenate(places), np.concatenate(bases, 1)


Axis = tuple[NDArray[np.int64], NDArray[np.int32]]
"""For each row or column of samples, the number k of the cell after it, and the weight of that."""


def _base(
    values: Values, known: Samples, copies: Copies,
    cells: tuple[NDArray[np.uint8], NDArray[np.intp], Values],
    place: tuple[NDArray[np.int64], NDArray[np.int64]], axes: tuple[Axis, Axis],
) -> tuple[Samples, Values]:  # fmt: skip
    """Bases of the samples at rows and columns `place` [n].

    Args:
        values: int32 [C, H, W] samples.
        known: bool [H, W], True for known samples.
        copies: The references.
        cells: uint8 [rows + 2, columns + 2] sources with a border of 0, numbers of the cells that
            have one, likewise, and lifts int32 [C, n] of these.
        place: Rows and columns of the samples.
        axes: Cells and weights down and across.

    Returns:
        bool [n], True for those that have a base, and int32 [C, m] bases of these.
    """
    (y, x), (height, width) = place, known.shape
    sources, numbers, lifts = cells
    whole = np.int32(2 << copies.grain)
    weight = np.zeros(len(y), np.int32)
    total, lifted = np.zeros((2, len(values), len(y)), np.int32)
    seen, flat = known.ravel(), values.reshape(len(values), -1)
    for below, right in product((0, 1), repeat=2):
        (k, f), (m, g) = (
            (number[p], part[p]) for (number, part), p in zip(axes, place, strict=True)
        )
        source = sources[k + below, m + right]
        shift = copies.offsets[np.maximum(source, 1) - 1]
        v, u = y + shift[:, 1], x + shift[:, 0]
        used = np.flatnonzero((source > 0) & (v >= 0) & (v < height) & (u >= 0) & (u < width))
        q = v[used] * width + u[used]
        used, q = used[seen[q]], q[seen[q]]
        w = (f if below else whole - f)[used] * (g if right else whole - g)[used]
        weight[used] += w
        total[:, used] += w * flat.take(q, 1)
        lifted[:, used] += w * lifts.take(numbers[(k + below)[used], (m + right)[used]], 1)
    there = weight > 0
    total, lifted, weight = total[:, there], lifted[:, there], weight[there]
    # At the coarsest grain weights add up to 2^14, and 2^15 `FILL_ONE` + 2^14 still fits 32 bits.
    base = (2 * total + weight) // (2 * weight)
    return there, base + (2 * lifted + weight) // (2 * weight)


def _weights(count: int, grain: int) -> Axis:
    """Cells beside each of `count` rows or columns of samples.

    Returns:
        int64 [count] number k of the later one of two cells, so that the other is k - 1, in an
        array with one cell more before the first: its place is k there, and k + 1 for the later
        one; int32 [count] weight of the later one in 1/2^(grain + 1).
    """
    place = 2 * np.arange(count) + 1 + (1 << grain)
    number = place >> (grain + 1)
    return number, (place - (number << (grain + 1))).astype(np.int32)

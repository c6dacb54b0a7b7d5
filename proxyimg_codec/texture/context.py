"""Context model of the pyramid coder: predicts distributions of latents from those coded before.

All arithmetic is on integers below 2**24. As float32 holds these exactly, sums do not depend on
their order. So the matrix products of numpy may be used, and every decoder finds the same
probabilities (spec chapter 8).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from ..entropy import laplace
from ..native import kernel
from ..progress import worked
from . import lifting_native, registered_model
from .convolution import by_row, convolved, strips
from .grid import Bands, Window, mirrored_indices
from .network import Floats
from .registered_model import CAUSAL, STEP_ORIGIN, Array, Context

Ints = NDArray[np.int32]

LIMIT = 1 << 16
"""Bound of the magnitude of latents, so that no sum overflows."""

SHIFT_ORIGIN = 8
"""Number added to a shift of the scale index when it is stored."""

REACH = 4
"""Positions around a tile, on all sides, whose coarser levels its context depends on: 3, made even.
"""

BAD_ESCAPES = "the list of escapes is truncated or corrupt"
BAD_LATENT = f"a latent is not between {-LIMIT} and {LIMIT}"

# Cohen, Daubechies, Feauveau 1992, synthesis filters of the 9/7 wavelet, in 1/256:
# LOW[phase][tap] weighs low sample m + tap - 2 in output 2 m + phase, HIGH the high one.
LOW = ((0, -10, 202, -10, 0), (0, -17, 107, 107, -17))
HIGH = ((6, -97, -97, 6, 0), (10, -28, 218, -28, 10))


class Coder(Protocol):
    """Protocol of the entropy coder: an encoder or a decoder of latents."""

    def code(
        self, values: NDArray[np.int64], mean: NDArray[np.int64], scale: NDArray[np.int64]
    ) -> NDArray[np.int64]:
        """Encodes or decodes latents.

        Args:
            values: [N] latents to encode; a decoder ignores them.
            mean: [N] predicted means in 1/16.
            scale: [N] predicted scale indices.

        Returns:
            [N] latents.
        """


class Wave(NamedTuple):
    """Positions that are coded together, because none is a neighbour of another.

    Attributes:
        rows: [N] rows of the positions.
        columns: [N] columns of the positions.
    """

    rows: NDArray[np.int64]
    columns: NDArray[np.int64]


def waves(support: NDArray[np.bool_]) -> Iterator[Wave]:
    """Yields the positions of `support` [H, W] in coding order: by x + 3 y, within a wave by y."""
    h, w = support.shape
    flat = support.ravel()
    for t in range(w + 3 * (h - 1)):
        rows = np.arange(max((t - w + 3) // 3, 0), min(t // 3, h - 1) + 1)
        rows = rows[flat.take(rows * (w - 3) + t)]
        if len(rows):
            yield Wave(rows, t - 3 * rows)


def next_plain(low: Ints, high: Ints, shape: tuple[int, int]) -> Ints:
    """Computes the next finer plane by the plain wavelet, as an input of the context network.

    Args:
        low: int32 [3, h, w] in 1/16.
        high: int32 [9, h, w] latents, channel 3 * colour + band. The bands, as (vertical,
            horizontal) with 1 for high pass, are (0, 1), (1, 0), (1, 1).
        shape: Rows and columns of the finer plane: 2 h or 2 h - 1, and so on.

    Returns:
        int32 [3, rows, columns] in 1/16, at most `LIMIT` in magnitude.
    """
    if kernel.available():
        taps = np.array((LOW, HIGH), np.int32)
        return lifting_native.next_plain(low, high, shape, taps, LIMIT << 4)
    bands = high.reshape(3, 3, *high.shape[1:]) << 4
    left = _lift(low, bands[:, 1], 1, shape[0])
    right = _lift(bands[:, 0], bands[:, 2], 1, shape[0])
    most = LIMIT << 4
    out = _lift(left, right, 2, shape[1])
    return np.clip(out, -most, most, out=out)


def _lift(low: Ints, high: Ints, axis: int, size: int) -> Ints:
    """Wavelet synthesis of `size` samples along one axis, with sums in 1/256, rounded half up."""
    n = low.shape[axis]
    index = [mirrored_indices(size, way) for way in (False, True)]
    out = []
    for phase in range(2):
        total = np.full(low.shape, 128, np.int32)
        for plane, taps, at in ((low, LOW[phase], index[0]), (high, HIGH[phase], index[1])):
            for tap, weight in enumerate(taps):
                if weight:
                    total += np.int32(weight) * plane.take(at[tap : tap + n], axis)
        out.append(total >> 8)
    shape = (*low.shape[:axis], 2 * n, *low.shape[axis + 1 :])
    return np.stack(out, axis + 1).reshape(shape).take(np.arange(size), axis)


def _squashed(numerator: NDArray[Any], unit: int) -> NDArray[Any]:
    """32 x / (1 + |x| / 4) with x = numerator / unit, rounded to nearest, halves away from zero."""
    size = np.minimum(np.abs(numerator), 508 * unit)  # a result of at most 127, as in training
    under = 4 * unit + size
    out: NDArray[Any] = np.sign(numerator) * ((128 * size + under // 2) // under)
    return out


LOG = np.rint(32 * np.log1p(np.arange(53))).astype(np.int32)
"""Table of 32 ln(1 + n), rounded; the last value is 127."""


def log_feature(latents: NDArray[np.integer[Any]]) -> Ints:
    """Feature 32 ln(1 + |y|) of latents y, rounded, at most 127; int32 of the same shape."""
    out: Ints = LOG.take(np.minimum(np.abs(latents), len(LOG) - 1))
    return out


def high_pass(plane: Ints) -> Ints:
    """Feature of plain planes [C, h, w]: squashed difference from the mean of 3 x 3 neighbours."""
    p = np.pad(plane, ((0, 0), (1, 1), (1, 1)), mode="edge")
    rows = p[:, :, :-2] + p[:, :, 1:-1] + p[:, :, 2:]
    return _squashed(9 * plane - (rows[:, :-2] + rows[:, 1:-1] + rows[:, 2:]), 144)


def scaled(total: Floats, bits: int) -> Floats:
    """Multiplies integers by 2**-bits, rounded half up, in place."""
    total *= np.float32(2.0**-bits)
    total += np.float32(0.5)
    return np.floor(total, out=total)


def activated(total: Floats, bits: int) -> Floats:
    """Scales sums of a layer by 2**-bits in place, and clamps them to activations 0..255 (1/32)."""
    return _clamped(scaled(total, bits), 0, 255)


def _clamped(values: Floats, low: float, high: float) -> Floats:
    """Clamps values in place, much faster than `np.clip` for small arrays."""
    return np.minimum(np.maximum(values, low, out=values), high, out=values)


class LevelCoder:
    """Encoder and decoder of the latents of one level.

    Attributes:
        weights: Context network of the level.
        grey: Whether the level has no chroma.
        shifts: Numbers added to the scale index of luma and of chroma.
        first_bias: int32 [C] biases of the first layer for the quantization step.
    """

    def __init__(self, weights: Context, step: int, grey: bool, shifts: tuple[int, int]) -> None:
        self.weights, self.grey, self.shifts = weights, grey, shifts
        w = weights
        t = step - STEP_ORIGIN
        self.first_bias = w.first_bias.values + ((w.first_by_step.values * t + 128) >> 8)
        self._causal = _matrix(w.causal.values.transpose(2, 1, 0).reshape(-1, _width(w)))
        self._mix, self._luma = _matrix(w.mix.values.T), _matrix(w.luma.values.T)
        self._from, self._chroma = _matrix(w.from_luma.values.T), _matrix(w.chroma.values.T)

    def code(
        self, coder: Coder, low: Ints, parent: Ints, bands: Bands, values: Ints | None,
        out: Ints | None = None,
    ) -> Ints:  # fmt: skip
        """Encodes or decodes a level.

        Args:
            coder: The entropy coder.
            low: int32 [3, h, w] plain planes in 1/16.
            parent: int32 [9, ceil(h / 2), ceil(w / 2)] latents of the coarser level, or zeros.
            bands: uint8 [h, w], bit b set where band b is coded; other latents are 0.
            values: int32 [9, h, w] latents to encode; None to decode.
            out: int32 [9, h, w] zeros for the result; by default new ones.

        Returns:
            int32 [9, h, w] latents.
        """
        h, w = bands.shape
        ahead = self._ahead(low, parent)  # [h * w, C]
        pitch = w + 4
        seen = np.zeros(((h + 2) * pitch, 18), np.int8)
        out = np.zeros((9, h, w), np.int32) if out is None else out
        latents = out.reshape(9, -1)
        source = None if values is None else values.reshape(9, -1)
        offsets = np.array([dy * pitch + dx for dy, dx in CAUSAL])
        for wave in waves(bands > 0):
            at = wave.rows * w + wave.columns
            there = (bands.ravel()[at, None] >> np.arange(3) & 1).astype(bool)  # [N, 3]
            place = (wave.rows + 2) * pitch + wave.columns + 2
            around = seen.take(place[:, None] + offsets, 0).reshape(len(at), -1)
            given = None if source is None else source[:, at].T.astype(np.int64)
            found = self._wave(coder, ahead[at], around.astype(np.float32), there, given)
            latents[:, at] = found.T
            worked(len(at))
            seen[place, :9] = _squashed(found, 1)
            seen[place, 9:] = log_feature(found)
        return out

    def _wave(
        self, coder: Coder, ahead: NDArray[np.int16], around: Floats, there: NDArray[np.bool_],
        given: NDArray[np.int64] | None,
    ) -> NDArray[np.int64]:  # fmt: skip
        """Codes the latents [N, 9] of a wave.

        Args:
            coder: The entropy coder.
            ahead: [N, C] part of the hidden layer from coarser levels, in 1/256.
            around: [N, 216] features of the latents coded before.
            there: [N, 3] whether each band is coded.
            given: [N, 9] latents to encode; None to decode.
        """
        w = self.weights
        z = scaled(around @ self._causal, -w.causal.exponent - 3)
        z += ahead
        z = activated(z, 3)
        z = activated(z @ self._mix + _floats(w.mix_bias), -w.mix.exponent)
        out = np.zeros((len(z), 9), np.int64)
        self._put(coder, z @ self._luma, w.luma, w.luma_bias, 0, there, given, out[:, :3])
        if self.grey:
            return out
        luma = out[:, :3]
        features = np.concatenate([_squashed(luma, 1), log_feature(luma)], 1).astype(np.float32)
        extra = scaled(features @ self._from + _floats(w.from_luma_bias), -w.from_luma.exponent - 3)
        z *= 8
        z = activated(z + extra, 3)
        rest = None if given is None else given[:, 3:]
        self._put(coder, z @ self._chroma, w.chroma, w.chroma_bias, 1, there, rest, out[:, 3:])
        return out

    def _put(
        self, coder: Coder, total: Floats, weights: Array, bias: Array, kind: int,
        there: NDArray[np.bool_], given: NDArray[np.int64] | None, out: NDArray[np.int64],
    ) -> None:  # fmt: skip
        """Codes n latents of each position to `out` [N, n] by network outputs `total` [N, 2 n]."""
        total += _floats(bias)
        n = out.shape[1]
        mean = _clamped(scaled(total[:, :n].copy(), 1 - weights.exponent), -(1 << 14), 1 << 14)
        scale = scaled(total[:, n:].copy(), 2 - weights.exponent) + (32 + self.shifts[kind])
        scale = _clamped(scale, 0, laplace.SCALES - 1)
        # Scale and mean 0 make a latent certain: bands that are not there have no symbols.
        mean, scale = (v * np.tile(there, n // 3) for v in (mean, scale))
        values = np.zeros(out.size, np.int64) if given is None else given[:, :n].ravel()
        coded = coder.code(values, mean.astype(np.int64).ravel(), scale.astype(np.int64).ravel())
        out[:] = coded.reshape(out.shape)

    def _ahead(self, low: Ints, parent: Ints) -> NDArray[np.int16]:
        """Part [h * w, C] of the hidden layer that depends on coarser levels only, in 1/256."""
        w = self.weights
        h, width = low.shape[1:]
        inputs = np.empty((12, h, width), np.int8)
        for channel in range(3):
            inputs[channel] = high_pass(low[channel : channel + 1])[0]
        up = log_feature(parent).astype(np.int8)
        inputs[3:] = up.repeat(2, 1).repeat(2, 2)[:, :h, :width]
        out = np.empty((h * width, _width(w)), np.int16)
        first, second = by_row(w.first.values), by_row(w.second.values)
        for top, bottom in strips(h, width):
            z = convolved(inputs.transpose(1, 2, 0), first, top - 1, bottom + 1)
            z += self.first_bias
            z = activated(z, -w.first.exponent)
            z = z.reshape(-1, width, z.shape[1])
            if top == 0:
                z[0] = 0  # rows outside count as 0, without their bias
            if bottom == h:
                z[-1] = 0
            z = convolved(z, second, 1, 1 + bottom - top)
            z += _floats(w.second_bias)
            z = np.clip(scaled(z, -w.second.exponent - 3), -(1 << 15), (1 << 15) - 1)
            out[top * width : bottom * width] = z
        return out


class Place(NamedTuple):
    """Level to code, or a part of it, with what its context depends on.

    Attributes:
        coder: Coder of the level, with the weights of its network.
        low: int32 [3, h, w] plain planes in 1/16.
        parent: int32 [9, ceil(h / 2), ceil(w / 2)] latents of the coarser level, or zeros.
        bands: uint8 [h, w], bit b set where band b is coded.
    """

    coder: LevelCoder
    low: Ints
    parent: Ints
    bands: Bands

    @classmethod
    def of(
        cls, fields: Mapping[str, Any], level: int, low: Ints, parent: Ints, bands: Bands
    ) -> Place:
        """Place of a level of a PLAN; `low`, `parent` and `bands` are the attributes.

        Raises:
            UnsupportedError: The model is unknown.
        """
        weights = registered_model.registered(fields["model"])
        shifts = [v - SHIFT_ORIGIN for v in fields["shifts"][2 * level - 2 : 2 * level]]
        coder = LevelCoder(
            weights.context[min(level, registered_model.LEVEL_SETS) - 1],
            fields["step"], level <= fields["grey"], (shifts[0], shifts[1]),
        )  # fmt: skip
        return cls(coder, low, parent, bands)

    def tile(self, window: Window) -> tuple[Place, Window]:
        """Place of a tile, and the window that it has with what its context depends on."""
        outer = window.grown(REACH, self.bands.shape)
        bands = np.zeros(outer.shape, np.uint8)
        bands[window.inside(outer).at] = self.bands[window.at]
        low, parent = self.low[:, *outer.at], self.parent[:, *outer.halved().at]
        return Place(self.coder, low, parent, bands), outer


def _matrix(values: NDArray[Any]) -> Floats:
    return np.ascontiguousarray(values, np.float32)


def _floats(values: Array) -> Floats:
    return values.values.astype(np.float32)


def _width(weights: Context) -> int:
    return len(weights.mix.values)

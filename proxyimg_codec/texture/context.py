"""The context model of the pyramid coder: whole numbers in, distributions of latents out.

All arithmetic is on whole numbers below 2**24, which float32 holds exactly whatever the order of
sums, so that the matrix products of numpy may be used and every decoder finds the same
probabilities (spec chapter 8).
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from ..entropy import laplace
from .convolution import by_row, convolved, strips
from .network import Floats
from .registered_model import CAUSAL, STEP_ORIGIN, Array, Context

Ints = NDArray[np.int32]

LIMIT = 1 << 16
"""Latents are smaller than this in magnitude, so that no sum overflows."""

BAD_ESCAPES = "the list of escapes is truncated or corrupt"
BAD_LATENT = f"a latent is not between {-LIMIT} and {LIMIT}"

# Cohen, Daubechies, Feauveau 1992, synthesis filters of the 9/7 wavelet, in 1/256:
# LOW[phase][tap] weighs low sample m + tap - 2 in output 2 m + phase, HIGH the high one.
LOW = ((0, -10, 202, -10, 0), (0, -17, 107, 107, -17))
HIGH = ((6, -97, -97, 6, 0), (10, -28, 218, -28, 10))


class Coder(Protocol):
    """Either end of the entropy coder."""

    def code(
        self, values: NDArray[np.int64], mean: NDArray[np.int64], scale: NDArray[np.int64]
    ) -> NDArray[np.int64]:
        """Codes latents [N]; a decoder ignores `values` and returns them, an encoder too."""


class Wave(NamedTuple):
    """Positions that are coded together: none is a neighbour of another's."""

    rows: NDArray[np.int64]
    columns: NDArray[np.int64]


def waves(support: NDArray[np.bool_]) -> Iterator[Wave]:
    """Positions of `support` [H, W] by x + 3 y ascending, within a wave by y."""
    h, w = support.shape
    flat = support.ravel()
    for t in range(w + 3 * (h - 1)):
        rows = np.arange(max((t - w + 3) // 3, 0), min(t // 3, h - 1) + 1)
        rows = rows[flat.take(rows * (w - 3) + t)]
        if len(rows):
            yield Wave(rows, t - 3 * rows)


def next_plain(low: Ints, high: Ints) -> Ints:
    """The next finer plane of the plain wavelet, which conditions the context.

    Args:
        low: [3, h, w] in 1/16.
        high: Latents [9, h, w], channel 3 * colour + band; bands (v, h) = (0,1), (1,0), (1,1).

    Returns:
        [3, 2h, 2w] in 1/16.
    """
    bands = high.reshape(3, 3, *high.shape[1:]) << 4
    left = _lift(low, bands[:, 1], 1)
    right = _lift(bands[:, 0], bands[:, 2], 1)
    most = LIMIT << 4
    out = _lift(left, right, 2)
    return np.clip(out, -most, most, out=out)


def _lift(low: Ints, high: Ints, axis: int) -> Ints:
    """One axis of the synthesis: sums in 1/256, rounded half up."""
    n = low.shape[axis]
    out = []
    for phase in range(2):
        total = np.full(low.shape, 128, np.int32)
        for plane, taps, is_high in ((low, LOW[phase], False), (high, HIGH[phase], True)):
            for tap, weight in enumerate(taps):
                if weight:
                    total += np.int32(weight) * plane.take(_shifted(n, tap - 2, is_high), axis)
        out.append(total >> 8)
    shape = (*low.shape[:axis], 2 * n, *low.shape[axis + 1 :])
    return np.stack(out, axis + 1).reshape(shape)


def _shifted(n: int, by: int, high: bool) -> NDArray[np.int64]:
    """Indices i + by of 0..n-1, mirrored at the ends.

    Low bands mirror about their first sample and behind their last, high bands the reverse.
    """
    index = np.arange(n) + by
    index = np.where(index < 0, -index - int(high), index)
    index = np.where(index >= n, 2 * n - 1 - int(high) - index, index)
    return np.clip(index, 0, n - 1)


def _squashed(numerator: NDArray[Any], unit: int) -> NDArray[Any]:
    """32 x / (1 + |x| / 4), x = numerator / unit, rounded half up away from zero."""
    size = np.minimum(np.abs(numerator), 508 * unit)  # gives 127 at most, as training has it
    under = 4 * unit + size
    out: NDArray[Any] = np.sign(numerator) * ((128 * size + under // 2) // under)
    return out


LOG = np.rint(32 * np.log1p(np.arange(53))).astype(np.int32)


def log_feature(latents: NDArray[np.integer[Any]]) -> Ints:
    """32 ln(1 + |y|), rounded, at most 127."""
    out: Ints = LOG.take(np.minimum(np.abs(latents), len(LOG) - 1))
    return out


def high_pass(plane: Ints) -> Ints:
    """Feature [3, h, w] of a plain plane: its difference from the mean of 3 x 3, squashed."""
    p = np.pad(plane, ((0, 0), (1, 1), (1, 1)), mode="edge")
    rows = p[:, :, :-2] + p[:, :, 1:-1] + p[:, :, 2:]
    return _squashed(9 * plane - (rows[:, :-2] + rows[:, 1:-1] + rows[:, 2:]), 144)


def scaled(total: Floats, bits: int) -> Floats:
    """Whole numbers times 2**-bits, rounded half up; in place."""
    total *= np.float32(2.0**-bits)
    total += np.float32(0.5)
    return np.floor(total, out=total)


def activated(total: Floats, bits: int) -> Floats:
    """An 8-bit activation, in 1/32."""
    return _clamped(scaled(total, bits), 0, 255)


def _clamped(values: Floats, low: float, high: float) -> Floats:
    """`np.clip` in place; for small arrays much faster."""
    return np.minimum(np.maximum(values, low, out=values), high, out=values)


class LevelCoder:
    """Codes the latents of one level.

    Attributes:
        weights: Its context network.
        grey: Whether it has no chroma.
        shifts: Added to the scale index: luma, chroma.
        first_bias: int32 [C] biases of the first layer at the step.
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
        self, coder: Coder, low: Ints, parent: Ints, support: NDArray[np.bool_], values: Ints | None
    ) -> Ints:
        """Codes a level.

        Args:
            coder: The entropy coder.
            low: Plain plane [3, h, w] in 1/16.
            parent: Latents of the coarser level [9, h / 2, w / 2], or zeros.
            support: [h, w] positions that are coded; latents elsewhere are 0.
            values: Latents [9, h, w] to encode, or None.

        Returns:
            The latents, int32 [9, h, w].
        """
        h, w = support.shape
        ahead = self._ahead(low, parent)  # [h * w, C]
        pitch = w + 4
        seen = np.zeros(((h + 2) * pitch, 18), np.int8)
        latents = np.zeros((9, h * w), np.int32)
        source = None if values is None else values.reshape(9, -1)
        offsets = np.array([dy * pitch + dx for dy, dx in CAUSAL])
        for wave in waves(support):
            at = wave.rows * w + wave.columns
            place = (wave.rows + 2) * pitch + wave.columns + 2
            around = seen.take(place[:, None] + offsets, 0).reshape(len(at), -1)
            given = None if source is None else source[:, at].T.astype(np.int64)
            found = self._wave(coder, ahead[at], around.astype(np.float32), given)
            latents[:, at] = found.T
            seen[place, :9] = _squashed(found, 1)
            seen[place, 9:] = log_feature(found)
        return latents.reshape(9, h, w)

    def _wave(
        self, coder: Coder, ahead: NDArray[np.int16], around: Floats,
        given: NDArray[np.int64] | None,
    ) -> NDArray[np.int64]:  # fmt: skip
        """Latents [N, 9] of positions with their context."""
        w = self.weights
        z = scaled(around @ self._causal, -w.causal.exponent - 3)
        z += ahead
        z = activated(z, 3)
        z = activated(z @ self._mix + _floats(w.mix_bias), -w.mix.exponent)
        out = np.zeros((len(z), 9), np.int64)
        self._put(coder, z @ self._luma, w.luma, w.luma_bias, 0, given, out[:, :3])
        if self.grey:
            return out
        luma = out[:, :3]
        features = np.concatenate([_squashed(luma, 1), log_feature(luma)], 1).astype(np.float32)
        extra = scaled(features @ self._from + _floats(w.from_luma_bias), -w.from_luma.exponent - 3)
        z *= 8
        z = activated(z + extra, 3)
        rest = None if given is None else given[:, 3:]
        self._put(coder, z @ self._chroma, w.chroma, w.chroma_bias, 1, rest, out[:, 3:])
        return out

    def _put(
        self, coder: Coder, total: Floats, weights: Array, bias: Array, kind: int,
        given: NDArray[np.int64] | None, out: NDArray[np.int64],
    ) -> None:  # fmt: skip
        """Codes n latents of each position from network outputs [N, 2n] into `out` [N, n]."""
        total += _floats(bias)
        n = out.shape[1]
        mean = _clamped(scaled(total[:, :n].copy(), 1 - weights.exponent), -(1 << 14), 1 << 14)
        scale = scaled(total[:, n:].copy(), 2 - weights.exponent) + (32 + self.shifts[kind])
        scale = _clamped(scale, 0, laplace.SCALES - 1)
        values = np.zeros(out.size, np.int64) if given is None else given[:, :n].ravel()
        coded = coder.code(values, mean.astype(np.int64).ravel(), scale.astype(np.int64).ravel())
        out[:] = coded.reshape(out.shape)

    def _ahead(self, low: Ints, parent: Ints) -> NDArray[np.int16]:
        """What does not depend on the level itself [h * w, C], in 1/256."""
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
                z[0] = 0  # rows outside are 0, not what their bias would give
            if bottom == h:
                z[-1] = 0
            z = convolved(z, second, 1, 1 + bottom - top)
            z += _floats(w.second_bias)
            z = np.clip(scaled(z, -w.second.exponent - 3), -(1 << 15), (1 << 15) - 1)
            out[top * width : bottom * width] = z
        return out


def _matrix(values: NDArray[Any]) -> Floats:
    return np.ascontiguousarray(values, np.float32)


def _floats(values: Array) -> Floats:
    return values.values.astype(np.float32)


def _width(weights: Context) -> int:
    return len(weights.mix.values)

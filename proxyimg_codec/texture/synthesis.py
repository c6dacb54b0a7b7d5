"""Synthesis of the pyramid coder: from latents to samples, in floating point."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..native import kernel
from ..progress import worked
from . import synthesis_native
from .context import Ints
from .convolution import by_row, convolved, strips
from .grid import BANDS, Window, mirrored_indices
from .network import Floats
from .registered_model import STEP_ORIGIN, Model, Synthesis

# Antonini et al. 1992, table II, orthonormal: half of the synthesis filters of the CDF 9/7 wavelet.
_LOW = (0.788485616406, 0.418092273222, -0.040689417609, -0.064538882629)
_HIGH = (0.852698679009, -0.377402855613, -0.110624404418, 0.023849465020, 0.037828455507)


def axis_filters() -> NDArray[np.float64]:
    """Synthesis filters of the CDF 9/7 wavelet along an axis, float64 [2, 2, 5].

    Weight [band, phase, tap] is that of sample m + tap - 2 of the low or high band in output
    2 m + phase.
    """
    axis = np.zeros((2, 2, 5))
    for phase in range(2):
        for tap in range(5):
            n = phase - 2 * (tap - 2)
            axis[0, phase, tap] = _LOW[abs(n)] if abs(n) < 4 else 0
            axis[1, phase, tap] = _HIGH[abs(n - 1)] if abs(n - 1) < 5 else 0
    return axis


@functools.cache
def wavelet() -> NDArray[np.float64]:
    """Synthesis weights of the CDF 9/7 wavelet as a convolution, float64 [12, 12, 5, 5].

    Output 4 * colour + 2 * y + x is sample (y, x) of the 2 x 2 samples that a position gives. Input
    c is the low band of colour c; input 3 + 3 * band + colour is a high band.
    """
    axis = axis_filters()
    out = np.zeros((12, 12, 5, 5))
    for colour in range(3):
        for y in range(2):
            for x in range(2):
                cell = 4 * colour + 2 * y + x
                for plane, (v, h) in ((colour, (0, 0)), *_planes(colour)):
                    out[cell, plane] = np.outer(axis[v, y], axis[h, x])
    return out


def _planes(colour: int) -> list[tuple[int, tuple[int, int]]]:
    return [(3 + 3 * band + colour, way) for band, way in enumerate(BANDS)]


def finer(
    model: Model, level: int, low: Floats, latents: Ints, step: int, shape: tuple[int, int],
    part: Window | None = None, out: Floats | None = None, shown: bool = False,
) -> Floats:  # fmt: skip
    """Computes the next finer planes, or a part of them.

    A part lacks neighbours at its edges: what is at most 3 positions from one that is not an edge
    of the planes is wrong.

    Args:
        model: The registered model.
        level: Number of the level, from 1, the finest.
        low: float32 [h, w, 3] planes.
        latents: int32 [9, h, w] latents of the level.
        step: Quantization step, as in PLAN.
        shape: Rows and columns of the finer planes: 2 h or 2 h - 1, and so on.
        part: The part of these that is wanted; by default all.
        out: float32 array for the part; by default a new one.
        shown: Whether to put samples in place of planes, as `put_samples`; for level 1.

    Returns:
        The finer planes, float32 [rows, columns, 3], or their samples.
    """
    part = part or Window.whole(shape)
    out = np.empty((*part.shape, 3), np.float32) if out is None else out
    if shown and not (kernel.available() and out.shape[2] == 3):
        put_samples(model, finer(model, level, low, latents, step, shape, part), step, 0, out)
        return out
    weights = model.synthesis[min(level, len(model.synthesis)) - 1]
    t = np.float32((step - STEP_ORIGIN) / 128)
    gain, linear = gains(weights, step), _linear(model, level).astype(np.float32)
    bias = weights.first_bias.floats + weights.first_by_step.floats * t
    if kernel.available():
        colours = _colour_matrix(model, step, 0) if shown else None
        synthesis_native.finer(
            weights, linear, gain, bias, low, latents, shape, part, out, colours
        )  # fmt: skip
    else:
        out[:] = _filtered(weights, linear, gain, bias, low, latents, shape)[part.at]
    return out


def gains(weights: Synthesis, step: int) -> Floats:
    """Gains [9] of latents."""
    t = np.float32((step - STEP_ORIGIN) / 128)
    # In double precision, so that all machines round it to the same numbers.
    gain = np.exp(weights.gain.floats + weights.gain_by_step.floats * t, dtype=np.float64)
    return gain.astype(np.float32)


def _linear(model: Model, level: int) -> NDArray[np.float64]:
    """Weights of the linear part of a level, [12, 12, 5, 5]."""
    weights = model.synthesis[min(level, len(model.synthesis)) - 1]
    return wavelet() + weights.delta.floats


def colours(model: Model, planes: Floats, step: int, level: int = 0) -> Floats:
    """Computes the colours of planes.

    Args:
        model: The registered model.
        planes: float32 [h, w, 3] planes above a level.
        step: Quantization step, as in PLAN.
        level: Number of the levels below, which are left out. Then colours are those that even
            planes would have if these levels were made.

    Returns:
        float32 [h, w, 3] colours in 0..255, not clipped.
    """
    matrix = _colour_matrix(model, step, level)
    if kernel.available():
        return kernel.coloured(np.ascontiguousarray(planes), matrix)
    out = np.empty_like(planes)
    for top, bottom in strips(*planes.shape[:2]):
        out[top:bottom] = planes[top:bottom] @ matrix.T + 128
    return out


def put_samples(model: Model, planes: Floats, step: int, level: int, out: Floats) -> None:
    """Puts the colours of planes, as samples in 0..1.

    Args:
        model: The registered model.
        planes: float32 [h, w, 3] planes above a level.
        step: Quantization step, as in PLAN.
        level: Number of the levels below, as for `colours`.
        out: float32 [h, w, 3], or [h, w, 1] for the mean of the components.
    """
    if kernel.available() and out.shape[2] == 3 and out.flags.c_contiguous:
        kernel.shown(np.ascontiguousarray(planes), _colour_matrix(model, step, level), out)
        return
    found = colours(model, planes, step, level)
    if out.shape[2] == 1:
        found = found.mean(2, keepdims=True)
    found /= 255
    np.clip(found, 0, 1, out=out)


def _colour_matrix(model: Model, step: int, level: int) -> Floats:
    """Weights [3, 3] of planes above a level in each component."""
    matrix = model.to_colour.floats
    for left_out in range(1, level + 1):
        matrix = (matrix @ _evenly(model, left_out)).astype(np.float32)
    scaled: Floats = matrix * np.float32(2 ** (step / 64))
    return scaled


def _evenly(model: Model, level: int) -> NDArray[np.float64]:
    """Factors [3, 3] that even planes take on by the linear part of a level."""
    sums = _linear(model, level)[:, :3].sum((2, 3))
    return np.asarray(sums.reshape(3, 4, 3).mean(1))


def details(model: Model, latents: Sequence[Ints], step: int, size: tuple[int, int]) -> list[float]:
    """Computes how much of a raster each level adds: what it lacks without its latents.

    Wavelets are nearly orthogonal, so squares of latents add up to squares of samples.

    Args:
        model: The registered model.
        latents: int32 [9, h, w] latents of each level, from level 1, the finest, on.
        step: Quantization step, as in PLAN.
        size: Columns and rows of the raster.

    Returns:
        For each level the root mean square of what it adds, in 8-bit levels.
    """
    weight = np.square(model.to_colour.floats * 2 ** (step / 64)).mean(0)  # of each colour
    out = []
    for level, found in enumerate(latents, 1):
        weights = model.synthesis[min(level, len(model.synthesis)) - 1]
        gain = gains(weights, step).astype(np.float64)
        squares = [np.square(band.astype(np.float64)).sum() for band in found]  # exact
        power = np.array(squares) * gain**2
        total = float((power.reshape(3, 3).sum(1) * weight).sum())
        out.append(float(np.sqrt(total / (size[0] * size[1]))))
    return out


def _filtered(
    weights: Synthesis, linear: Floats, gain: Floats, bias: Floats, low: Floats, latents: Ints,
    shape: tuple[int, int],
) -> Floats:  # fmt: skip
    """Does the same as `synthesis_native.finer`, in numpy, for all of the finer planes."""
    h, w = low.shape[:2]
    # Outputs are ordered as 2 rows of 2 samples of 3 colours.
    order = np.arange(12).reshape(3, 2, 2).transpose(1, 2, 0).ravel()
    wavelets, first = by_row(linear[order]), by_row(weights.first.floats)
    third, third_bias = by_row(weights.third.floats[order]), weights.third_bias.floats[order]
    out = np.empty((h, 2, w, 6), np.float32)
    for top, bottom in strips(h, w):
        start, end = max(top - 2, 0), min(bottom + 2, h)
        high = latents[:, start:end].transpose(1, 2, 0) * gain
        inputs = np.concatenate([_soft(_high_pass(low, start, end)), _soft(high)], 2)
        z = convolved(inputs, first, top - 1 - start, bottom + 1 - start)
        z += bias
        np.maximum(z, 0, out=z)
        z = z @ weights.second.floats.T
        z += weights.second_bias.floats
        np.maximum(z, 0, out=z)
        z = z.reshape(-1, w, z.shape[1])
        if top == 0:
            z[0] = 0  # rows outside count as 0, without their bias
        if bottom == h:
            z[-1] = 0
        z = convolved(z, third, 1, 1 + bottom - top)
        z += third_bias
        wide = _extended(low, latents, gain, shape, top, bottom)
        straight = convolved(wide, wavelets, 2, 2 + bottom - top).reshape(-1, w + 4, 12)
        z = z.reshape(-1, w, 12) + straight[:, 2:-2]
        out[top:bottom] = z.reshape(-1, w, 2, 6).swapaxes(1, 2)
        worked((bottom - top) * w)
    return np.ascontiguousarray(out.reshape(2 * h, 2 * w, 3)[: shape[0], : shape[1]])


def _soft(x: Floats) -> Floats:
    return np.divide(x, 1 + np.abs(x) / np.float32(8), dtype=np.float32)


def _high_pass(x: Floats, start: int, end: int) -> Floats:
    """Rows start..end - 1 of x [h, w, 3] less the mean of 3 x 3 neighbours, with edges repeated."""
    near = x.take(np.arange(start - 1, end + 1), 0, mode="clip")
    p = np.pad(near, ((0, 0), (1, 1), (0, 0)), mode="edge")
    rows = p[:, :-2] + p[:, 1:-1] + p[:, 2:]
    around: Floats = (rows[:-2] + rows[1:-1] + rows[2:]) / np.float32(9)
    return x[start:end] - around


def _extended(
    low: Floats, latents: Ints, gain: Floats, shape: tuple[int, int], top: int, bottom: int
) -> Floats:
    """Rows top - 2 .. bottom + 1 of all bands, mirrored beyond the edges as the wavelet needs it.

    Returns:
        float32 [bottom - top + 4, w + 4, 12]: 3 low bands, then 9 high bands times their gain.
    """
    out = np.empty((bottom - top + 4, low.shape[1] + 4, 12), np.float32)
    out[..., :3] = _mirrored(low, (0, 0), shape, top, bottom)
    for band, ways in enumerate(BANDS):
        part = _mirrored(latents[band::3].transpose(1, 2, 0), ways, shape, top, bottom)
        out[..., 3 + 3 * band : 6 + 3 * band] = part * gain[band::3]
    return out


def _mirrored(
    planes: NDArray[Any], ways: tuple[int, int], shape: tuple[int, int], top: int, bottom: int
) -> NDArray[Any]:
    rows, columns = (mirrored_indices(n, bool(way)) for n, way in zip(shape, ways, strict=True))
    return planes[rows[top : bottom + 4, None], columns]

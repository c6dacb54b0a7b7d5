"""Fit of boundaries as in the paper: gradient descent on the Chamfer distance, with splits.

It is slower and less exact than `contours.fit_paths`, and is kept for comparison with the figures
of ProxyImg.
"""

from typing import TYPE_CHECKING

import numpy as np

from .contours import fit_paths, outline_of
from .paths import Bools, Floats, Ints, faults

if TYPE_CHECKING:
    import torch

_SAMPLES = 20  # points of each segment that the distance is computed from
_RATE = 2e-3  # learning rate of Adam, in long sides of the canvas


def fit_paths_chamfer(
    mask: Bools,
    step: float = 0.25,
    segments: int = 4,
    iterations: int = 2000,
    split_every: int = 500,
    tau: float = 2e-3,
    min_area: float = 4.0,
) -> list[Ints]:
    """Fits closed cubic paths by the adaptive Chamfer method of ProxyImg; deterministic.

    Every loop starts with `segments` cubics, whose control points are taken from the contour at
    equal intervals. Adam minimises the two-way Chamfer distance: the sum of squared distances from
    each curve point to the nearest contour point, and back. After every `split_every` iterations,
    segments whose mean distance from their part of the contour exceeds `tau` are halved by de
    Casteljau's construction. A loop that crosses itself or another one is taken as it was before
    the last split; if it did so before the first one, from `fit_paths`.

    Args:
        mask: bool [H, W], True inside.
        step: Quantization step in px; 0.5 must be a multiple of it.
        segments: Segments that a loop starts with, at least 2; tiny loops get as many as their
            samples allow.
        iterations: Number of gradient steps, at least 1.
        split_every: Gradient steps between splits, at least 1.
        tau: Mean distance above which a segment is split, in long sides of the canvas.
        min_area: Loops of a smaller area, in px², are dropped, but never all of them.

    Returns:
        For each loop of `trace` a path int64 [3m, 2] in units of `step`, without `faults`, as
        `fit_paths` returns them.

    Raises:
        ValueError: `step` does not divide 0.5, or a count is out of range.
    """
    if segments < 2 or iterations < 1 or split_every < 1:
        raise ValueError(f"bad counts {segments}, {iterations}, {split_every}")
    safe = fit_paths(mask, step=step, min_area=min_area)
    outline = outline_of(mask, min_area)
    if outline is None:
        return []
    side = float(outline.extent.max())
    loops = np.split(outline.points, np.flatnonzero(np.diff(outline.base)) + 1)
    stages = []
    for loop, sound in zip(loops, safe, strict=True):
        found = _descend(loop / side, segments, iterations, split_every, tau)
        inside = (np.clip(control * side, 0, outline.extent) for control in found)
        stages.append([sound, *(np.rint(p / step).astype(np.int64) for p in inside)])
    # This ends, because the first stages, those of `fit_paths`, have no faults together.
    while any(bad := [f.any() for f in faults([s[-1] for s in stages], outline.positive)]):
        stages = [s[:-1] if b and len(s) > 1 else s for s, b in zip(stages, bad, strict=True)]
    return [s[-1] for s in stages]


def _descend(
    contour: Floats, segments: int, iterations: int, split_every: int, tau: float
) -> list[Floats]:
    """Fits one closed path to a contour.

    Args:
        contour: float64 [n, 2] points of the contour in long sides of the canvas.
        segments: As for `fit_paths_chamfer`.
        iterations: As for `fit_paths_chamfer`.
        split_every: As for `fit_paths_chamfer`.
        tau: As for `fit_paths_chamfer`.

    Returns:
        float64 [3m, 2] control points in long sides of the canvas: before each split, and at the
        end.
    """
    from ..yielding import torch

    target = torch.from_numpy(contour).float()
    count = 3 * min(segments, max(2, len(contour) // 3))
    control = target[torch.arange(count) * len(target) // count]
    t = torch.arange(_SAMPLES) / _SAMPLES
    basis = torch.stack([(1 - t) ** 3, 3 * (1 - t) ** 2 * t, 3 * (1 - t) * t * t, t**3], 1)
    stages: list[Floats] = []
    for done in range(0, iterations, split_every):
        if done:
            control = _split(control, _error(basis @ _quads(control), target) > tau)
        control = control.clone().requires_grad_()
        adam = torch.optim.Adam([control], lr=_RATE)
        for _ in range(min(split_every, iterations - done)):
            curve = (basis @ _quads(control)).reshape(-1, 2)
            with torch.no_grad():
                apart = torch.cdist(curve, target)
                there, back = apart.argmin(1), apart.argmin(0)
            loss = (curve - target[there]).square().sum() + (target - curve[back]).square().sum()
            adam.zero_grad()
            loss.backward()  # type: ignore[no-untyped-call]  # untyped in torch's stubs
            adam.step()
        control = control.detach()
        stages.append(control.double().numpy())
    return stages


def _error(curve: "torch.Tensor", target: "torch.Tensor") -> "torch.Tensor":
    """Mean distance of each segment from the part of the contour that is nearest to it.

    Args:
        curve: float32 [m, _SAMPLES, 2] points of m segments.
        target: float32 [n, 2] points of the contour.

    Returns:
        float32 [m] mean over the points of a segment, and the contour points nearest to them.
    """
    import torch

    apart = torch.cdist(curve.reshape(-1, 2), target)
    back, nearest = apart.min(0)
    total = apart.amin(1).reshape(len(curve), -1).sum(1).index_add(0, nearest // _SAMPLES, back)
    return total / (_SAMPLES + torch.bincount(nearest // _SAMPLES, minlength=len(curve)))


def _quads(control: "torch.Tensor") -> "torch.Tensor":
    """Segments [m, 4, 2] of a closed path [3m, 2]."""
    import torch

    parts = control.reshape(-1, 3, 2)
    return torch.cat([parts, parts[:, :1].roll(-1, 0)], 1)


def _split(control: "torch.Tensor", which: "torch.Tensor") -> "torch.Tensor":
    """Halves the segments `which`, bool [m], of a closed path by de Casteljau's construction."""
    import torch

    p, a, b, q = _quads(control).unbind(1)
    left, middle, right = (p + a) / 2, (a + b) / 2, (b + q) / 2
    before, after = (left + middle) / 2, (middle + right) / 2
    halves = torch.stack([p, left, before, (before + after) / 2, after, right], 1)
    pieces = [
        h if w else c for c, h, w in zip(control.reshape(-1, 3, 2), halves, which, strict=True)
    ]
    return torch.cat(pieces)

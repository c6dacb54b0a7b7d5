"""The paper's way to fit a boundary: gradient descent on the Chamfer distance, splitting segments.

Slower and less exact than `contours.fit_paths`; kept for comparison with ProxyImg's own figures.
"""

from typing import TYPE_CHECKING

import numpy as np

from proxyimg_codec.encoder.shapes.contours import fit_paths, outline_of
from proxyimg_codec.encoder.shapes.paths import Bools, Floats, Ints, faults

if TYPE_CHECKING:
    import torch

_SAMPLES = 20  # points a segment in the distance
_RATE = 2e-3  # Adam's step, in long sides of the canvas


def fit_paths_chamfer(
    mask: Bools,
    step: float = 0.25,
    segments: int = 4,
    iterations: int = 2000,
    split_every: int = 500,
    tau: float = 2e-3,
    min_area: float = 4.0,
) -> list[Ints]:
    """Fit closed cubic paths by the adaptive Chamfer method of ProxyImg.

    Every loop starts with `segments` cubics whose 3m control points are taken from the contour at
    equal intervals. Adam minimises the two-way Chamfer distance (sum of squared distances from
    each curve point to the nearest contour point and back). Between rounds of `split_every`
    iterations, each segment that lies farther than `tau` from its part of the contour on average
    is split in two by de Casteljau's construction. Coordinates are divided by the long side of the
    canvas, so `tau` is in long sides. Where the result crosses itself or another loop, the loops
    concerned are taken from `fit_paths` instead. Deterministic.

    Args:
        mask: bool [H, W].
        step: quantization step in px; 0.5 must be a multiple of it.
        segments: cubics a loop starts with, >= 2; tiny loops get as many as their samples allow.
        iterations: gradient steps in all, >= 1.
        split_every: gradient steps between splits, >= 1.
        tau: mean distance above which a segment is split, in long sides of the canvas.
        min_area: as for `fit_paths`.

    Returns:
        As `fit_paths`: one int64 [3m, 2] a loop, in units of `step`, free of `faults`.

    Raises:
        ValueError: if `step` does not divide 0.5 or a count is out of range.
    """
    if segments < 2 or iterations < 1 or split_every < 1:
        raise ValueError(f"bad counts {segments}, {iterations}, {split_every}")
    safe = fit_paths(mask, step=step, min_area=min_area)
    outline = outline_of(mask, min_area)
    if outline is None:
        return []
    side = float(outline.extent.max())
    paths = []
    for loop in np.split(outline.points, np.flatnonzero(np.diff(outline.base)) + 1):
        control = _descend(loop / side, segments, iterations, split_every, tau) * side
        paths.append(np.rint(np.clip(control, 0, outline.extent) / step).astype(np.int64))
    # Ends after at most one round a loop, for `safe` as a whole has no faults.
    while any(bad := [f.any() for f in faults(paths, outline.positive)]):
        paths = [s if b else p for p, s, b in zip(paths, safe, bad, strict=True)]
    return paths


def _descend(
    contour: Floats, segments: int, iterations: int, split_every: int, tau: float
) -> Floats:
    """Fit one closed path to contour points [n, 2], all in long sides; returns [3m, 2]."""
    import torch

    torch.set_num_threads(1)  # for so little work threads that wait for each other cost most
    target = torch.from_numpy(contour).float()
    count = 3 * min(segments, max(2, len(contour) // 3))
    control = target[torch.arange(count) * len(target) // count]
    t = torch.arange(_SAMPLES) / _SAMPLES
    basis = torch.stack([(1 - t) ** 3, 3 * (1 - t) ** 2 * t, 3 * (1 - t) * t * t, t**3], 1)
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
    return control.double().numpy()


def _error(curve: "torch.Tensor", target: "torch.Tensor") -> "torch.Tensor":
    """Mean distance, float32 [m], of a segment's points and of the contour points nearest it."""
    import torch

    apart = torch.cdist(curve.reshape(-1, 2), target)
    back, nearest = apart.min(0)
    total = apart.amin(1).reshape(len(curve), -1).sum(1).index_add(0, nearest // _SAMPLES, back)
    return total / (_SAMPLES + torch.bincount(nearest // _SAMPLES, minlength=len(curve)))


def _quads(control: "torch.Tensor") -> "torch.Tensor":
    """The segments [m, 4, 2] of a closed path [3m, 2]."""
    import torch

    parts = control.reshape(-1, 3, 2)
    return torch.cat([parts, parts[:, :1].roll(-1, 0)], 1)


def _split(control: "torch.Tensor", which: "torch.Tensor") -> "torch.Tensor":
    """Halve some segments of a closed path by de Casteljau's construction; which: bool [m]."""
    import torch

    p, a, b, q = _quads(control).unbind(1)
    left, middle, right = (p + a) / 2, (a + b) / 2, (b + q) / 2
    before, after = (left + middle) / 2, (middle + right) / 2
    halves = torch.stack([p, left, before, (before + after) / 2, after, right], 1)
    pieces = [
        h if w else c for c, h, w in zip(control.reshape(-1, 3, 2), halves, which, strict=True)
    ]
    return torch.cat(pieces)

"""Boundary of a mask: loops along the edges of its pixels, and cubic paths fitted to them."""

from typing import Any

import numpy as np

from .paths import (
    Bools,
    Floats,
    Ints,
    Outline,
    area,
    distance,
    faults,
    fit_cubics,
    spread,
)

_STEP = np.array([[1, 0], [0, 1], [-1, 0], [0, -1]])  # right, down, left, up
_SMOOTH = -0.8  # cosine of the angle between the two sides of a joint, below which it is no corner
_SLACK = 0.15  # px by which a quantized piece may exceed the tolerance before it is split


def trace(mask: Bools, min_area: float = 4.0) -> list[Floats]:
    """Traces the borders of a mask along the edges between pixels.

    Pixels that touch only at a corner are not connected: loops may meet there, but never cross.

    Args:
        mask: bool [H, W], True inside.
        min_area: Loops that enclose a smaller area, in px², are dropped.

    Returns:
        For each loop its corners, float64 [n, 2] as (x, y) with integer values, in an order that
        makes the shoelace area positive for outer contours and negative for holes.
    """
    solid = np.pad(mask, 1)
    width = solid.shape[1]
    keys = []
    for side, (shift, axis) in enumerate(((1, 0), (-1, 1), (-1, 0), (1, 1))):
        y, x = np.nonzero(solid & ~np.roll(solid, shift, axis))
        # Edges run clockwise round their pixel; an edge is known by the corner that it starts from.
        tails = (y + (side in (2, 3))) * width + x + (side in (1, 2))
        keys.append(tails * 4 + side)
    key = np.sort(np.concatenate(keys))
    tail, way = np.divmod(key, 4)
    head = tail + _STEP[way] @ [1, width]
    following = np.zeros(len(key), np.int64)
    for turn in (3, 0, 1):  # a right turn is written last, so that it wins
        wanted = head * 4 + (way + turn) % 4
        at = np.minimum(np.searchsorted(key, wanted), len(key) - 1)
        following = np.where(key[at] == wanted, at, following)
    corner = way[np.argsort(following)] != way
    xy = np.stack([tail % width - 1, tail // width - 1], 1).astype(np.float64)
    return [p for p in (xy[c] for c in _cycles(following, corner)) if abs(area(p)) >= min_area]


def _cycles(following: Ints, keep: Bools) -> list[list[int]]:
    """Splits a permutation into its cycles, listing only the members to keep."""
    ahead, kept, cycles = following.tolist(), keep.tolist(), []
    seen = [False] * len(ahead)
    for start in range(len(ahead)):
        cycle = []
        while not seen[start]:
            seen[start] = True
            if kept[start]:
                cycle.append(start)
            start = ahead[start]
        if cycle:
            cycles.append(cycle)
    return cycles


def fit_paths(
    mask: Bools, tolerance: float = 0.6, step: float = 0.25, min_area: float = 4.0
) -> list[Ints]:
    """Fits closed cubic paths to the border of a mask, by least squares.

    Args:
        mask: bool [H, W], True inside.
        tolerance: Largest distance in px from the midpoints of pixel edges to the curve, before it
            is quantized; positive.
        step: Quantization step in px; 0.5 must be a multiple of it.
        min_area: Loops of a smaller area, in px², are dropped, but never all of them.

    Returns:
        For each loop of `trace`, in the same order, a path int64 [3m, 2] in units of `step`: P0,
        C1, C2, P1, C3, ... of m >= 2 segments, without `faults`. All points lie on the canvas.
        Straight borders between corners are exact. An empty mask gives an empty list.

    Raises:
        ValueError: `step` does not divide 0.5, or `tolerance` is not positive.
    """
    if not (step > 0 and (0.5 / step).is_integer()) or not tolerance > 0:
        raise ValueError(f"bad step {step} or tolerance {tolerance}")
    outline = outline_of(mask, min_area)
    return _settle(outline, _segment(outline, tolerance), tolerance, step) if outline else []


def outline_of(mask: Bools, min_area: float) -> Outline | None:
    """Samples of the loops that `fit_paths` keeps; None for an empty mask."""
    every = trace(mask, 0.0)
    loops = [p for p in every if abs(area(p)) >= min_area] or sorted(every, key=area)[-1:]
    return Outline.of(loops, mask.shape) if loops else None


def _reach(outline: Outline, tolerance: float) -> Ints:
    """Number of samples that one cubic from each sample can span within the tolerance, int64 [n].

    It is searched for every 16th start first, then for those in between. The end of the longest
    piece hardly ever moves back when its start moves on, so the ends that are known bound others.
    """
    limit = np.minimum(outline.until(outline.corner), (outline.size + 1) // 2)
    index = np.arange(len(limit))
    good = np.where(outline.until(outline.turns) < limit, 1, limit)
    bad, known = limit + 1, np.zeros(len(limit), np.bool_)
    for stride in (16, 4, 1):
        fresh = ~known & (outline.corner | ((index - outline.base) % stride == 0))
        if known.any():
            past, gap = np.maximum.accumulate(np.where(known, index, 0)), outline.until(known)
            ahead = np.where(gap < outline.base + outline.size - index, index + gap, -1)
            good = np.where(fresh, np.clip(past + good[past] - index, good, limit), good)
            most = np.where(ahead < 0, limit, gap + good[ahead])
            bad = np.where(fresh, np.clip(most, good, limit) + 1, bad)
        while len(active := np.flatnonzero(fresh & (bad - good > 1))):
            trial = np.where(bad > limit, np.minimum(good * 2, limit), (good + bad) // 2)[active]
            fits = _fit(outline, outline.joints, active, trial, 4)[1] <= tolerance
            good[active[fits]], bad[active[~fits]] = trial[fits], trial[~fits]
        known |= fresh
    return good


def _segment(outline: Outline, tolerance: float) -> Bools:
    """Chooses the samples at which pieces join, bool [n]: as few as their reach allows."""
    reach = _reach(outline, tolerance)
    joint = outline.corner.copy()
    for start in np.unique(outline.base):
        size = outline.size[start]
        ends = start + np.flatnonzero(outline.corner[start : start + size])
        if not len(ends):
            here, gone = np.arange(start, start + size), np.zeros(size, np.int64)
            while (gone < size).all():
                gone += reach[outline.at(here, gone)]
            ends = here[[np.argmax(gone)]]  # the start with the fewest pieces and the most slack
            joint[ends] = True
        for end, length in zip(ends, np.diff(ends, append=ends[0] + size), strict=True):
            if reach[end] < length:
                chain = outline.at(end, np.arange(length))
                joint[chain[_cuts(reach[chain])]] = True
    return joint


def _cuts(reach: Ints) -> list[int]:
    """Cuts an open chain into as few pieces as possible, of about equal slack.

    Args:
        reach: int64 [n] number of samples that a piece from each sample can span.

    Returns:
        Ascending positions of the cuts.
    """
    length = len(reach)
    ends = np.minimum(np.arange(length) + reach, length)
    need = np.zeros(length + 1, np.int64)
    for k in range(length - 1, -1, -1):
        need[k] = need[ends[k]] + 1
    cuts, here = [], 0
    while need[here] > 1:
        choice = here + 1 + np.flatnonzero(need[here + 1 : ends[here] + 1] == need[here] - 1)
        here = int(choice[len(choice) // 2])
        cuts.append(here)
    return cuts


def _fit(
    outline: Outline, joints: Floats, first: Ints, length: Ints, rounds: int, *tangents: Floats
) -> tuple[Floats, Floats]:
    """Fits a cubic to each piece, resampled to 8..128 points like others of similar length.

    Args:
        outline: The samples.
        joints: float64 [n, 2] positions of joints at samples.
        first: int64 [pieces] first sample of each piece.
        length: int64 [pieces] number of samples that it spans.
        rounds: Number of least-squares solutions.
        tangents: Start and end tangents as for `fit_cubics`, or nothing.

    Returns:
        float64 [pieces, 4, 2] control points, and float64 [pieces] errors in px.
    """
    control, error = np.zeros((len(first), 4, 2)), np.zeros(len(first))
    order = np.argsort(length, kind="stable")
    for block in np.split(order, range(512, len(order), 512)) if len(order) else ():
        span = length[block, None]
        place = np.linspace(0, 1, np.clip(span[-1, 0] + 1, 8, 128)) * span
        whole = np.minimum(place.astype(np.int64), span - 1)
        at = outline.at(first[block, None], whole)
        here, ahead = outline.points[at], outline.points[outline.at(at, 1)]
        run = here + (place - whole)[..., None] * (ahead - here)
        run[:, 0], run[:, -1] = joints[at[:, 0]], joints[outline.at(first[block], span[:, 0])]
        ends = (t[block] for t in tangents)
        control[block], error[block] = fit_cubics(run, *ends, rounds=rounds)
    return control, error


def _fit_smooth(
    outline: Outline, joints: Floats, first: Ints, length: Ints, curved: Bools, tolerance: float
) -> Floats:
    """Fits pieces with a common tangent at joints, where the tolerance allows it.

    Args:
        outline: The samples.
        joints: float64 [n, 2] positions of joints at samples.
        first: int64 [pieces] first sample of each piece.
        length: int64 [pieces] number of samples that it spans.
        curved: bool [pieces], False for pieces that stay straight.
        tolerance: Largest error in px.

    Returns:
        float64 [pieces, 4, 2] control points.
    """
    last = outline.at(first, length)
    after = np.searchsorted(first, last)
    control = np.linspace(joints[first], joints[last], 4, axis=1)
    control[curved] = _fit(outline, joints, first[curved], length[curved], 8)[0]
    start, end = _unit(control[:, 1] - control[:, 0]), _unit(control[:, 2] - control[:, 3])
    smooth = curved & curved[after] & ((end * start[after]).sum(1) < _SMOOTH)
    smooth &= ~outline.corner[last]
    common = _unit(start[after] - end)
    while True:
        tied_start, tied_end = start.copy(), np.where(smooth[:, None], -common, end)
        tied_start[after[smooth]] = common[smooth]
        which = np.union1d(np.flatnonzero(smooth), after[smooth])
        tangents = tied_start[which], tied_end[which]
        tied, error = _fit(outline, joints, first[which], length[which], 8, *tangents)
        failed = np.isin(np.arange(len(first)), which[error > tolerance])
        if not failed.any():
            control[which] = tied
            return control
        smooth &= ~failed & ~failed[after]


def _unit(v: Floats) -> Any:
    return v / np.maximum(np.hypot(*v.T), 1e-9)[:, None]


def _settle(outline: Outline, joint: Bools, tolerance: float, step: float) -> list[Ints]:
    """Fits and quantizes pieces, and repairs them until there are no `faults`; changes `joint`.

    Bad pieces are halved at first, and later replaced by straight edges through the samples. The
    polygon through all samples is simple, and lies on the grid of every valid `step`.
    """
    exact, joints = outline.corner.copy(), outline.joints.copy()
    for attempt in range(20):
        first = np.flatnonzero(joint)
        length = outline.until(joint)[first]
        last = outline.at(first, length)
        curved = ~(exact[first] & exact[last] & (outline.until(outline.turns)[first] >= length))
        control = _fit_smooth(outline, joints, first, length, curved, tolerance)
        whole = np.rint(np.clip(control, 0, outline.extent) / step).astype(np.int64)
        # Inner control points at rounded thirds would bend a slanting line. At its ends they keep
        # it straight.
        slanting = ~curved & (whole[:, 0] != whole[:, 3]).all(1)
        whole[slanting, 1:3] = whole[slanting][:, [0, 3]]
        heads = np.flatnonzero(np.diff(outline.base[first])) + 1
        paths = [p[:, :3].reshape(-1, 2) for p in np.split(whole, heads)]
        bad = np.concatenate(faults(paths, outline.positive)) & curved
        piece, place = spread(length * curved)
        samples = outline.points[outline.at(first[piece], place)]
        far = distance(samples, whole[piece] * np.float64(step))
        bad[piece[(far > tolerance + _SLACK) & (place > 0)]] = True
        if not bad.any():
            break
        if attempt < 4:
            joint[outline.at(first, length // 2)[bad]] = True
            continue
        piece, place = spread(length[bad] + 1)
        touched = outline.at(first[bad][piece], place) if attempt < 16 else np.arange(len(joint))
        exact[touched], joints[touched] = True, outline.points[touched]
        joint[touched] |= outline.turns[touched]
    return paths

"""Objects that a user points at, found in the maps of the built-in network.

Each point says of every basin of the boundary map how likely it belongs to the same object
(`pointing_scene`). A random walk with these as prior (Grady, 2005) that stops at points makes one
object of them, whose border is then drawn along the edges of the picture.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from .maps import find_maps
from .masks import Region
from .pointing_scene import Floats, Scene, scene_of
from .prompts import Point, Prompt, are_parts, pixel

Mask = NDArray[np.bool_]

SHYNESS = 6.0
"""How much boundaries part basins in the random walk."""

TRUST = 0.1
"""Weight of what points say about a basin of mean size, beside its neighbours."""

CERTAIN = 1e3
"""The same for basins that points lie in."""

INSIDE = 0.5
"""Probability from which on a basin belongs to the object."""

SPREAD = 5
"""Most points that stand for strokes or for a box."""

FILLED = 0.6
"""Share of a box that an object fills, about."""

AGAINST = -2.0
"""Logarithm of the odds of what is more like a point outside than like any inside, at most."""

KEPT = 1.5
"""Logarithm of the odds that what a mask holds, before it is refined, belongs to the object."""

SPECK = 0.02
"""Share of an object below which parts away from points, and holes, are specks."""

GUIDE_SIDE, GUIDE_RADIUS, GUIDE_EPS = 640, 4, 1e-4
"""Longer side of the copy in which borders are drawn; radius in its pixels; and regularization of
the guided filter, with colours in 0..1."""


def point_at(rgb: NDArray[np.uint8], prompts: Sequence[Prompt], jobs: int = 1) -> list[Region]:
    """Finds objects by points, boxes, strokes and masks; the plug-in `maps` of `prompters`.

    Args:
        rgb: uint8 [H, W, 3] picture in sRGB.
        prompts: Prompts, as `prompts.checked` gives them.
        jobs: Threads to use.

    Returns:
        One region a prompt, in their order, none of them empty. Only those overlap of which one is
        a part of the other.
    """
    return point_in(scene_in(rgb, jobs), rgb, prompts)


def scene_in(rgb: NDArray[np.uint8], jobs: int = 1) -> Scene:
    """Scene of a picture, uint8 [H, W, 3] in sRGB, for any number of calls of `point_in`."""
    return scene_of(rgb, find_maps(rgb, jobs))


def point_in(scene: Scene, rgb: NDArray[np.uint8], prompts: Sequence[Prompt]) -> list[Region]:
    """Finds objects as `point_at`, in the scene of a picture that is known already."""
    seeds = [_Seeds(p, scene, rgb.shape[:2]) for p in prompts]
    probable = [_probable(scene, one, seeds) for one in seeds]
    regions = []
    for k, (prompt, found) in enumerate(zip(prompts, probable, strict=True)):
        own = found.copy()
        for n, other in enumerate(probable):
            if n != k and not are_parts(prompt.name, prompts[n].name):
                own[found < other] = 0
        own[list(seeds[k].inside)] = 1
        regions.append(Region(prompt.name, _drawn(rgb, scene, own, prompt)))
    return _disjoint(regions, prompts)


class _Seeds:
    """Basins of a scene that a prompt says something about.

    Attributes:
        prompt: The prompt.
        points: Row and column of points inside, in the copy.
        against: The same of points outside.
        inside: Basins that are inside for certain.
        outside: Basins that are outside for certain.
        prior: float64 [N] logarithm of the odds by a mask, or None.
    """

    def __init__(self, prompt: Prompt, scene: Scene, size: tuple[int, int]) -> None:
        shape = scene.labels.shape
        scale = np.array(shape) / size

        def placed(points: Sequence[Point]) -> list[tuple[int, int]]:
            places = (np.array([pixel(p) for p in points]).reshape(-1, 2) + 0.5) * scale
            return [(int(r), int(c)) for r, c in np.minimum(places, np.array(shape) - 1)]

        self.prompt = prompt
        self.points, self.against = placed(prompt.inside), placed(prompt.outside)
        self.outside = {int(scene.labels[p]) for p in self.against}
        self.prior: Floats | None = None
        sure = list(self.points)
        if prompt.strokes is not None:
            strokes = _spread(prompt.strokes)
            self.points += placed(strokes)
            sure += placed(strokes)
        if prompt.box is not None:
            x, y, wide, high = prompt.box
            held = np.zeros(size, np.bool_)
            held[round(y) : max(round(y + high), round(y) + 1),
                 round(x) : max(round(x + wide), round(x) + 1)] = True  # fmt: skip
            self.outside |= set(np.flatnonzero(_share(held, scene) < 0.5).tolist())
            if not self.points:
                middle = [(x + wide * a, y + high * b) for a, b in _IN_BOX]
                self.points = placed(
                    [(min(a, size[1] - 0.5), min(b, size[0] - 0.5)) for a, b in middle]
                )
                sure += self.points[:1]
        if prompt.mask is not None:
            self.prior = KEPT * (2 * _share(prompt.mask, scene) - 1)
            sure += placed([_deepest(prompt.mask)])
        self.inside = {int(scene.labels[p]) for p in sure}
        self.outside -= self.inside


_IN_BOX = ((0.5, 0.5), (0.5, 0.3), (0.5, 0.7), (0.3, 0.5), (0.7, 0.5))
"""Places in a box, relative to its sides, that stand for it."""


def _probable(scene: Scene, one: _Seeds, everyone: Sequence[_Seeds]) -> Floats:
    """Probability, float64 [N], that basins belong to the object of a prompt."""
    odds = [_odds(scene.likeness(*p)) for p in one.points]
    if one.prior is not None:
        odds.append(one.prior)
    pooled = _in_box(np.mean(odds, 0), scene, one) if _only_box(one.prompt) else np.max(odds, 0)
    against = [_odds(scene.likeness(*p)) for p in one.against]
    if against:
        most = np.max(against, 0)
        pooled = np.where(most > pooled, AGAINST, pooled) - np.logaddexp(0, most)
    prior = 1 / (1 + np.exp(-pooled))
    trust = TRUST * scene.area / scene.area.mean()
    rivals = [
        other.inside for other in everyone
        if other is not one and not are_parts(other.prompt.name, one.prompt.name)
    ]  # fmt: skip
    outside = sorted(one.outside.union(*rivals) - one.inside)
    for basins, value in ((outside, 0.0), (sorted(one.inside), 1.0)):
        trust[basins], prior[basins] = CERTAIN, value
    walk = scene.laplacian(SHYNESS) + np.diag(trust)
    return np.asarray(np.linalg.solve(walk, trust * prior))


def _in_box(odds: Floats, scene: Scene, one: _Seeds) -> Floats:
    """Odds float64 [N] shifted so that the likeliest basins, `FILLED` of a box, are inside."""
    held = np.setdiff1d(np.arange(len(odds)), sorted(one.outside))
    falling = held[np.argsort(-odds[held], kind="stable")]
    filled = np.cumsum(scene.area[falling])
    last = falling[np.searchsorted(filled, FILLED * filled[-1])]
    return np.asarray(odds - odds[last] + 1)


def _only_box(prompt: Prompt) -> bool:
    return not prompt.inside and prompt.strokes is None and prompt.mask is None


def _odds(probability: Floats) -> Floats:
    """Logarithm of the odds."""
    return np.log(probability / (1 - probability))


def _share(mask: Mask, scene: Scene) -> Floats:
    """Share of each basin, float64 [N], that a mask of the picture holds."""
    size = scene.labels.shape[::-1]
    small = cv2.resize(mask.astype(np.float32), size, interpolation=cv2.INTER_AREA)
    return np.asarray(np.bincount(scene.labels.ravel(), small.ravel()) / scene.area)


def _deepest(mask: Mask) -> Point:
    """Middle of the pixel that is farthest inside a mask."""
    padded = np.pad(mask, 1).astype(np.uint8)
    depth = cv2.distanceTransform(padded, cv2.DIST_L2, 5)[1:-1, 1:-1]
    y, x = np.unravel_index(int(depth.argmax()), depth.shape)
    return float(x) + 0.5, float(y) + 0.5


def _spread(strokes: Mask) -> list[Point]:
    """Points of strokes that lie far from each other."""
    places = np.argwhere(strokes)
    chosen = [places[len(places) // 2]]
    apart = np.full(len(places), np.inf)
    while len(chosen) < min(SPREAD, len(places)):
        apart = np.minimum(apart, ((places - chosen[-1]) ** 2).sum(1))
        if apart.max() == 0:
            break
        chosen.append(places[int(apart.argmax())])
    return [(float(c) + 0.5, float(r) + 0.5) for r, c in chosen]


def _drawn(rgb: NDArray[np.uint8], scene: Scene, probable: Floats, prompt: Prompt) -> Mask:
    """Mask bool [H, W] of an object, from float64 [N] probabilities of basins."""
    height, width = rgb.shape[:2]
    rough = (probable >= INSIDE)[scene.labels].astype(np.float32)
    scale = min(1.0, GUIDE_SIDE / max(height, width))
    size = max(1, round(width * scale)), max(1, round(height * scale))
    guide = cv2.resize(rgb, size, interpolation=cv2.INTER_AREA).astype(np.float32) / 255
    soft = cv2.ximgproc.guidedFilter(guide, cv2.resize(rough, size), GUIDE_RADIUS, GUIDE_EPS)
    drawn = cv2.resize(cv2.GaussianBlur(soft, (0, 0), 1), (width, height)) >= 0.5
    plain = cv2.resize(rough, (width, height), interpolation=cv2.INTER_NEAREST) >= 0.5
    places = [pixel(p) for p in prompt.inside]
    if not drawn.any() or not all(drawn[p] for p in places):
        drawn = plain
    return _without_specks(drawn, places)


def _without_specks(mask: Mask, places: Sequence[tuple[int, int]]) -> Mask:
    """Mask without small holes, and without small parts that hold no point."""
    least = SPECK * mask.sum()
    result = mask.copy()
    for inside in (True, False):
        count, parts, stats, _ = cv2.connectedComponentsWithStats(
            (result == inside).astype(np.uint8), connectivity=4
        )
        small = np.flatnonzero(stats[:, cv2.CC_STAT_AREA] < least)
        held = {int(parts[p]) for p in places} if inside else set()
        specks = [k for k in small if k and k not in held and count > 2]
        result[np.isin(parts, specks)] = not inside
    return result


def _disjoint(regions: Sequence[Region], prompts: Sequence[Prompt]) -> list[Region]:
    """Regions of which the first has what several claim, unless one is a part of another."""
    result = list[Region]()
    for region in regions:
        mask = region.mask.copy()
        for other in result:
            if not are_parts(region.name, other.name):
                mask &= ~other.mask
        result.append(replace(region, mask=mask if mask.any() else region.mask))
    return result

"""Valid cases of what lies behind views: planes of their own, references; see `views`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from proxyimg_codec.geometry.boundary import Boundary
from proxyimg_codec.geometry.pose import Pose
from proxyimg_codec.model import Layer, Layers, Picture
from proxyimg_codec.texture.completion import Copies
from proxyimg_codec.texture.occlusion import Occlusion
from proxyimg_codec.texture.planes import Planes
from proxyimg_codec.texture.pyramid import PyramidTexture

from ..builders import SIZE, Numbers
from ..registry import WHOLE, Valids
from .meshes import CLOSE
from .pyramids import coded, one, view
from .views import RING, objects

CASES = Valids()
_case = CASES.case

_BACK = {"layers": ["back"]}
AWAY = Pose(shift=(6 * 1024, -3 * 1024 - 511))
"""Pose that takes the disc away from what it hides."""


def hidden(
    n: Numbers, source: Planes | None = None, alpha: Planes | None = None, **fields: Any
) -> Picture:
    """Picture of a disc that was moved over a back layer; with `fields` of the view of the back."""
    source, box = source or coded(n, SIZE, levels=3), (4, 3, 16, 12)
    ring = Boundary(4, (RING,))
    back = view(source, alpha=alpha, cuts=Occlusion.of([1], 0, [None, ring], (0, 0, *SIZE)))
    front = view(source, alpha=alpha, part=box, cuts=Occlusion.of([1], 1, [None, ring], box))
    made = objects(replace(back, **fields), front, AWAY, alpha is None)
    layers = [made.layers[0], replace(made.layers[1], boundary=ring)]
    return replace(made, layers=Layers(layers))


def references(
    n: Numbers,
    grain: int,
    offsets: int = 3,
    *,
    reach: int = 9,
    size: Sequence[int] = SIZE,
    least: int = 0,
) -> Copies:
    """References of random cells to random places.

    Args:
        n: Source of random numbers.
        grain: Binary logarithm of the side of a cell.
        offsets: Number of offsets.
        reach: Largest offset.
        size: Width and height of the part.
        least: Smallest source of a cell, 0 or 1.
    """
    cells = [-(-side >> grain) for side in reversed(size)]
    sources = n.integers(least, offsets, cells).astype(np.uint8)
    sources.flat[-1] = offsets
    return Copies(grain, n.integers(-reach, reach, (offsets, 2)).astype(np.int32), sources)


def _copying(layer: Layer, copies: Copies) -> Layer:
    """Layer with references in its view."""
    assert isinstance(layer.texture, PyramidTexture)
    return replace(layer, texture=replace(layer.texture, copies=copies))


@_case("What a moved disc hid comes from planes behind, where these have cells",
       "pyramid: behind", "pyramid: cuts", renders=[WHOLE, CLOSE, _BACK])  # fmt: skip
def _behind(n: Numbers) -> Picture:
    cells = np.ones((9, 12), bool)
    cells[:4, 5:8] = cells[7:] = False
    return hidden(n, behind=coded(n, SIZE, cell=1, cells=cells))


@_case("Planes behind with a part of the raster, alpha of their own, and a mask",
       "pyramid: behind", "pyramid: alpha", "pyramid: mask",
       renders=[WHOLE, {"width": 37}])  # fmt: skip
def _behind_alpha(n: Numbers) -> Picture:
    source, alpha = coded(n, SIZE), coded(n, SIZE, components=1)
    part = (3, 2, 17, 13)
    own, soft = coded(n, (17, 13), levels=1), coded(n, (17, 13), components=1, levels=3)
    shown = view(source, alpha=alpha, part=part, cell=2, mask=n.integers(0, 1, (4, 5)) > 0)
    return one(replace(shown, behind=own, behind_alpha=soft), opaque=False)


@_case("Planes behind a view with alpha, which have none", "pyramid: behind", renders=[_BACK])
def _behind_opaque(n: Numbers) -> Picture:
    source, alpha = coded(n, SIZE), coded(n, SIZE, components=1)
    return hidden(n, source, alpha, behind=coded(n, SIZE))


@_case("Colour behind grey", "pyramid: behind", "pyramid: components", renders=[_BACK])
def _behind_colour(n: Numbers) -> Picture:
    return hidden(n, coded(n, SIZE, components=1), behind=coded(n, SIZE))


@_case("Grey behind grey, with alpha", "pyramid: behind", renders=[_BACK])
def _behind_grey(n: Numbers) -> Picture:
    source, alpha = coded(n, SIZE, components=1), coded(n, SIZE, components=1)
    return hidden(n, source, alpha, behind=coded(n, SIZE, components=1))


@_case("Planes behind and references have no influence where all samples show",
       "pyramid: behind", "pyramid: copies")  # fmt: skip
def _behind_nothing(n: Numbers) -> Picture:
    shown = view(coded(n, SIZE))
    return one(replace(shown, behind=coded(n, SIZE), copies=references(n, 1)))


@_case("Planes in another order than textures name them", "pyramid: planes", renders=[WHOLE, _BACK])
def _behind_order(n: Numbers) -> Picture:
    source, own = coded(n, SIZE, levels=3), coded(n, SIZE)
    return replace(hidden(n, source, behind=own), planes=(own, source))


@_case("What a moved disc hid is copied, and meets what is around", "pyramid: copies",
       "pyramid: rim", renders=[WHOLE, CLOSE, _BACK])  # fmt: skip
def _copies(n: Numbers) -> Picture:
    return hidden(n, copies=references(n, 2))


@_case("Cells of one sample", "pyramid: copies", renders=[_BACK])
def _copies_fine(n: Numbers) -> Picture:
    return hidden(n, copies=references(n, 0, 7))


@_case("Cells of two samples, of which all have a source", "pyramid: copies", "pyramid: rim",
       renders=[_BACK])  # fmt: skip
def _copies_two(n: Numbers) -> Picture:
    return hidden(n, copies=references(n, 1, 1, reach=14, least=1))


@_case("One cell that is larger than the part", "pyramid: copies", "pyramid: rim", renders=[_BACK])
def _copies_one_cell(n: Numbers) -> Picture:
    return hidden(n, copies=replace(references(n, 6, 1), offsets=np.array([[-9, 4]], np.int32)))


@_case("200 offsets, whose numbers have upper bits", "pyramid: copies", renders=[_BACK])
def _copies_many(n: Numbers) -> Picture:
    return hidden(n, copies=references(n, 1, 200, reach=12))


@_case(
    "15 offsets, and 255, in two layers", "pyramid: copies", renders=[_BACK, {"layers": ["disc"]}]
)
def _copies_most(n: Numbers) -> Picture:
    made = hidden(n, copies=references(n, 2, 15))
    back, disc = made.layers
    return replace(
        made, layers=Layers([back, _copying(disc, references(n, 0, 255, size=(16, 12)))])
    )


@_case("References without a rim: nothing corrects the copies", "pyramid: copies", renders=[_BACK])
def _copies_no_rim(n: Numbers) -> Picture:
    made = hidden(n)
    back, disc = made.layers
    assert isinstance(back.texture, PyramidTexture)
    assert back.texture.cuts is not None
    copies = references(n, 0, 3, least=1)
    own = np.where(back.texture.cuts.trusted, np.uint8(0), copies.sources)
    return replace(made, layers=Layers([_copying(back, replace(copies, sources=own)), disc]))


@_case("References that lead outside of the part, to themselves, and to what is hidden too",
       "pyramid: copies", "SEC-16", renders=[_BACK])  # fmt: skip
def _copies_nowhere(n: Numbers) -> Picture:
    far, none, near = [1 << 24, -(1 << 24)], [0, 0], [1, -1]
    offsets = np.array([far, none, near, [-24, 0], [0, 18], [-9, 3]], np.int32)
    return hidden(n, copies=replace(references(n, 1, 6), offsets=offsets))


@_case("References that lead nowhere at all: everything is filled", "pyramid: copies",
       "pyramid: fill", renders=[_BACK])  # fmt: skip
def _copies_none(n: Numbers) -> Picture:
    return hidden(n, copies=replace(references(n, 2), offsets=np.full((3, 2), 30, np.int32)))


@_case("References to what is behind, beside it, with alpha", "pyramid: copies", "pyramid: behind",
       "pyramid: rim", renders=[WHOLE, _BACK])  # fmt: skip
def _copies_behind(n: Numbers) -> Picture:
    cells = np.zeros((5, 6), bool)
    cells[2, 2:4] = True
    source, alpha = coded(n, SIZE), coded(n, SIZE, components=1)
    own, soft = coded(n, SIZE, cell=2, cells=cells), coded(n, SIZE, components=1)
    return hidden(n, source, alpha, behind=own, behind_alpha=soft, copies=references(n, 1, 5))


@_case("Copies of samples of full contrast, which the correction takes beyond black and white",
       "pyramid: copies", "pyramid: rim", renders=[_BACK])  # fmt: skip
def _copies_clamped(n: Numbers) -> Picture:
    source = coded(n, SIZE, levels=1, step=384, reach=6)
    return hidden(n, source, copies=references(n, 2, 4, least=1))


@_case("A part of several tiles, of whose samples most are known", "pyramid: copies",
       "pyramid: rim", renders=[_BACK])  # fmt: skip
def _copies_large(n: Numbers) -> Picture:
    size = 150, 139
    source = coded(n, size, levels=4, step=256, reach=0)
    mask = np.ones((18, 19), bool)
    mask[6:9, 2:14] = mask[16, 17] = False
    copies = references(n, 4, 6, reach=60, size=size)
    return one(replace(view(source, cell=3, mask=mask), copies=copies))

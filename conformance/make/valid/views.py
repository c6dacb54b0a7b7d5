"""Valid cases of views of planes: masks, cuts, fill, several layers; see `pyramids`."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from proxyimg_codec.geometry.boundary import Boundary
from proxyimg_codec.geometry.pose import REST, Pose
from proxyimg_codec.model import Layer, Layers, Picture
from proxyimg_codec.texture.implicit import Box
from proxyimg_codec.texture.occlusion import Occlusion
from proxyimg_codec.texture.pyramid import PyramidTexture

from ..builders import (
    SIZE,
    Numbers,
    Path,
    bend,
    disc,
    ellipse,
    grid_mesh,
    layer,
    network,
    picture,
    polygon,
    texture,
)  # fmt: skip
from ..registry import WHOLE, Valids
from .meshes import CLOSE, TURN
from .pyramids import coded, view

CASES = Valids()
_case = CASES.case
_Mask = NDArray[np.bool_]


RING = ellipse((12, 9), (7, 5.5))
"""Boundary of the disc of `objects`."""


def objects(
    back: PyramidTexture, front: PyramidTexture, pose: Pose = REST, opaque: bool = True
) -> Picture:
    """Picture of a disc over a back layer, each with a view; the disc has a pose."""
    box = 4, 3, 16, 12
    return picture(
        SIZE,
        [
            layer("back", (0, 0, *SIZE), back),
            layer("disc", box, front, RING, pose=pose),
        ],
        opaque=opaque,
    )


def _inside(box: Box) -> _Mask:
    """Mask bool [h, w] of the pixels of a box whose centres are in the disc."""
    x, y, w, h = box
    across, down = np.arange(w) + x + 0.5 - 12, np.arange(h)[:, None] + y + 0.5 - 9
    return (across / 7) ** 2 + (down / 5.5) ** 2 < 1


def _cells(inside: _Mask, cell: int) -> _Mask:
    """Mask of the cells that have any of the samples `inside`."""
    side = 1 << cell
    h, w = inside.shape
    out = np.zeros((-(-h // side), -(-w // side)), bool)
    i, j = np.nonzero(inside)
    out[i // side, j // side] = True
    return out


@_case("Two layers show parts of the same planes, one of them moved: the fill shows",
       "pyramid: mask", "pyramid: fill", renders=[WHOLE, CLOSE, {"background": False}])  # fmt: skip
def _pyramid_moved(n: Numbers) -> Picture:
    source, box = coded(n, SIZE, levels=3), (4, 3, 16, 12)
    back = view(source, cell=1, mask=_cells(~_inside((0, 0, *SIZE)), 1))
    front = view(source, part=box, mask=_inside(box))
    return objects(back, front, Pose(shift=(5 * 1024 + 301, -3 * 1024)))


@_case("Masks of cells that the part cuts off, with alpha", "pyramid: mask", "pyramid: alpha",
       renders=[WHOLE, CLOSE])  # fmt: skip
def _pyramid_cells(n: Numbers) -> Picture:
    source, alpha = coded(n, SIZE), coded(n, SIZE, components=1)
    part = (3, 2, 17, 13)
    cells = n.integers(0, 1, (4, 5)) > 0
    back = view(source, alpha=alpha, cell=3, mask=n.integers(0, 1, (3, 3)) > 0)
    front = view(source, alpha=alpha, part=part, cell=2, mask=cells)
    return objects(back, front, Pose(shift=(-2 * 1024, 700)), opaque=False)


def _cut(n: Numbers, pose: Pose = REST) -> Picture:
    """Picture as `objects`, with views that the boundary of the disc cuts."""
    source, box = coded(n, SIZE, levels=3), (4, 3, 16, 12)
    ring = Boundary(4, (RING,))
    back = view(source, cuts=Occlusion.of([1], 0, [None, ring], (0, 0, *SIZE)))
    front = view(source, part=box, cuts=Occlusion.of([1], 1, [None, ring], box))
    made = objects(back, front, pose)
    layers = list(made.layers)
    layers[1] = replace(layers[1], boundary=ring)
    return replace(made, layers=Layers(layers))


@_case("Boundaries at rest tell which samples show", "pyramid: cuts",
       "pyramid: fill", renders=[WHOLE, CLOSE, {"layers": ["back"]}])  # fmt: skip
def _pyramid_cuts(n: Numbers) -> Picture:
    return _cut(n, Pose(shift=(6 * 1024, -3 * 1024 - 511)))


@_case("Two layers in front have equal boundaries: the one that cuts stays, the other is moved",
       "pyramid: cuts", "pyramid: moved", renders=[{"layers": ["back"]}])  # fmt: skip
def _pyramid_cuts_equal(n: Numbers) -> Picture:
    source, box, ring = coded(n, SIZE, levels=3), (4, 3, 16, 12), (RING,)
    shapes = None, Boundary(4, ring), Boundary(4, ring)
    back = view(source, cuts=Occlusion.of([2], 0, shapes, (0, 0, *SIZE)))
    front = view(source, part=box)
    moved = Pose(shift=(6 * 1024, 2000))
    return picture(
        SIZE,
        [
            layer("back", (0, 0, *SIZE), back),
            Layer("moved", box, shapes[1], front, pose=moved),
            Layer("front", box, shapes[2], front),
        ],
    )


@_case("Three layers of which two overlap, cut by each other", "pyramid: cuts",
       renders=[{"layers": [name]} for name in ("back", "disc", "triangle")])  # fmt: skip
def _pyramid_cuts_several(n: Numbers) -> Picture:
    source = coded(n, SIZE)
    shapes = None, Boundary(4, (RING,)), Boundary(4, (polygon((22, 2), (20, 16), (9, 10)),))
    boxes = (0, 0, *SIZE), (5, 3, 15, 12), (9, 2, 14, 15)
    numbers = [1, 2], [1, 2], [2]
    return picture(
        SIZE,
        [
            Layer(
                name, box, shape,
                view(source, part=box, cuts=Occlusion.of(numbers[k], k, shapes, box)),
            )
            for k, (name, box, shape) in enumerate(
                zip(("back", "disc", "triangle"), boxes, shapes, strict=True)
            )
        ],
    )  # fmt: skip


_PIECES = [{"layers": [name]} for name in ("back", "disc", "bar")]


def pieces(n: Numbers, poses: dict[str, Pose], copied: str = "") -> Picture:
    """Picture of a bar over a disc over a back layer, which cut each other, in poses.

    With `copied`, a copy of that layer is in front.
    """
    size = 40, 30
    source = coded(n, size, levels=3)
    shapes = (
        None,
        Boundary(4, (ellipse((18, 15), (12, 11)),)),
        Boundary(4, (polygon((11, 10), (36, 8), (37, 17), (12, 19)),)),
    )
    boxes = (0, 0, *size), (5, 3, 26, 24), (10, 7, 28, 13)
    layers = []
    for k, name in enumerate(("back", "disc", "bar")):
        cuts = Occlusion.of([[1, 2], [1, 2], [2]][k], k, shapes, boxes[k])
        shown = view(source, part=boxes[k], cuts=cuts)
        layers.append(Layer(name, boxes[k], shapes[k], shown, pose=poses.get(name, REST)))
    if copied:
        original = next(v for v in layers if v.name == copied)
        layers.append(replace(original, name="copy", pose=poses["copy"]))
    return picture(size, layers)


@_case("A layer is moved away between two others: what is mixed with it does not show",
       "pyramid: cuts", "pyramid: moved", renders=[WHOLE, CLOSE, *_PIECES])  # fmt: skip
def _pyramid_cuts_moved(n: Numbers) -> Picture:
    return pieces(n, {"disc": Pose(shift=(-4 * 1024, 2 * 1024 + 300))})


@_case("Two layers are moved together: what they are mixed with of each other shows",
       "pyramid: cuts", "pyramid: moved", renders=[WHOLE, CLOSE, *_PIECES])  # fmt: skip
def _pyramid_cuts_together(n: Numbers) -> Picture:
    pose = Pose(matrix=(1 << 24, 1 << 21, 0, 1 << 24), shift=(1024, -3 * 1024))
    return pieces(n, {"disc": pose, "bar": pose})


@_case("A layer that shines through, and a copy of it elsewhere", "pyramid: cuts",
       "pyramid: moved", "texture: shared",
       renders=[WHOLE, *_PIECES, {"layers": ["copy"]}])  # fmt: skip
def _pyramid_cuts_opacity(n: Numbers) -> Picture:
    return pieces(n, {"disc": Pose(opacity=40000), "copy": Pose(shift=(3 * 1024, 0))}, copied="bar")


@_case("A hidden layer that is drawn alone, and a copy of it in its place", "pyramid: cuts",
       "pyramid: moved", "texture: shared",
       renders=[WHOLE, *_PIECES, {"layers": ["copy"]}])  # fmt: skip
def _pyramid_cuts_hidden(n: Numbers) -> Picture:
    colour = (4096, 0, 0, -300, 0, 3000, 0, 200, 0, 0, 4096, 0)
    return pieces(n, {"disc": Pose(hidden=True), "copy": Pose(colour=colour)}, copied="disc")


@_case("A bent layer", "pyramid: cuts", "pyramid: moved", "pose: displacements",
       renders=[WHOLE, *_PIECES])  # fmt: skip
def _pyramid_cuts_bent(n: Numbers) -> Picture:
    mesh = grid_mesh((9, 6), 5, 4)
    made = pieces(n, {"bar": Pose(nodes=bend(n, mesh))})
    layers = list(made.layers)
    layers[2] = replace(layers[2], mesh=mesh)
    return replace(made, layers=Layers(layers))


@_case("Some of the layers are drawn: what is mixed with the others does not show",
       "pyramid: cuts", "pyramid: moved", "render: layers",
       renders=[WHOLE, {"background": False}, {"layers": ["back", "disc"]},
                {"layers": ["back", "bar"]}, *_PIECES])  # fmt: skip
def _pyramid_cuts_subset(n: Numbers) -> Picture:
    return pieces(n, {})


@_case("Two layers are recoloured alike, and differ from what is behind",
       "pyramid: cuts", "pyramid: moved", "pose: colour matrix")  # fmt: skip
def _pyramid_cuts_colour(n: Numbers) -> Picture:
    colour = Pose(colour=(0, 4096, 0, -300, 4096, 0, 0, 200, 0, 0, 2048, 0))
    return pieces(n, {"disc": colour, "bar": colour})


@_case("A layer between two others got another texture: what is mixed with the old one is gone",
       "pyramid: cuts", "pyramid: moved", "pyramid: planes")  # fmt: skip
def _pyramid_cuts_other(n: Numbers) -> Picture:
    return _textured(pieces(n, {}), "disc", view(coded(n, (26, 24))))


@_case("Layers show the same planes as what they cut, but elsewhere and stretched",
       "pyramid: cuts", "pyramid: moved", renders=[WHOLE, CLOSE])  # fmt: skip
def _pyramid_cuts_elsewhere(n: Numbers) -> Picture:
    made = pieces(n, {})
    source = made.planes[0]
    made = _textured(made, "disc", view(source, part=(6, 3, 26, 24)))
    return _textured(made, "bar", view(source, part=(10, 7, 14, 13)))


@_case("The boundaries of layers are filled, not unmixed", "pyramid: cuts", "pyramid: moved",
       renders=[WHOLE, CLOSE, {"layers": ["disc"]}])  # fmt: skip
def _pyramid_cuts_filled(n: Numbers) -> Picture:
    made = pieces(n, {"disc": Pose(shift=(-4 * 1024, 2 * 1024 + 300))})
    for each in made.layers[1:]:
        shown = each.texture
        assert isinstance(shown, PyramidTexture)
        assert shown.cuts is not None
        made = _textured(made, each.name, replace(shown, cuts=replace(shown.cuts, unmix=False)))
    return made


def _textured(made: Picture, name: str, texture: PyramidTexture) -> Picture:
    """Picture in which a layer shows another texture."""
    layers = [replace(v, texture=texture) if v.name == name else v for v in made.layers]
    return replace(made, layers=Layers(layers))


def _masked(made: Picture, name: str, mask: _Mask, cell: int) -> Picture:
    """Picture with a mask beside the cuts of a layer."""
    layers = list(made.layers)
    at = [v.name for v in layers].index(name)
    shown = layers[at].texture
    assert isinstance(shown, PyramidTexture)
    assert shown.cuts is not None
    _, _, w, h = shown.part
    within = mask.repeat(1 << cell, 0)[:h].repeat(1 << cell, 1)[:, :w]
    cuts = replace(shown.cuts, within=within)
    layers[at] = replace(layers[at], texture=replace(shown, mask=mask, cell=cell, cuts=cuts))
    return replace(made, layers=Layers(layers))


@_case("A mask and cuts together", "pyramid: cuts", "pyramid: mask", "pyramid: fill",
       renders=[WHOLE, CLOSE, {"layers": ["back"]}, {"layers": ["disc"]}])  # fmt: skip
def _pyramid_cuts_mask(n: Numbers) -> Picture:
    made = _cut(n, Pose(shift=(6 * 1024, -3 * 1024 - 511)))
    back = np.ones((9, 12), bool)
    back[2:5, 1:4] = False
    front = np.arange(16)[None] + np.arange(12)[:, None] > 8
    return _masked(_masked(made, "back", back, 1), "disc", front, 0)


@_case("A mask of what cuts take as a whole: all of the mask shows", "pyramid: cuts",
       "pyramid: mask", renders=[{"layers": ["back"]}])  # fmt: skip
def _pyramid_cuts_mask_all(n: Numbers) -> Picture:
    return _masked(_cut(n), "back", _inside((-4, -3, *SIZE)) & _inside((4, 3, *SIZE)), 0)


@_case("Cuts that leave nothing: all samples show", "pyramid: cuts",
       renders=[{"layers": ["back"]}])  # fmt: skip
def _pyramid_cuts_all(n: Numbers) -> Picture:
    whole = Boundary(4, (polygon((-5, -5), (40, -5), (40, 40), (-5, 40)),))
    size = 10, 8
    cuts = Occlusion.of([1], 0, [None, whole], (0, 0, *size))
    source = coded(n, size)
    back = layer("back", (0, 0, *size), view(source, cuts=cuts))
    front = Layer("front", (0, 0, *size), whole, view(source, part=(0, 0, 5, 4)))
    return picture(size, [back, front])


@_case("A bent and turned layer", "pyramid: sampling", "pose: displacements",
       renders=[WHOLE, CLOSE])  # fmt: skip
def _pyramid_bent(n: Numbers) -> Picture:
    mesh = grid_mesh((2, 1), 5, 4)
    source, box = coded(n, SIZE), (4, 3, 16, 12)
    made = objects(view(source), view(source, part=box), Pose(nodes=bend(n, mesh), **TURN))
    layers = list(made.layers)
    layers[1] = replace(layers[1], mesh=mesh)
    return replace(made, layers=Layers(layers))


@_case("A layer that shows the view of another, in a box and with a mask and cuts of that",
       "texture: shared", "pyramid: cuts")  # fmt: skip
def _pyramid_shared(n: Numbers) -> Picture:
    made = _cut(n)
    back, front = made.layers
    shape: Path = polygon((1, 1), (11, 2), (9, 8), (2, 7))
    copy = layer("copy", (0, 1, 12, 8), front.texture, shape)
    other = layer("other", (13, 9, 11, 9), back.texture, polygon((13, 9), (23, 11), (15, 17)))
    return replace(made, layers=Layers([back, front, copy, other]))


@_case("Implicit and pyramid textures in one picture", "texture: coders", "pyramid: planes")
def _pyramid_mixed(n: Numbers) -> Picture:
    first, second = coded(n, (9, 8)), coded(n, (16, 12), levels=3)
    return picture(
        SIZE,
        [
            layer("back", (0, 0, *SIZE), texture(n)),
            disc(n),
            layer("shown", (2, 2, 9, 8), view(first), ellipse((6, 6), (4, 3.5))),
            layer("large", (10, 5, 13, 12), view(second), polygon((11, 6), (22, 8), (14, 16))),
        ],
        network(n),
    )

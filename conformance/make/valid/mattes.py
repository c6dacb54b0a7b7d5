"""Valid cases of soft layers: views with a matte; see `views`."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from proxyimg_codec.geometry.pose import Pose
from proxyimg_codec.model import Layers, Picture
from proxyimg_codec.texture.pyramid import PyramidTexture

from ..builders import SIZE, Numbers, ellipse, layer
from ..registry import WHOLE, Valids
from .behind import references
from .meshes import CLOSE
from .pyramids import coded, one, view
from .views import pieces

CASES = Valids()
_case = CASES.case

_AWAY = Pose(shift=(-4 * 1024, 2 * 1024 + 300))
_ALONE = [{"layers": [name]} for name in ("back", "disc", "bar")]


def softened(n: Numbers, made: Picture, *names: str, **fields: Any) -> Picture:
    """Picture in which some layers are soft: some cells of theirs; with `fields` of their views."""
    layers = list(made.layers)
    for i, each in enumerate(layers):
        if each.name not in names:
            continue
        shown = each.texture
        assert isinstance(shown, PyramidTexture)
        size = shown.part[2:]
        cells = n.integers(0, 2, [-(-side >> 2) for side in reversed(size)]) > 0
        cells[0, 0], cells[-1, -1] = False, True
        matte = coded(n, size, components=1, cell=2, cells=cells, reach=9)
        cuts = shown.cuts and replace(shown.cuts, unmix=False)
        own = {"behind": coded(n, size), "matte": matte, "cuts": cuts, **fields}
        layers[i] = replace(each, texture=replace(shown, **own))
    return replace(made, channels=4, layers=Layers(layers))


@_case("A soft layer at rest, and alone", "pyramid: matte", renders=[WHOLE, CLOSE, *_ALONE])
def _matte(n: Numbers) -> Picture:
    return softened(n, pieces(n, {}), "disc")


@_case("A soft layer is moved away between two others", "pyramid: matte", "pyramid: moved",
       renders=[WHOLE, CLOSE])  # fmt: skip
def _matte_moved(n: Numbers) -> Picture:
    return softened(n, pieces(n, {"disc": _AWAY}), "disc")


@_case("What covers a soft layer is moved away: what was hidden of it is soft", "pyramid: matte",
       "pyramid: moved", "pyramid: copies")  # fmt: skip
def _matte_bared(n: Numbers) -> Picture:
    copies = references(n, 2, size=(26, 24))
    return softened(n, pieces(n, {"bar": Pose(shift=(0, 9 * 1024))}), "disc", copies=copies)


@_case("Two soft layers, of which the lower one moves, and of which a copy rests in front",
       "pyramid: matte", "pyramid: moved", "texture: shared")  # fmt: skip
def _matte_two(n: Numbers) -> Picture:
    made = pieces(n, {"disc": _AWAY, "copy": Pose(opacity=50000)}, copied="bar")
    made = softened(n, made, "disc", "bar")
    bar = next(v for v in made.layers if v.name == "bar")
    copy = replace(made.layers[-1], texture=bar.texture)
    return replace(made, layers=Layers([*made.layers[:-1], copy]))


@_case("A layer comes to lie behind the rim of a soft one, whose own back rests", "pyramid: matte",
       "pyramid: moved")  # fmt: skip
def _matte_over(n: Numbers) -> Picture:
    made = softened(n, pieces(n, {}), "bar")
    back, disc, bar = made.layers
    square = layer("square", (0, 0, 9, 8), view(coded(n, (9, 8))), ellipse((4, 4), (4, 4)),
                   pose=Pose(shift=(20 * 1024, 9 * 1024)))  # fmt: skip
    return replace(made, layers=Layers([back, disc, square, bar]))


@_case("A soft layer that rests hides nothing of what has changed behind it", "pyramid: matte",
       "pyramid: moved", renders=[{"layers": v} for v in (["disc", "bar"], ["back", "bar"])],
       )  # fmt: skip
def _matte_between(n: Numbers) -> Picture:
    return softened(n, pieces(n, {}), "disc", "bar")


@_case("A matte in a view that its own layer does not cut is always seen", "pyramid: matte",
       "pyramid: mask", "pyramid: alpha")  # fmt: skip
def _matte_masked(n: Numbers) -> Picture:
    source, alpha = coded(n, SIZE), coded(n, SIZE, components=1)
    shown = view(
        source, alpha=alpha, part=(3, 2, 17, 13), cell=2, mask=n.integers(0, 1, (4, 5)) > 0
    )
    return softened(
        n, one(shown, opaque=False), "back", behind_alpha=coded(n, (17, 13), components=1)
    )


@_case("A matte in a view without mask and cuts, all of whose cells are stored", "pyramid: matte",
       renders=[WHOLE, {"width": 37}])  # fmt: skip
def _matte_all(n: Numbers) -> Picture:
    shown = view(coded(n, SIZE, components=1))
    matte = coded(n, SIZE, components=1, reach=9)
    return softened(n, one(shown, opaque=False), "back", matte=matte)

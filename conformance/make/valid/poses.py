"""Valid cases of poses, that is of moved, recoloured and hidden layers, and of shared textures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from proxyimg_codec.geometry.pose import Pose
from proxyimg_codec.model import Layers, Picture
from proxyimg_codec.texture.implicit import ImplicitTexture

from ..builders import (
    SIZE,
    Numbers,
    bend,
    disc,
    ellipse,
    grid_mesh,
    layer,
    layered,
    network,
    on_back,
    picture,
    polygon,
    texture,
)  # fmt: skip
from ..registry import WHOLE, Valid, Valids
from .meshes import CLOSE, TURN, UNIT

CASES = Valids()
_case = CASES.case


def _affine(name: str, title: str, matrix: Sequence[int], shift: tuple[int, int]) -> None:
    """Registers a case with an affine map."""

    def build(n: Numbers) -> Picture:
        a, b, c, d = matrix
        return on_back(n, disc(n, matrix=(a, b, c, d), shift=shift))

    CASES[name] = Valid(title, ("pose: affine",), build, [WHOLE, CLOSE])


_affine("moved", "Moved by parts of a pixel", (UNIT, 0, 0, UNIT), (3 * 1024 + 301, -2 * 1024 - 77))
_affine("turned", "Turned", TURN["matrix"], (12001, -6003))
_affine("flipped", "Mirrored", (-UNIT, 0, 0, UNIT), (24 * 1024 + 513, 0))
_affine("sheared", "Sheared", (UNIT, UNIT // 5, -UNIT // 3, UNIT), (3001, -2503))
_affine("hundredfold", "Enlarged a hundred times about a point of its edge",
        (100 * UNIT, 0, 0, 100 * UNIT), (-99 * 6 * 1024, -99 * 6 * 1024))  # fmt: skip
_affine("pressed", "Pressed to a quarter and stretched", (UNIT // 4, 0, 0, UNIT * 2), (9001, -9003))


@_case("A moved layer with a control point that is clamped before it is mapped",
       "pose: affine", "outline: clamping")  # fmt: skip
def _clamped(n: Numbers) -> Picture:
    far = polygon((4, 4), (1 << 21, 1 << 20), (3, 12), unit=0)
    pose = Pose(shift=(-1024, 512))
    return on_back(n, layer("far", (0, 0, *SIZE), texture(n), far, unit=0, pose=pose))


@_case("A back layer without boundary is turned: its outline is the turned canvas",
       "outline: the whole canvas", renders=[WHOLE, CLOSE])  # fmt: skip
def _turned_back(n: Numbers) -> Picture:
    image = on_back(n, disc(n))
    back = replace(image.layers[0], pose=Pose(**TURN))
    return replace(image, opaque=False, layers=Layers([back, image.layers[1]]))


@_case("Layers of less than full opacity, one of them with alpha", "pose: opacity")
def _opacity(n: Numbers) -> Picture:
    image = layered(n, channels=4)
    shares = (65535, 40000, 123)
    layers = [
        replace(v, pose=Pose(opacity=share)) if share < 65535 else v
        for v, share in zip(image.layers, shares, strict=True)
    ]
    return replace(image, layers=Layers(layers))


@_case("A hidden layer is drawn only if it is asked for", "pose: hidden",
       renders=[WHOLE, {"layers": ["disc"]}, {"layers": ["triangle", "disc"]}])  # fmt: skip
def _hidden(n: Numbers) -> Picture:
    image = layered(n)
    hidden = replace(image.layers[1], pose=Pose(hidden=True))
    return replace(image, layers=Layers([image.layers[0], hidden, image.layers[2]]))


@_case("All layers are hidden: an empty picture", "pose: hidden")
def _all_hidden(n: Numbers) -> Picture:
    shape = ellipse((4, 4), (3, 3))
    only = layer("disc", (0, 0, 8, 8), texture(n), shape, pose=Pose(hidden=True))
    return picture((8, 8), [only], network(n), opaque=False)


_MIX = (1500, 3000, -900, 700, -2500, 6000, 1000, 200, 300, -4000, 5000, 1500)


@_case("Colour matrices, whose results are clamped", "pose: colour matrix")
def _colours(n: Numbers) -> Picture:
    image = replace(layered(n), networks=(network(n, contrast=1.5),))
    back = replace(image.layers[0], pose=Pose(colour=(0, 4096, 0, 0, 0, 0, 4096, 0, 4096, 0, 0, 0)))
    mixed = replace(image.layers[1], pose=Pose(colour=_MIX))
    bright = replace(image.layers[2], pose=Pose(colour=(30000, -30000, 0, 2000) * 3))
    return replace(image, layers=Layers([back, mixed, bright]))


@_case("Colour matrices and opacity on layers with alpha", "pose: colour matrix", "pose: opacity",
       "alpha")  # fmt: skip
def _colours_alpha(n: Numbers) -> Picture:
    image = layered(n, channels=4)
    poses = Pose(colour=_MIX), Pose(colour=_MIX[::-1], opacity=50001), Pose(colour=_MIX)
    layers = [replace(v, pose=p) for v, p in zip(image.layers, poses, strict=True)]
    return replace(image, layers=Layers(layers))


@_case("Layers that show the texture of another in boxes of their own", "texture: shared")
def _shared(n: Numbers) -> Picture:
    image = layered(n)
    back, original, _ = image.layers
    shown = original.texture
    shape = polygon((20, 3), (31, 6), (24, 20))
    copies = [
        layer("copy", (18, 2, 12, 20), shown, shape),
        replace(original, name="turned", pose=Pose(**TURN)),
        layer("behind", (0, 14, 9, 10), back.texture, ellipse((5, 19), (4, 4))),
    ]
    return replace(image, layers=Layers([back, original, *copies]))


@_case("Texture displacements move what shows and not the outline", "pose: texture displacements",
       renders=[WHOLE, CLOSE])  # fmt: skip
def _texture_displaced(n: Numbers) -> Picture:
    mesh = grid_mesh((2, 1), 5, 4, split=[[3, 8, 9, 21]])
    return on_back(n, disc(n, mesh, places=bend(n, mesh, 70)))


@_case("Both kinds of displacements, and an affine map", "pose: texture displacements",
       "pose: order", renders=[WHOLE, CLOSE])  # fmt: skip
def _all_displaced(n: Numbers) -> Picture:
    mesh = grid_mesh((2, 1), 5, 4)
    return on_back(n, disc(n, mesh, nodes=bend(n, mesh), places=bend(n, mesh, 70), **TURN))


@_case("The back layer of an opaque picture: other colours, and its texture displaced", "opaque",
       "pose: texture displacements", renders=[WHOLE, {"background": False}])  # fmt: skip
def _opaque_posed(n: Numbers) -> Picture:
    mesh = grid_mesh((-1, -1), 2, 2, step=(832, 640))
    image = on_back(n, disc(n))
    pose = Pose(places=bend(n, mesh, 60), colour=_MIX)
    back = replace(image.layers[0], mesh=mesh, pose=pose)
    return replace(image, layers=Layers([back, image.layers[1]]))


@_case("Networks with and without alpha in a picture that is opaque all the same", "opaque",
       "networks: channels", "alpha", renders=[WHOLE, {"background": False}])  # fmt: skip
def _mixed_channels(n: Numbers) -> Picture:
    image = on_back(n, disc(n))
    clear = network(n, channels=4, contrast=1.5)
    texture = image.layers[1].texture
    assert isinstance(texture, ImplicitTexture)
    glass = replace(image.layers[1], texture=replace(texture, network=1))
    layers = Layers([image.layers[0], glass])
    return replace(image, channels=4, networks=(*image.networks, clear), layers=layers)


@_case("A mesh that nothing needs", "mesh: at rest")
def _at_rest(n: Numbers) -> Picture:
    return on_back(n, disc(n, grid_mesh((2, 1), 5, 4, split=[[3, 8, 9, 21]])))

"""Valid cases of layers: order, boundaries, coverage, alpha."""

from __future__ import annotations

from dataclasses import replace

from proxyimg_codec.model import Picture

from ..builders import (
    SIZE,
    Numbers,
    ellipse,
    layer,
    layered,
    network,
    on_back,
    picture,
    polygon,
    texture,
)  # fmt: skip
from ..registry import WHOLE, Valids

CASES = Valids()
_case = CASES.case


@_case("One opaque layer without boundary", "file", "entropy", "coverage: none",
       "texture: bilinear", "network", "render: whole", "MET-1")  # fmt: skip
def _one_layer(n: Numbers) -> Picture:
    back = layer("back", (0, 0, 24, 20), texture(n, grid=(6, 5)))
    return picture((24, 20), [back], network(n, octaves=2, depth=2))


@_case("Three layers that overlap", "compositing: order", "boundary: coding", "coverage: edges",
       "coverage: curves")  # fmt: skip
def _layers(n: Numbers) -> Picture:
    return layered(n)


@_case("A ring: the inner path runs the other way", "coverage: hole", "coverage: nonzero")
def _hole(n: Numbers) -> Picture:
    outer = ellipse((16, 12), (13, 10.5))
    inner = ellipse((17.5, 12), (6.25, 5), reverse=True)
    back = layer("back", (0, 0, 32, 24), texture(n))
    return picture((32, 24), [back, layer("ring", (2, 1, 28, 22), texture(n), outer, inner)],
                   network(n))  # fmt: skip


@_case("Paths that overlap and run the same way, and one that runs the other way around nothing",
       "coverage: nonzero", "coverage: clamping")  # fmt: skip
def _winding(n: Numbers) -> Picture:
    paths = (
        polygon((2, 2), (20, 2), (20, 15), (2, 15)),
        polygon((10, 8), (28, 8), (28, 21), (10, 21)),
        polygon((24, 1), (30, 1), (30, 5.5), (24, 5.5), reverse=True),
    )
    back = layer("back", (0, 0, 32, 24), texture(n))
    return picture((32, 24), [back, layer("boxes", (0, 0, 32, 24), texture(n), *paths)],
                   network(n))  # fmt: skip


@_case("A layer of two components", "coverage: components")
def _components(n: Numbers) -> Picture:
    paths = ellipse((7, 8), (5, 6)), polygon((18, 3), (29, 9), (20, 21), (15, 13))
    back = layer("back", (0, 0, 32, 24), texture(n))
    return picture((32, 24), [back, layer("two", (1, 2, 29, 20), texture(n), *paths)], network(n))


@_case("Paths that lie on the border of the canvas, and one that leaves it on every side",
       "coverage: border", "coverage: outside the canvas")  # fmt: skip
def _border(n: Numbers) -> Picture:
    w, h = 28, 20
    frame = polygon((0, 0), (w, 0), (w, h), (0, h)), ellipse((14, 10), (9, 7), reverse=True)
    cross = ellipse((0, 3), (6, 8)), ellipse((30, 19.5), (9, 7)), polygon((9, -9), (12, 9), (8, 33))
    return picture(
        (w, h),
        [
            layer("back", (0, 0, w, h), texture(n)),
            layer("frame", (0, 0, w, h), texture(n), *frame),
            layer("cross", (-6, -9, 45, 42), texture(n, grid=(7, 7)), *cross),
        ],
        network(n),
    )


@_case("Deltas of 15 bits and more, in units of 1/64 pixel", "boundary: escape", "boundary: unit")
def _escape(n: Numbers) -> Picture:
    far = polygon((-900, 8), (2000.5, -700), (12, 14), (1500, 900.25), unit=6)
    back = layer("back", (0, 0, 32, 24), texture(n))
    shape = layer("far", (0, 0, 32, 24), texture(n), far, unit=6)
    return picture((32, 24), [back, shape], network(n))


@_case("A box smaller than the layer: beyond it the rim goes on", "texture: rim", "boundary: unit")
def _rim(n: Numbers) -> Picture:
    disc = layer("disc", (12, 9, 7, 5), texture(n), ellipse((15, 11), (14, 10), unit=0), unit=0)
    return picture((32, 24), [layer("back", (5, -4, 40, 20), texture(n)), disc], network(n))


@_case("Four outputs: layers with alpha that overlap", "alpha", "compositing: alpha",
       renders=[WHOLE, {"background": False}, {"width": 13}])  # fmt: skip
def _alpha(n: Numbers) -> Picture:
    return layered(n, channels=4)


@_case("Three outputs and no opaque back layer", "alpha: from coverage alone",
       renders=[WHOLE, {"background": False}])  # fmt: skip
def _no_back(n: Numbers) -> Picture:
    image = layered(n)
    return replace(image, opaque=False, layers=type(image.layers)(image.layers[1:]))


@_case("Several layers with several holes each, through which others and nothing show",
       "coverage: hole", "compositing: order", "alpha: from coverage alone",
       renders=[WHOLE, {"region": [4, 3, 9, 7], "width": 36}])  # fmt: skip
def _holes(n: Numbers) -> Picture:
    w, h = SIZE
    sheet = polygon((1, 1), (w - 1, 1), (w - 1, h - 1), (1, h - 1))
    first = sheet, ellipse((8, 8), (4, 4), reverse=True), ellipse((17, 9), (3, 5), reverse=True)
    second = (
        ellipse((12, 9), (11, 8)),
        polygon((5, 5), (11, 6), (8, 13), reverse=True),
        polygon((14, 4), (20, 9), (14, 14), reverse=True),
        ellipse((17, 9), (1.5, 1.5)),
    )
    return picture(
        SIZE,
        [
            layer("first", (0, 0, w, h), texture(n), *first),
            layer("second", (0, 0, w, h), texture(n), *second),
            layer("third", (3, 2, 16, 12), texture(n), ellipse((11, 9), (9, 3)),
                  ellipse((8, 9), (2, 2), reverse=True), ellipse((14, 9), (2, 2), reverse=True)),
        ],
        network(n),
        opaque=False,
    )  # fmt: skip


@_case("Boundaries in all units, from whole pixels to 1/64", "boundary: unit", "GEO-7",
       renders=[WHOLE, {"width": 53}])  # fmt: skip
def _units(n: Numbers) -> Picture:
    w, h = SIZE
    shown = texture(n)
    parts = []
    for unit in range(7):
        x = 1.4 + 3.1 * unit
        shape = polygon((x, 1.3), (x + 3.7, 4.2), (x + 1.1, 16.6), unit=unit)
        parts.append(layer(f"in {1 << unit}", (0, 0, w, h), shown, shape, unit=unit))
    return on_back(n, *parts)

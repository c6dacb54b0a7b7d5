"""More valid cases: parts of pictures, other sizes, and canvases of extreme shape."""

from __future__ import annotations

from proxyimg_codec.model import Picture

from .builders import Numbers, ellipse, layer, layered, network, picture, texture
from .registry import WHOLE, Valids

CASES = Valids()
_case = CASES.case


@_case("Some layers only, in whatever order they are named; no background",
       "render: layers", "render: background",
       renders=[{"layers": ["triangle"]}, {"layers": ["triangle", "disc"]}, {"layers": ["back"]},
                {"layers": ["disc", "back"], "background": False},
                {"background": False}])  # fmt: skip
def _layer_subset(n: Numbers) -> Picture:
    return layered(n)


@_case("Parts of the canvas, also enlarged and reduced", "render: region",
       renders=[{"region": [9, 5, 11, 13]}, {"region": [30, 23, 2, 1], "width": 9},
                {"region": [3, 2, 27, 20], "width": 10, "height": 9}])  # fmt: skip
def _region(n: Numbers) -> Picture:
    return layered(n)


@_case("Enlarged, evenly and unevenly", "render: enlarging", "coverage: scaling",
       renders=[{"width": 64}, {"height": 72}, {"width": 40, "height": 61}])  # fmt: skip
def _enlarged(n: Numbers) -> Picture:
    return layered(n)


@_case("Reduced by whole and broken factors, also on one axis", "render: averaging",
       renders=[{"width": 16}, {"width": 13}, {"width": 1}, {"width": 5, "height": 24},
                {"width": 50, "height": 7}])  # fmt: skip
def _reduced(n: Numbers) -> Picture:
    return layered(n)


@_case("One pixel", "canvas: smallest", renders=[WHOLE, {"width": 7}])
def _pixel(n: Numbers) -> Picture:
    dot = layer("dot", (0, 0, 1, 1), texture(n, grid=(2, 2)), ellipse((0.5, 0.5), (0.4, 0.3)))
    back = layer("back", (0, 0, 1, 1), texture(n, grid=(2, 2)))
    return picture((1, 1), [back, dot], network(n))


@_case("One column", "canvas: aspect", renders=[WHOLE, {"width": 3, "height": 40}])
def _column(n: Numbers) -> Picture:
    back = layer("back", (0, 0, 1, 64), texture(n, grid=(2, 9)))
    return picture((1, 64), [back], network(n))


@_case("Two very long rows", "canvas: aspect", "render: rounding of the other side",
       renders=[WHOLE, {"width": 64}])  # fmt: skip
def _long_rows(n: Numbers) -> Picture:
    thin = layer("thin", (3, 0, 1500, 2), texture(n), ellipse((700, 1), (650, 0.75)))
    return picture((1600, 2), [layer("back", (0, 0, 1600, 2), texture(n)), thin], network(n))

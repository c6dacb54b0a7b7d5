"""Valid cases of parts of pictures, of other sizes, and of canvases of extreme aspect ratio."""

from __future__ import annotations

from proxyimg_codec.model import Picture

from ..builders import Numbers, ellipse, grid_mesh, layer, layered, network, picture, texture
from ..registry import WHOLE, Build, Valid, Valids

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


LONG = 4096


def _thin(size: tuple[int, int], sampling: int) -> Build:
    """Builder of a canvas one pixel wide or high, with direct or node sampling."""

    def build(n: Numbers) -> Picture:
        w, h = size
        dim = 3 * (1 + sampling)
        # Two by two cells of 16 steps each, a little larger than the canvas.
        across, down = (n_pixels * 32 + 64 for n_pixels in size)
        mesh = grid_mesh((-1, -1), 2, 2, step=(across, down)) if sampling else None
        shape = ellipse((w * 0.6, h * 0.6), (w * 0.3, h * 0.3))
        planes = [texture(n, grid=(9, 2) if w > h else (2, 9)) for _ in range(2)]
        layers = [
            layer("back", (0, 0, w, h), planes[0], mesh=mesh, sampling=sampling),
            layer("thin", (w // 4, h // 4, w - w // 4, h - h // 4), planes[1], shape, mesh=mesh,
                  sampling=sampling),
        ]  # fmt: skip
        return picture(size, layers, network(n, dim=dim))

    return build


for _name, _size, _small in (
    ("column-4096", (1, LONG), {"width": 1, "height": 64}),
    ("row-4096", (LONG, 1), {"width": 64, "height": 1}),
):
    CASES[_name] = Valid(
        f"A canvas of {_size[0]} by {_size[1]} pixels", ("canvas: aspect", "render: averaging"),
        _thin(_size, 0), [WHOLE, _small],
    )  # fmt: skip
    CASES[f"{_name}-node"] = Valid(
        f"A canvas of {_size[0]} by {_size[1]} pixels, sampled at nodes",
        ("canvas: aspect", "sampling: node"), _thin(_size, 1), [_small],
    )  # fmt: skip


CASES["pixel-node"] = Valid(
    "One pixel, sampled at nodes", ("canvas: smallest", "sampling: node"), _thin((1, 1), 1),
    [WHOLE, {"width": 7}],
)  # fmt: skip

"""Outlines as SVG: exact coordinates, order, names, colours."""

import re
from fractions import Fraction
from xml.etree import ElementTree

import numpy as np
import pytest

import proxyimg_codec as pxi
from proxyimg_codec.export import svg
from proxyimg_codec.geometry.boundary import COORDINATE_MAX, Boundary
from proxyimg_codec.model import Layers
from tests.support.images import changed

LABEL = "{http://www.inkscape.org/namespaces/inkscape}label"


@pytest.fixture(scope="module")
def image(small_pxi):
    return pxi.open(small_pxi)


def elements(data: bytes) -> list[ElementTree.Element]:
    return list(ElementTree.fromstring(data))


def local(element: ElementTree.Element) -> str:
    return element.tag.removeprefix("{http://www.w3.org/2000/svg}")


def test_canvas_order_and_names(image):
    data = svg.build(image)
    root = ElementTree.fromstring(data)
    assert local(root) == "svg"
    assert [root.get(k) for k in ("width", "height", "viewBox")] == ["64", "48", "0 0 64 48"]
    assert [(local(e), e.get("id"), e.get(LABEL)) for e in root] == [
        ("rect", "back", "back"), ("path", "bar", "bar"), ("path", "disc", "disc"),
    ]  # fmt: skip
    assert [root[0].get(k) for k in ("width", "height")] == ["64", "48"]
    assert [e.get("fill-rule") for e in root[1:]] == ["nonzero", "nonzero"]


def read(text: str, unit: int) -> list[list[tuple[int, int]]]:
    """Control points of path data, by a parser that knows only what is written here."""
    paths = []
    for part in text.split("Z")[:-1]:
        start, curves = re.fullmatch(r"\s*M (\S+) C (.*) ", part).groups()
        points = [
            tuple(Fraction(v) * (1 << unit) for v in p.split(","))
            for p in [start, *curves.split(" ")]
        ]
        assert points[0] == points[-1]
        assert all(v.denominator == 1 for p in points for v in p)
        paths.append(points[:-1])
    return paths


@pytest.mark.parametrize("unit", range(7))
def test_coordinates_are_exact(unit):
    rng = np.random.default_rng(unit)
    top = COORDINATE_MAX - 1
    paths = tuple(rng.integers(-top, top, (3 * m, 2), endpoint=True) for m in (1, 4))
    paths[0][:] = [[0, -1], [top, -top], [10, 100]]
    text = svg.path_data(Boundary(unit, paths))
    assert "e" not in text
    got = read(text, unit)
    assert [np.array(p, float).tolist() for p in got] == [p.tolist() for p in paths]


def test_moved_layers_are_where_they_are_now(image):
    moved = image.layers["disc"].moved(3.25, -2).layers["disc"]
    text = elements(svg.build(moved.image))[2].get("d")
    got = read(text, moved.outline.unit)
    rest, unit = image.layers["disc"].boundary.paths[0], image.layers["disc"].boundary.unit
    shift = np.array([3.25, -2]) * (1 << moved.outline.unit)
    assert (np.array(got[0], float) == rest * (1 << moved.outline.unit - unit) + shift).all()


def test_fill_is_the_mean_colour(image):
    for element in elements(svg.build(image)):
        alone = image.render(layers=[element.get("id")], dtype=np.float32)
        weight = alone[..., 3:] if alone.shape[2] == 4 else np.ones_like(alone[..., :1])
        mean = (alone[..., :3] * weight).sum((0, 1)) / weight.sum() * 255
        fill = [int(element.get("fill")[i : i + 2], 16) for i in (1, 3, 5)]
        assert np.abs(np.array(fill) - mean).max() < 1


def test_opacity_and_visibility(image):
    poses = {"bar": {"opacity": 32768}, "disc": {"hidden": True}}
    layers = [changed(v, pose=changed(v.pose, **poses.get(v.name, {}))) for v in image.layers]
    before = elements(svg.build(image))
    back, bar, disc = elements(svg.build(changed(image, layers=Layers(layers))))
    assert (back.get("opacity"), back.get("display")) == (None, None)
    assert float(bar.get("opacity")) == pytest.approx(0.5, abs=1e-4)
    assert disc.get("display") == "none"
    assert [e.get("fill") for e in (back, bar, disc)] == [e.get("fill") for e in before]


def test_some_layers_only(image):
    wanted = svg.build(image, layers=[-1, "back"], background=False)
    assert [e.get("id") for e in elements(wanted)] == ["disc"]


def test_a_layer_off_the_canvas_is_black(image):
    away = image.layers["disc"].moved(500, 0)
    assert elements(svg.build(away))[2].get("fill") == "#000000"


def test_names_are_escaped_and_ids_unique(image):
    names = ['1 "<&>"', "Bär猫", "B_r_"]
    layers = [changed(v, name=n) for v, n in zip(image.layers, names, strict=True)]
    got = elements(svg.build(changed(image, layers=Layers(layers))))
    assert [e.get(LABEL) for e in got] == names
    assert [e.get("id") for e in got] == ["_1______", "B_r_", "B_r__2"]


# The command


def test_the_suffix_writes_outlines(tool, small_pxi, image, tmp_path):
    out = tmp_path / "a.SVG"
    tool("decode", small_pxi, out)
    assert out.read_bytes() == svg.build(image)
    assert "--force" in tool("decode", small_pxi, out, code=3).err
    tool("decode", small_pxi, out, "--force", "--layer", "disc")
    assert out.read_bytes() == svg.build(image, layers=["disc"])


@pytest.mark.parametrize(
    "flags",
    [("--scale", "2"), ("--width", "9"), ("--region", "0,0,9,9"), ("--bit-depth", "8")],
    ids=" ".join,
)
def test_flags_that_make_no_sense(tool, small_pxi, tmp_path, flags):
    tool("decode", small_pxi, tmp_path / "a.svg", *flags, code=2)
    assert not list(tmp_path.iterdir())

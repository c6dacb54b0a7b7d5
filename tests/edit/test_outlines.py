"""Outlines from SVG: unchanged files, what editors do to them, and files that are refused."""

import re
import sys

import numpy as np
import pytest

import proxyimg_codec as pxi
from proxyimg_codec.export import svg
from proxyimg_codec.geometry.boundary import COORDINATE_MAX, Boundary
from proxyimg_codec.geometry.coverage import FULL, coverage
from proxyimg_codec.limits import Limits
from proxyimg_codec.model import Layers

pytest.importorskip("svgelements")

from proxyimg_codec.edit.outlines import load
from tests.support.images import changed

SVG = 'xmlns="http://www.w3.org/2000/svg"'
INK = 'xmlns:inkscape="http://www.inkscape.org/namespaces/inkscape"'
PAGE = 'viewBox="0 0 64 48"'


@pytest.fixture(scope="module")
def image(small_pxi):
    return pxi.open(small_pxi)


def one(shape: str, page: str = PAGE) -> bytes:
    return f"<svg {SVG} {INK} {page}>{shape}</svg>".encode()


def path(d: str, name: str = "disc", more: str = "") -> bytes:
    return one(f'<path id="{name}" d="{d}" {more}/>')


def disc(image, data: bytes) -> list[list[list[float]]]:
    """The paths of the layer disc, in pixels."""
    found = load(image, data)
    assert list(found) == ["disc"]
    return [(p / (1 << found["disc"].unit)).tolist() for p in found["disc"].paths]


def same(a: Boundary, b: Boundary) -> bool:
    paths = zip(a.paths, b.paths, strict=True)
    return a.unit == b.unit and all(np.array_equal(p, q) for p, q in paths)


# There and back


def test_an_unchanged_file_gives_identical_control_points(image):
    found = load(image, svg.build(image))
    assert list(found) == ["bar", "disc"]
    for name, boundary in found.items():
        assert same(boundary, image.layers[name].boundary)


@pytest.mark.parametrize("unit", range(7))
def test_every_unit_and_the_whole_range_come_back(image, unit):
    rng = np.random.default_rng(unit)
    top = COORDINATE_MAX - 1
    paths = tuple(rng.integers(-top, top, (3 * m, 2), endpoint=True) for m in (1, 4))
    drawn = changed(image.layers["disc"], boundary=Boundary(unit, paths))
    other = changed(image, layers=Layers([*image.layers[:2], drawn]))
    assert same(load(other, svg.build(other))["disc"], drawn.boundary)


def test_the_unchanged_outline_of_a_moved_layer_is_passed_over(image):
    turned = image.layers["disc"].rotated(20)
    data = svg.build(turned)
    assert list(load(turned, data)) == ["bar"]
    again = load(turned, data.replace(b"<path", b'<path transform="translate(1)"'))
    now = turned.layers["disc"].outline
    expected = now.paths[0] / (1 << now.unit) + [1, 0]
    assert again["disc"].unit == 6
    assert np.abs(again["disc"].paths[0] / 64 - expected).max() <= 1 / 128


# What editors do


def test_commands_become_cubics(image):
    d = "m 10,10 h 6 v 6 l -6,0 z M 30 10 Q 33 13 36 10 T 42 10 C 40 20 32 20 30 10z"
    got = disc(image, path(d))
    a, b, c, d = [10, 10], [16, 10], [16, 16], [10, 16]
    assert got[0] == [a, a, b, b, b, c, c, c, d, d, d, a]
    assert got[1] == [
        [30, 10], [32, 12], [34, 12], [36, 10], [38, 8], [40, 8], [42, 10], [40, 20], [32, 20],
    ]  # fmt: skip


def test_open_paths_are_closed(image):
    a, b, c = [9, 9], [18, 9], [18, 18]
    triangle = [a, a, b, b, b, c, c, c, a]
    assert disc(image, path("M9,9H18V18")) == [triangle]
    assert disc(image, path("M9,9 H18 V18 L9.001,9 z")) == [triangle]


def filled(image, data: bytes) -> np.ndarray:
    """Coverage 0..1 of the layer disc, as it will be drawn."""
    boundary = load(image, data)["disc"]
    return coverage([p << (8 - boundary.unit) for p in boundary.paths], 0, 0, 64, 48) / FULL


Y, X = np.mgrid[0:48, 0:64] + 0.5


@pytest.mark.parametrize(
    "shape",
    [
        '<path id="disc" d="M 10 20 A 15 15 0 0 1 40 20 A 15 15 0 1 1 10 20 Z"/>',
        '<circle id="disc" cx="25" cy="20" r="15"/>',
        '<ellipse id="disc" cx="25" cy="40" rx="15" ry="30" transform="scale(1 .5)"/>',
        '<ellipse id="disc" cx="0" cy="0" rx="5" ry="15" transform="translate(25 20) scale(3 1)"/>',
        '<rect id="disc" x="10" y="5" width="30" height="30" rx="15"/>',
    ],
)
def test_arcs_and_shapes(image, shape):
    got = filled(image, one(shape))
    expected = np.clip(15.5 - np.hypot(X - 25, Y - 20), 0, 1)
    assert np.abs(got - expected).max() < 0.15
    assert got.sum() == pytest.approx(np.pi * 225, rel=5e-3)


def test_polygons_and_zero_radius_arcs(image):
    a, b, c = [10, 10], [22, 10], [22, 22]
    triangle = [a, a, b, b, b, c, c, c, a]
    assert disc(image, one('<polygon id="disc" points="10,10 22,10 22,22"/>')) == [triangle]
    assert disc(image, path("M10 10 A 0 5 0 0 1 22 10 V22 Z")) == [triangle]


def test_transforms_of_groups_and_shapes(image):
    inner = '<path id="disc" transform="matrix(0 1 -1 0 0 0)" d="M0 0H6V-6z"/>'
    got = disc(image, one(f'<g transform="translate(5,3) scale(2)"><g><a>{inner}</a></g></g>'))
    assert got[0][::3] == [[5, 3], [5, 15], [17, 15]]


TRIANGLE = np.array([[0, 0], [6, 0], [6, -6]])


def turned(degrees: float, about=(0, 0)) -> np.ndarray:
    """A rotation, float64 [2, 3]."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    turn = np.array([[c, -s], [s, c]])
    return np.column_stack([turn, about - turn @ about])


@pytest.mark.parametrize(
    ("attributes", "expected"),
    [
        ('style="transform: translate(20px, 15px)"', [[1, 0, 20], [0, 1, 15]]),
        ('style="fill:red; TRANSFORM : translateX(1in) ;opacity:1"', [[1, 0, 96], [0, 1, 0]]),
        ('style="transform:translate(3mm)"', [[1, 0, 3 * 96 / 25.4], [0, 1, 0]]),
        ('style="transform:rotate(.25turn)"', turned(90)),
        ('style="transform:rotate(0.5rad) scale(2,3)"', turned(np.degrees(0.5)) * [2, 3, 1]),
        ('style="transform:rotate(30deg);transform-origin:8px 5px"', turned(30, (8, 5))),
        ('transform="rotate(-40)" transform-origin="7 3"', turned(-40, (7, 3))),
        ('transform="rotate(-40 7,3)"', turned(-40, (7, 3))),
        ('transform="scale(2)" style="transform-origin:10px 0"', [[2, 0, -10], [0, 2, 0]]),
        ('transform="translate(50 50)" style="transform:scaleY(2)"', [[1, 0, 0], [0, 2, 0]]),
        ('transform="scale(9)" style="transform:none"', [[1, 0, 0], [0, 1, 0]]),
        ('style="transform:/* half a turn */ rotate(180deg) !important"', turned(180)),
        ('style="transform:matrix(1,2,3,4,5,6);transform-box:view-box"', [[1, 3, 5], [2, 4, 6]]),
        ('style="transform-origin:center"', [[1, 0, 0], [0, 1, 0]]),
        ('style="display:none;opacity:.5;stroke:red"', [[1, 0, 0], [0, 1, 0]]),
    ],
)
def test_transforms_in_styles_are_applied(image, attributes, expected):
    matrix = np.array(expected, np.float64)
    wanted = TRIANGLE @ matrix[:, :2].T + matrix[:, 2]
    shape = '<path id="disc" {} d="M0 0H6V-6z"/>'
    for data in (one(shape.format(attributes)), one(f"<g {attributes}>{shape.format('')}</g>")):
        got = np.array(disc(image, data)[0])[::3]
        np.testing.assert_allclose(got, wanted, atol=1 / 64)


def test_nested_transforms_of_both_kinds(image):
    inner = '<path id="disc" style="transform:scale(2)" d="M0 0H6V-6z"/>'
    got = disc(
        image,
        one(f'<g style="transform:rotate(90deg)"><a transform="translate(4 9)">{inner}</a></g>'),
    )
    assert got[0][::3] == [[-9, 4], [-9, 16], [3, 16]]


SHAPE = '<path id="disc" d="M8 8H16V16z"/>'


@pytest.mark.parametrize("sheet", ["", ".a{fill:#fff;stroke-width:2}", "/* transform: none */"])
def test_style_sheets_of_colours_do_no_harm(image, sheet):
    data = one(f"<defs><style>{sheet}</style></defs>{SHAPE}")
    assert disc(image, data)[0][::3] == [[8, 8], [16, 8], [16, 16]]


@pytest.mark.parametrize(
    ("page", "d"),
    [
        ('width="64" height="48"', "M8 8H16V16z"),
        ('width="100%" height="100%"', "M8 8H16V16z"),
        ("", "M8 8H16V16z"),
        ('width="128mm" height="96mm" viewBox="0 0 64 48"', "M8 8H16V16z"),
        ('width="6.4" height="4.8" viewBox="-8,-8 128,96"', "M8 8H24V24z"),
        ('width="2in" height="1.5in"', "M24 24H48V48z"),
    ],
)
def test_the_page_is_the_canvas(image, page, d):
    got = disc(image, one(f'<path id="disc" d="{d}"/>', page))
    assert got[0][::3] == [[8, 8], [16, 8], [16, 16]]


@pytest.mark.parametrize(
    "names",
    [
        'id="path12" inkscape:label="disc"',
        'id="bar" inkscape:label="disc"',
        'id="disc" inkscape:label="gone"',
        'id="disc"',
    ],
)
def test_labels_go_before_ids(image, names):
    assert list(load(image, one(f'<path {names} d="M8 8H16V16z"/>'))) == ["disc"]


def test_titles_and_ids_of_odd_names(image):
    named = [changed(v, name=n) for v, n in zip(image.layers, ("a", "1 <b>", "c d"), strict=True)]
    other = changed(image, layers=Layers(named))
    titled = '<path id="p"><title>c d</title></path>'.replace("<path", '<path d="M8 8H16V16z"')
    assert list(load(other, one(titled))) == ["c d"]
    unlabelled = re.sub(rb' inkscape:label="[^"]*"', b"", svg.build(other))
    assert list(load(other, unlabelled)) == ["1 <b>", "c d"]


def test_what_is_not_drawn_or_no_shape_is_passed_over(image):
    other = '<defs><path id="p" d="M0 0H4V4z"/></defs><text id="t">hello</text><image id="i"/>'
    foreign = '<s:namedview xmlns:s="http://sodipodi/"><s:path id="q"/></s:namedview>'
    shape = '<path id="disc" d="M8 8H16V16z"/>'
    assert list(load(image, one(other + foreign + shape))) == ["disc"]


def test_new_coordinates_are_as_fine_as_possible(image):
    own = image.layers["disc"].boundary.unit
    assert own == 2
    assert load(image, path("M8.25 8H16V16.00002z"))["disc"].unit == own
    assert load(image, path("M8.25 8H16V16.125z"))["disc"].unit == 6
    assert load(image, path(f"M.1 0C1 1 2 2 {1 << 20} 0z"))["disc"].unit == 5
    assert load(image, path(f"M.1 0C1 1 2 2 {(1 << 22) - 1} 0z"))["disc"].unit == 4


# Refusals


def refused(error: type[pxi.PxiError], image, data: bytes, *words: str, **limits) -> None:
    with pytest.raises(error) as caught:
        load(image, data, "in.svg", Limits(**limits))
    assert str(caught.value).startswith("in.svg: ")
    assert all(word in str(caught.value) for word in words), str(caught.value)


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"", ["not valid XML"]),
        (b"\x89PNG", ["not valid XML"]),
        (b"<html/>", ["not an SVG file"]),
        (b'<!DOCTYPE svg [<!ENTITY a "b">]>' + one(""), ["DOCTYPE"]),
        (one("<g>" * 70 + "</g>" * 70), ["nested deeper"]),
        (one(""), ["no path"]),
        (one('<text id="label">disc</text>'), ["no path"]),
        (path("M8 8H16V16z", "cat"), ["path 'cat'", "no layer", "'back', 'bar', 'disc'"]),
        (one('<path d="M8 8H16V16z"/>'), ["path ''", "no layer"]),
        (one('<rect id="disc" width="9" height="9"/><path id="x" inkscape:label="disc"/>'),
         ["layer 'disc'", "two shapes"]),
        (path(""), ["layer 'disc'", "empty"]),
        (path("M 3 3"), ["layer 'disc'", "empty"]),
        (path("M 3 3 L 3.001 3 z"), ["layer 'disc'", "empty"]),
        (path("M 3 3 L 8 nan z"), ["layer 'disc'", "cannot be read"]),
        (path("L 3 3 L 8 8 z"), ["layer 'disc'", "cannot be read"]),
        (path("hello"), ["layer 'disc'", "cannot be read"]),
        (path("M 3 3 L 1e999 8 9 9 z"), ["layer 'disc'", "not a finite number"]),
        (path("M 3 3 L 1e300 8 9 9 z", more='transform="scale(1e30)"'), ["not a finite number"]),
        (one('<g transform="scale(1e200)"><g transform="scale(1e200)">'
             '<path id="disc" d="M 3 3 L 8 9 9 9 z"/></g></g>'), ["not a finite number"]),
        (path(f"M 3 3 L {1 << 24} 8 9 9 z"), ["layer 'disc'", "out of range"]),
        (path("M 3 3 L 8 8 9 9 z", more='transform="matrix(1 2)"'), ["'disc'", "'matrix(1 2)'"]),
        (one('<rect id="back" width="60" height="48"/>'), ["layer 'back'", "stays so"]),
    ],
)  # fmt: skip
def test_bad_files(image, data, words):
    refused(pxi.InputError, image, data, *words)


@pytest.mark.parametrize(
    "page",
    ['viewBox="0 0 48 64"', 'viewBox="0 0 64 40"', 'width="64" height="64"'],
)
def test_pages_of_another_shape(image, page):
    refused(pxi.InputError, image, one('<path id="disc" d="M8 8H16V16z"/>', page), "another shape")


@pytest.mark.parametrize(
    "page",
    ['viewBox="0 0 64"', 'viewBox="a b c d"', 'viewBox="0 0 0 48"', 'viewBox="0 0 -64 -48"',
     'viewBox="nan 0 64 48"', 'viewBox="0 0 1e-320 1e-320"', 'width="0" height="0"'],
)  # fmt: skip
def test_pages_that_are_none(image, page):
    refused(pxi.InputError, image, one('<path id="disc" d="M8 8H16V16z"/>', page), "no page")


@pytest.mark.parametrize(
    ("data", "word"),
    [
        (one('<use id="disc" href="#p"/>'), "use 'disc'"),
        (one(f"<svg {SVG}/>"), "svg ''"),
        (path("M0 0H9V9z M2 1H8V7z", more='fill-rule="evenodd"'), "evenodd"),
        (path("M0 0H9V9z M2 1H8V7z", more='style="fill:red;fill-rule: evenodd"'), "evenodd"),
        (one('<g fill-rule="evenodd"><path id="disc" d="M0 0H9V9zM2 1H8V7z"/></g>'), "evenodd"),
        (one(f"<style>.a {{ transform:scale(2) }}</style>{SHAPE}"), "'transform'"),
        (one(f"<style>#disc{{fill:red;clip-path:none}}</style>{SHAPE}"), "'clip-path'"),
        (one(f"<defs><style>path{{d:path('M0 0')}}</style></defs>{SHAPE}"), "'d'"),
        (one(f"<style>@import url(a.css);</style>{SHAPE}"), "@import"),
        (b'<?xml-stylesheet href="a.css"?>' + one(SHAPE), "another file"),
        (one(SHAPE, f'{PAGE} transform="scale(2)"'), "svg element"),
        (one(SHAPE, f'{PAGE} style="transform:scale(2)"'), "svg element"),
        (one(SHAPE, f'{PAGE} clip-path="url(#c)"'), "clip-path"),
        (one(f"<switch>{SHAPE}<g/></switch>"), "switch"),
        (one('<text id="disc">disc</text>' + SHAPE.replace("disc", "bar")), "text 'disc'"),
        (one('<image inkscape:label="disc"/>' + SHAPE.replace("disc", "bar")), "image"),
        (path("M8 8H16V16z")[:-8] + b"><animateTransform/></path></svg>", "animateTransform"),
    ],
)
def test_what_is_not_supported(image, data, word):
    refused(pxi.UnsupportedError, image, data, word)


@pytest.mark.parametrize(
    ("attributes", "word"),
    [
        ('style="transform:translate(5%,0)"', "translate(5%"),
        ('style="transform:translate(calc(2px + 3px))"', "calc"),
        ('style="transform:translate3d(1px,2px,0)"', "translate3d"),
        ('style="transform:rotateY(1rad)"', "rotateY"),
        ('style="transform:translate(2em)"', "2em"),
        ('style="transform:scale(2);transform-origin:center"', "'center'"),
        ('style="transform:scale(2);transform-origin:50% 50%"', "'50% 50%'"),
        ('transform="scale(2)" transform-origin="8"', "transform-origin"),
        ('style="transform:scale(2);transform-box:fill-box"', "transform-box"),
        ('style="-webkit-transform:scale(2)"', "-webkit-transform"),
        ('style="translate:3px"', "translate"),
        ('style="rotate:3deg"', "rotate"),
        ('style="scale:2"', "scale"),
        ("style=\"offset-path:path('M0 0')\"", "offset-path"),
        ('style="clip-path:url(#c)"', "clip-path"),
        ('clip-path="url(#c)"', "clip-path"),
        ('mask="url(#m)"', "mask"),
        ("style=\"d:path('M0 0')\"", "'d'"),
        ('style="cx:5px"', "'cx'"),
    ],
)
def test_what_moves_or_cuts_and_cannot_be_applied(image, attributes, word):
    shape = '<path id="disc" {} d="M8 8H16V16z"/>'
    refused(pxi.UnsupportedError, image, one(shape.format(attributes)), "'disc'", word)
    grouped = f'<g id="group" {attributes}>{shape.format("")}</g>'
    refused(pxi.UnsupportedError, image, one(grouped), "'group'", word)


@pytest.mark.parametrize(
    "attributes",
    ['transform="translate(5"', 'transform="bogus(3)"', 'transform="translate()"',
     'transform="translate(1px)"', 'transform="rotate(1 2)"', 'transform="scale(2) hello"',
     'style="transform:translate(5,3)"', 'style="transform:rotate(40)"'],
)  # fmt: skip
def test_malformed_transforms(image, attributes):
    refused(pxi.InputError, image, path("M8 8H16V16z", more=attributes), "'disc'", "transform")


def test_long_malformed_transforms_are_refused_fast(image):
    hostile = f'transform="scale({"1" * 200_000}"'
    refused(pxi.InputError, image, path("M8 8H16V16z", more=hostile), "transform")


def test_pages_that_do_not_fit_their_view_box(image):
    for page in ('width="64" height="64"', 'width="10mm" height="20mm"'):
        refused(pxi.InputError, image, one(SHAPE, f"{PAGE} {page}"), "than the viewBox")


def test_even_odd_without_holes_is_no_problem(image):
    assert len(disc(image, path("M0 0H9V9z", more='fill-rule="evenodd"'))) == 1
    overruled = 'fill-rule="evenodd" style="fill-rule:nonzero"'
    assert len(disc(image, path("M0 0H9V9z M2 1H8V7z", more=overruled))) == 2


def test_limits(image):
    refused(pxi.LimitError, image, b"<svg>" + b" " * (1 << 24), "exceed")
    with pytest.raises(pxi.LimitError, match="segments"):
        load(image, svg.build(image), limits=Limits(segments=3))
    hostile = path("M0 0" + "z" * 1_000_000)
    with pytest.raises(pxi.LimitError, match="segments"):
        load(image, hostile)


def test_a_layer_that_covers_a_picture_with_alpha_may_get_an_outline(image):
    clear = changed(image, opaque=False)
    data = one('<rect id="back" width="60" height="48"/>')
    assert (
        load(clear, data)["back"].paths[0][::3]
        == np.array([[0, 0], [60, 0], [60, 48], [0, 48]]) * 64
    ).all()
    assert load(clear, one('<rect id="back" width="64" height="48"/>')) == {}


def test_svgelements_is_named_if_it_is_missing(monkeypatch):
    monkeypatch.setitem(sys.modules, "svgelements", None)
    for name in ("outlines", "svg_shapes"):
        monkeypatch.delitem(sys.modules, f"proxyimg_codec.edit.{name}")
    with pytest.raises(pxi.UnsupportedError, match=r"proxyimg-codec\[svg\]"):
        __import__("proxyimg_codec.edit.outlines")

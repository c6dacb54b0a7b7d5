"""PLAN, and TEXR of the pyramid coder: order, numbers, and all that is refused."""

from dataclasses import replace

import numpy as np
import pytest

import proxyimg_codec as pxi
from proxyimg_codec.container.chunks import Chunk, read, write
from proxyimg_codec.container.fields import pack
from proxyimg_codec.container.file import parse, serialize
from proxyimg_codec.container.texr import PYRAMID_FIELDS
from proxyimg_codec.errors import FormatError, LimitError
from proxyimg_codec.limits import Limits
from proxyimg_codec.model import Layers
from proxyimg_codec.texture.completion import Copies
from tests.support import pyramids
from tests.support.containers import refused
from tests.support.images import changed
from tests.support.pyramids import implicit, layers, picture, planes, view


@pytest.fixture
def soft(made_up_planes):
    """A picture with alpha: planes 0 colour, 1 alpha."""
    return picture(planes("colour"), planes("soft", components=1))


@pytest.fixture
def several(made_up_planes):
    """A picture whose layers have planes of their own; the bar shows those of the disc."""
    one, two = planes("one"), planes("two")
    back, bar, disc = layers(one)
    bar, disc = (changed(v, texture=replace(v.texture, planes=two)) for v in (bar, disc))
    return changed(picture(), layers=Layers([back, bar, disc]))


def test_files_come_back_to_the_byte(pyramid, soft, several):
    for image in (pyramid, soft, several):
        data = image.to_bytes()
        again = pxi.from_bytes(data)
        assert again.to_bytes() == data
        np.testing.assert_array_equal(again.render(), image.render())
        assert len({p for v in again.layers for p in v.texture.sources}) == len(
            {p for v in image.layers for p in v.texture.sources}
        )


def test_planes_stand_once_behind_textures(pyramid, soft):
    chunks = [c.type for c in read(pyramid.to_bytes())]
    assert chunks == ["HEAD", *["LAYR"] * 3, *["TEXR"] * 3, "PLAN", "iNFO", "TAIL"]
    assert [c.type for c in read(soft.to_bytes())].count("PLAN") == 2


def test_new_planes_are_numbered_by_first_use(soft, several):
    """Back to front, colour before alpha; what there was keeps its number."""

    def numbers(image):
        c = parse(image.to_bytes())
        names = [v["data"].decode() for v in c.planes]
        return names, [(t["planes"], t["alpha"]) for t in c.textures]

    assert numbers(soft) == (["colour", "soft"], [(0, 2)] * 3)
    assert numbers(several) == (["one", "two"], [(0, 0), (1, 0), (1, 0)])
    back, bar, disc = several.layers
    other = changed(several, opaque=False, layers=Layers([bar, back, disc]))
    assert numbers(other) == (["one", "two"], [(1, 0), (0, 0), (1, 0)])


def test_equal_views_are_stored_once(pyramid):
    """Views may share an object, or only be equal."""
    disc = pyramid.layers["disc"]
    equal = replace(disc.texture)
    assert equal is not disc.texture
    more = [changed(disc, name="a"), changed(disc, name="b", texture=equal)]
    image = changed(pyramid, info=None, layers=Layers([*pyramid.layers, *more]))
    c = parse(image.to_bytes())
    assert [t.get("texture") for t in c.textures] == [None, None, None, 2, 2]
    again = pxi.from_bytes(image.to_bytes())
    assert again.layers["a"].texture is again.layers["b"].texture is again.layers["disc"].texture
    assert again.to_bytes() == image.to_bytes()


PARTS = [
    [0, 0, 0, 48], [0, 0, 64, 0], [1, 0, 64, 48], [0, 1, 64, 48], [65, 0, 1, 1], [0, 0, 1 << 24, 1],
]  # fmt: skip


@pytest.mark.parametrize("part", PARTS)
def test_parts_lie_within_the_planes(pyramid, part):
    refused(pyramid, "textures", 1, {"part": part}, "TEXR: the part is empty or leaves")
    refused(pyramid, "textures", 0, {"part": part}, "TEXR: the part is empty or leaves")


VIEWS = [
    (1, {"planes": 1}, "TEXR: planes 1 do not exist"),
    (2, {"alpha": 2}, "TEXR: planes 1 do not exist"),
    (1, {"cell": 1}, "TEXR: cells without a mask"),
    (0, {"alpha": 1}, "TEXR: planes of alpha are not grey"),
    (2, {"coder": 1}, "TEXR.*14 values instead of 7: coder, network"),
    (2, {"coder": 0}, "TEXR.*payload is not valid msgpack"),
    (1, {"behind": 2}, "TEXR: planes 1 do not exist"),
    (0, {"behind_alpha": 1}, "TEXR: behind_alpha without behind, or without alpha"),
    (0, {"behind": 1, "behind_alpha": 1}, "TEXR: behind_alpha without behind, or without alpha"),
    (2, {"behind": 1}, "TEXR: planes of behind have not the size of the part"),
    (2, {"grain": 1}, "TEXR: a grain without sources"),
    (2, {"offsets": [1, 1]}, "TEXR: offsets without sources"),
    (2, {"sources": b"x"}, "TEXR: offsets without sources, or sources without"),
    (2, {"offsets": [1, 1, 1], "sources": b"x"}, "TEXR: offsets are not pairs"),
    (2, {"offsets": [1] * 512, "sources": b"x"}, "TEXR: offsets are not pairs, or more than 255"),
]


@pytest.mark.parametrize(("number", "values", "message"), VIEWS)
def test_views_are_checked(pyramid, number, values, message):
    container = parse(pyramid.to_bytes())
    chunks = read(pyramid.to_bytes())
    at = [i for i, c in enumerate(chunks) if c.type == "TEXR"][number]
    payload = pack(PYRAMID_FIELDS, {**container.textures[number], **values})
    chunks[at] = Chunk("TEXR", payload)
    with pytest.raises(FormatError, match=message):
        parse(write(chunks))


@pytest.mark.parametrize(
    ("key", "value"),
    [("cell", 7), ("cell", -1), ("planes", -1), ("alpha", (1 << 16) + 1), ("part", [0, 0, 1]),
     ("part", [-1, 0, 2, 2]), ("behind", -1), ("behind_alpha", (1 << 16) + 1), ("grain", 7),
     ("offsets", [0, (1 << 24) + 1]), ("offsets", [-(1 << 24) - 1, 0])],
)  # fmt: skip
def test_fields_have_ranges(pyramid, key, value):
    container = parse(pyramid.to_bytes())
    with pytest.raises(ValueError, match=key):
        pack(PYRAMID_FIELDS, {**container.textures[0], key: value})


def test_alpha_is_grey_and_as_large(soft):
    refused(soft, "planes", 1, {"components": 3}, "TEXR: planes of alpha are not grey")
    refused(soft, "planes", 1, {"size": [64, 49]}, "TEXR: planes of alpha .* of another size")


def test_alpha_is_announced(soft):
    refused(soft, "head", 0, {"channels": 3}, "TEXR: more channels than HEAD has")
    refused(soft, "head", 0, {"opaque": 1}, "back layer of an opaque file gives alpha")


@pytest.mark.parametrize("sampling", [1, 2, 3])
def test_nodes_need_an_implicit_texture(pyramid, sampling):
    meshed = pyramid.layers["disc"].dragged({(32, 24): (3, 0)})
    shared = meshed.layers["disc"].duplicated()
    for image, number in ((meshed, 2), (shared, 3)):
        message = "number of features" if number == 3 and sampling == 1 else "implicit texture"
        refused(image.baked(), "layers", number, {"sampling": sampling}, message)


def test_planes_are_all_used_in_any_order(several):
    c = parse(several.to_bytes())
    back, bar, disc = c.textures
    for textures, message in (
        ((back, {**bar, "planes": 0}, {**disc, "planes": 0}), "PLAN: planes 1 are not used"),
        (({**back, "planes": 1}, bar, disc), "PLAN: planes 0 are not used"),
    ):
        with pytest.raises(FormatError, match=message):
            parse(serialize(replace(c, textures=textures)))
    with pytest.raises(FormatError, match="PLAN: planes 2 are not used"):
        parse(serialize(replace(c, planes=(*c.planes, c.planes[0]))))
    with pytest.raises(FormatError, match="TEXR: planes 1 do not exist"):
        parse(serialize(replace(c, planes=c.planes[:1])))


def test_planes_keep_the_order_of_their_file(soft):
    c = parse(soft.to_bytes())
    swapped = tuple({**t, "planes": 1, "alpha": 1} for t in c.textures)
    data = serialize(replace(c, planes=c.planes[::-1], textures=swapped))
    again = pxi.from_bytes(data)
    assert again.to_bytes() == data
    np.testing.assert_array_equal(again.render(), soft.render())


def test_what_is_behind_comes_back(several, soft):
    """Planes behind and their alpha are planes like others; references keep their bytes."""
    bar, part = soft.layers["bar"], soft.layers["bar"].texture.part
    own, alpha = planes("own", part[2:]), planes("own soft", part[2:], 1)
    references = Copies(2, np.array([[4, -3], [-9, 0]], np.int32), np.full((3, 15), 2, np.uint8))
    shown = replace(bar.texture, behind=own, behind_alpha=alpha, copies=references)
    layers = [changed(v, texture=shown) if v.name == "bar" else v for v in soft.layers]
    data = changed(soft, layers=Layers(layers)).to_bytes()
    c = parse(data)
    names = [v["data"].decode() for v in c.planes]
    assert names == ["colour", "soft", "own", "own soft"]
    assert [(t["behind"], t["behind_alpha"]) for t in c.textures] == [(0, 0), (3, 4), (0, 0)]
    assert c.textures[1]["offsets"] == [4, -3, -9, 0]
    again = pxi.from_bytes(data)
    assert again.to_bytes() == data
    view = again.layers["bar"].texture
    assert view.behind is again.planes[2]
    np.testing.assert_array_equal(view.copies.sources, references.sources)
    assert not view.copies.sources.flags.writeable
    only = changed(again, layers=Layers([again.layers["back"], again.layers["disc"]]))
    assert len(only.planes) == 2, "planes that no layer names are dropped"


BEHIND = [{"size": [60, 11]}, {"size": [59, 12]}, {"components": 1}]


@pytest.mark.parametrize("values", BEHIND)
def test_planes_behind_fit_the_part(pyramid, values):
    bar = pyramid.layers["bar"]
    shown = replace(bar.texture, behind=planes("own", bar.texture.part[2:]))
    layers = [changed(v, texture=shown) if v.name == "bar" else v for v in pyramid.layers]
    image = changed(pyramid, layers=Layers(layers))
    refused(image, "planes", 1, values, "TEXR: planes of behind have not the size")


@pytest.mark.parametrize("to", [1, -1])
def test_planes_out_of_place(pyramid, to):
    chunks = read(pyramid.to_bytes())
    chunk = chunks.pop(next(i for i, c in enumerate(chunks) if c.type == "PLAN"))
    chunks.insert(to, chunk)
    with pytest.raises(FormatError, match="out of order"):
        parse(write(chunks))


def test_an_implicit_texture_needs_a_network(made_up_planes):
    c = parse(implicit().to_bytes())
    with pytest.raises(FormatError, match="network 0 does not exist"):
        parse(serialize(replace(c, head={**c.head, "networks": 0}, networks=())))


@pytest.mark.parametrize("damage", ["cut", "long"])
def test_damaged_masks_are_found_when_the_file_is_opened(pyramid, damage):
    c = parse(pyramid.to_bytes())
    mask = c.textures[0]["mask"]
    broken = {**c.textures[0], "mask": mask[:-2] if damage == "cut" else mask + b"\0"}
    data = serialize(replace(c, textures=(broken, *c.textures[1:])))
    parse(data)
    with pytest.raises(FormatError):
        pxi.from_bytes(data)


def test_limits_hold(pyramid):
    data = pyramid.to_bytes()
    filled = 64 * 48 + 31 * 30
    steps = 64 + 3 * 48 + 16 + 2 * 12 + 31 + 2 * 30
    parse(data, Limits(samples=64 * 48, filled=filled, codes=16 * 12 + 31 * 30, wavefronts=steps))
    for name, value in (
        ("samples", 64 * 48 - 1), ("filled", filled - 1), ("codes", 16 * 12 + 31 * 30 - 1),
        ("wavefronts", steps - 1),
    ):  # fmt: skip
        with pytest.raises(LimitError, match=name):
            parse(data, Limits(**{name: value}))


def test_all_planes_count(several):
    with pytest.raises(LimitError, match="samples"):
        parse(several.to_bytes(), Limits(samples=2 * 64 * 48 - 1))
    parse(several.to_bytes(), Limits(samples=2 * 64 * 48))


def test_huge_planes_are_refused_before_anything_is_decoded(pyramid, monkeypatch):
    """Of few bytes, and so large that a raster of them would not fit in memory."""
    c = parse(pyramid.to_bytes())
    size = [1 << 23, 1 << 24]
    huge = {**c.planes[0], "size": size}
    whole = {**c.textures[1], "part": [0, 0, *size]}
    monkeypatch.setattr(pyramids, "raster", None)
    limits = Limits(wavefronts=1 << 30)
    for textures in (c.textures, (c.textures[0], whole, c.textures[2])):
        data = serialize(replace(c, planes=(huge,), textures=textures))
        assert len(data) < 1000
        with pytest.raises(LimitError, match="samples"):
            pxi.from_bytes(data, limits)
        with pytest.raises(LimitError, match="wavefronts"):
            pxi.from_bytes(data)


def test_opening_decodes_no_planes(pyramid, monkeypatch):
    data = pyramid.to_bytes()
    from proxyimg_codec.texture import planes as module

    monkeypatch.setattr(module, "unpack", lambda fields, where: module.Planes(fields))
    image = pxi.from_bytes(data)
    assert image.to_bytes() == data
    found = {key for v in image.layers for p in v.texture.sources for key in p.__dict__}
    assert not any("decoding" in key for key in found)


def test_views_of_other_parts(made_up_planes):
    """A part need not lie where the box is, nor be as large."""
    source = planes("colour")
    image = picture(source)
    back = changed(image.layers[0], texture=view(source, part=(5, 6, 7, 8)))
    image = changed(image, layers=Layers([back, *image.layers[1:]]))
    again = pxi.from_bytes(image.to_bytes())
    assert again.layers[0].texture.part == (5, 6, 7, 8)
    assert again.to_bytes() == image.to_bytes()

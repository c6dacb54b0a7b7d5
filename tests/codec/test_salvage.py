"""Files that are cut off or damaged, with `tolerant`: what arrived is shown, and never silently."""

import logging
from dataclasses import replace

import msgpack
import numpy as np
import pytest

import proxyimg_codec as pxi
from conformance.make.builders import Numbers
from conformance.make.valid import behind, mattes, pyramids, views
from conformance.make.valid.versions import planes_first
from proxyimg_codec.cli.decode import DAMAGED
from proxyimg_codec.container import plan
from proxyimg_codec.container.chunks import MAPS_UNTIL, Chunk, read, write
from proxyimg_codec.container.fields import unpack
from proxyimg_codec.errors import FormatError, UnsupportedError
from proxyimg_codec.model import Layers
from proxyimg_codec.texture import planes
from tests.support.images import changed

LEVELS = 3


def built(cases, name):
    made = cases.CASES[name].build(Numbers(name))
    return made if isinstance(made, bytes) else pxi.Image(made).to_bytes()


@pytest.fixture(scope="module")
def flat():
    """A file of one layer and one raster of three levels."""
    return built(pyramids, "pyramid")


@pytest.fixture(scope="module")
def layered():
    """A file of two layers that show parts of one raster; one was moved."""
    return built(views, "pyramid-cuts")


def place(data, kind=plan.TYPE):
    """First and last byte of the payload of a chunk."""
    chunk = next(c for c in read(data) if c.type == kind)
    return chunk.offset + 8, chunk.offset + 8 + len(chunk.payload)


def stream(data):
    """Where the coded latents begin in a file."""
    _, end = place(data)
    (chunk,) = (c for c in read(data) if c.type == plan.TYPE)
    return end - len(unpack(plan.FIELDS, chunk.payload, "")["data"])


def tolerated(data, caplog):
    """The picture, of which something is wrong, as the log says."""
    caplog.clear()
    image = pxi.from_bytes(data, tolerant=True)
    assert image.damage
    (record,) = caplog.records
    assert record.levelno == logging.WARNING
    assert all(note in record.getMessage() for note in image.damage)
    again = pxi.from_bytes(image.to_bytes())  # sound, if saved
    np.testing.assert_array_equal(again.render(), image.render())
    return image


def latents(image):
    (source,) = {v for layer in image.layers for v in layer.texture.sources}
    return source.latents


def psnr(image, other):
    error = (image.render(dtype=np.float32) - other.render(dtype=np.float32)) ** 2
    return -10 * np.log10(error.mean() + 1e-12)


def used(image):
    """How many levels of the raster are used, as the last note says."""
    note = image.damage[-1]
    assert note.startswith("chunk PLAN 0: levels used, coarsest first: ")
    number, total = note.split(";")[0].split(": ")[-1].split(" of ")
    assert int(total) == LEVELS
    return int(number)


def test_the_more_arrives_the_better(flat, caplog):
    whole = pxi.from_bytes(flat)
    lowest, end = stream(flat), place(flat)[1]
    quality, arrived = {}, {}
    for stop in range(lowest, end, 23):
        cut = flat[:stop]
        with pytest.raises(FormatError, match="truncated"):
            pxi.from_bytes(cut)
        try:
            image = tolerated(cut, caplog)
        except FormatError:
            assert not quality
            continue
        count = used(image)
        assert "wrong" not in image.damage[-1]
        # What is used is exact, and the rest is nothing.
        for level, (found, full) in enumerate(
            zip(latents(image).levels, latents(whole).levels, strict=True), 1
        ):
            if level == LEVELS - count:
                arrived.setdefault(level, []).append(np.count_nonzero(found))
                assert ((found == full) | (found == 0)).all()
            else:
                expected = full if level > LEVELS - count else 0 * full
                np.testing.assert_array_equal(found, expected)
        known = slice(None) if count else slice(1)  # the lowest planes may end early, too
        np.testing.assert_array_equal(
            latents(image).lowest[:, known, known], latents(whole).lowest[:, known, known]
        )
        quality.setdefault(count, psnr(image, whole))
        assert count == max(quality)
    assert sorted(quality) == list(range(LEVELS)), "the cuts meet every level"
    assert list(quality.values()) == sorted(quality.values())
    assert all(counts == sorted(counts) for counts in arrived.values())
    assert arrived[1][-1] > arrived[1][0]


@pytest.mark.parametrize("name", ["pyramid-tiles", "pyramid-tiles-deep"])
def test_tiles_that_arrived_are_shown(name, caplog):
    data = built(pyramids, name)
    whole = pxi.from_bytes(data)
    image = tolerated(data[: place(data)[1] - 30], caplog)
    for found, full in zip(latents(image).levels, latents(whole).levels, strict=True):
        assert ((found == full) | (found == 0)).all()
    first, all_of_it = latents(image).levels[0], latents(whole).levels[0]
    np.testing.assert_array_equal(first[:, :64, :64], all_of_it[:, :64, :64])
    assert (first != all_of_it).any()


def test_the_beginning_has_all_layers(layered, caplog):
    whole = pxi.from_bytes(layered)
    image = tolerated(layered[: stream(layered) + 90], caplog)
    assert [v.name for v in image.layers] == [v.name for v in whole.layers]
    poses = [v.picture.layers["disc"].pose.shift for v in (image, whole)]
    assert poses[0] == poses[1] != (0, 0)


def test_planes_that_did_not_arrive(caplog):
    """Alpha and what lies behind are left out; layers without colour are hidden."""
    data = built(behind, "behind-alpha")
    plans = [c for c in read(data) if c.type == plan.TYPE]
    for count, chunk in enumerate(plans[1:], 1):
        image = tolerated(data[: chunk.offset], caplog)
        assert len(image.picture.planes) == count
        assert [v.name for v in image.layers] == [v.name for v in pxi.from_bytes(data).layers]
    several = pxi.from_bytes(built(views, "pyramid-cuts"))
    disc = several.layers["disc"]
    own = replace(disc.texture, planes=replace(disc.texture.planes), cuts=None)
    layers = [several.layers[0], changed(disc, texture=own)]
    data = changed(several, layers=Layers(layers)).to_bytes()
    last = [c for c in read(data) if c.type == plan.TYPE][-1]
    image = tolerated(data[: last.offset + 20], caplog)
    assert [v.pose.hidden for v in image.picture.layers] == [False, True]
    assert "layer 'disc' is hidden: its planes are not there" in image.damage


def test_after_the_planes_the_picture_is_whole(flat, caplog):
    _, end = place(flat)
    for stop in range(end, len(flat), 5):
        image = tolerated(flat[:stop], caplog)
        np.testing.assert_array_equal(image.render(), pxi.from_bytes(flat).render())
        assert [v.name for v in image.layers] == ["back"]


def test_without_textures_there_are_no_layers(layered, caplog):
    """As of version 0.11. The raster is the picture before its layers were moved."""
    whole = pxi.from_bytes(layered)
    layered = write(planes_first(layered), (0, 11))
    raster = whole.layers[0].texture.planes.raster
    for stop in (place(layered)[1] + 4, len(layered) - 13):
        image = tolerated(layered[:stop], caplog)
        np.testing.assert_array_equal(image.render(dtype=np.float32), raster)
        assert len(image.layers) == 1
        there = int(stop > place(layered)[1] + 4)
        assert image.damage[-1].startswith(f"of 2 textures {there} are there")
    tail = tolerated(layered[:-12], caplog)
    np.testing.assert_array_equal(tail.render(), whole.render())
    assert len(tail.layers) == 2


def test_soft_layers_do_without_what_is_missing(caplog):
    """The file has the raster, then what is behind, then the matte."""
    n = Numbers("soft layers")
    soft = mattes.softened(n, views.pieces(n, {}), "disc")
    data = pxi.Image(soft).to_bytes()
    ends = [c.offset for c in read(data) if c.type == plan.TYPE]
    found = []
    for stop in (*(at + 4 for at in ends[1:]), len(data) - 13):
        texture = tolerated(data[:stop], caplog).layers["disc"].texture
        found.append((texture.behind is not None, texture.matte is not None))
    assert found == [(False, False), (True, False), (True, True)]


@pytest.mark.parametrize("name", ["flat", "layered"])
def test_flipped_bits_are_never_silent(name, request, caplog):
    data = request.getfixturevalue(name)
    start, end = place(data)
    counts = set()
    for at in (*range(start, stream(data) + 40, 5), *range(stream(data) + 40, end + 4, 37), end):
        bent = bytearray(data)
        bent[at] ^= 1 << at % 8
        with pytest.raises(FormatError, match="CRC"):
            pxi.from_bytes(bytes(bent))
        try:
            image = tolerated(bytes(bent), caplog)
        except (FormatError, UnsupportedError):
            assert at < stream(data) + 40
            continue
        assert image.damage[0].startswith("chunk PLAN at byte ")
        assert image.damage[-1].endswith("; what they show may be wrong")
        assert len(image.layers) == (1 if name == "flat" else 2)
        counts.add(used(image))
        if at >= end:  # the CRC itself
            assert used(image) == LEVELS
            np.testing.assert_array_equal(image.render(), pxi.from_bytes(data).render())
    assert {LEVELS - 1, LEVELS} <= counts


def test_streams_that_do_not_end_with_the_latents(flat, caplog):
    """Their CRC is right; the finest level is not used."""
    chunks = read(flat)
    at = [c.type for c in chunks].index(plan.TYPE)
    fields = unpack(plan.FIELDS, chunks[at].payload, "")
    for wrong in ({"data": fields["data"] + b"!"}, {"escapes": fields["escapes"] + b"\1"}):
        chunks[at] = Chunk(plan.TYPE, msgpack.packb([*{**fields, **wrong}.values()]))
        data = write(chunks)
        with pytest.raises(FormatError, match="left over"):
            pxi.from_bytes(data).render()
        image = tolerated(data, caplog)
        assert used(image) == LEVELS - 1
        assert not latents(image).levels[0].any()


def test_maps_of_earlier_versions(flat, caplog):
    chunks = planes_first(flat)
    at = [c.type for c in chunks].index(plan.TYPE)
    fields = unpack(plan.fields_of((0, 11)), chunks[at].payload, "")
    chunks[at] = Chunk(plan.TYPE, msgpack.packb(fields))
    data = write(chunks, MAPS_UNTIL)
    image = tolerated(data[: place(data)[1] - 9], caplog)
    assert used(image) == LEVELS - 1


def test_what_cannot_be_done_without(flat, layered, small_pxi):
    glass = built(pyramids, "pyramid-alpha")
    small = small_pxi.read_bytes()
    for data, said in (
        (flat[:5], "signature"), (flat[:12], "HEAD"), (flat[:30], "HEAD"),
        (flat[: stream(flat)], "none of the planes"), (flat[: place(flat)[0] + 9], "too little"),
        (flat[: place(flat)[0] - 8], "before the planes"),
        (glass[: place(glass, "TEXR")[1]], "no raster"), (small[:-300], "no raster"),
        (bent(flat, "HEAD"), "chunk HEAD.*CRC"), (bent(layered, "LAYR"), "chunk LAYR.*CRC"),
        (bent(flat, "TEXR"), "chunk TEXR.*CRC"), (b"", "empty"),
    ):  # fmt: skip
        with pytest.raises(FormatError, match=said):
            pxi.from_bytes(data, tolerant=True)


def bent(data, kind):
    """A file with a wrong byte in a chunk."""
    start, _ = place(data, kind)
    return data[: start + 1] + bytes([data[start + 1] ^ 1]) + data[start + 2 :]


def test_what_can_be_done_without(layered, caplog):
    image = changed(pxi.from_bytes(layered), blocks={"exif": b"MM"}, info=None)
    edited = image.layers["disc"].moved(1, 1)
    for kind in ("eXIf", "uNDO"):
        data = bent(edited.to_bytes(), kind)
        found = tolerated(data, caplog)
        np.testing.assert_array_equal(found.render(), edited.render())
        assert f"chunk {kind} is left out" in found.damage
        assert found.blocks == ({} if kind == "eXIf" else edited.blocks)
        assert found.history == ()


def test_sound_files_are_as_ever(layered, caplog, monkeypatch):
    edited = pxi.from_bytes(layered).layers["disc"].moved(1, 1)
    data = edited.to_bytes()
    image = pxi.from_bytes(data, tolerant=True)
    assert (image.damage, caplog.records) == ((), [])
    assert image.to_bytes() == data
    assert len(image.history) == 1
    # Without the flag nothing of it is called.
    monkeypatch.setattr(planes, "salvaged", None)
    assert pxi.from_bytes(data).damage == ()


def test_the_tool(tool, launch, flat, tmp_path):
    whole, cut, bad = (tmp_path / f"{n}.pxi" for n in ("whole", "cut", "bad"))
    whole.write_bytes(flat)
    cut.write_bytes(flat[: place(flat)[1] - 9])
    bad.write_bytes(flat[:60])
    assert tool("decode", "--tolerant", whole, "-f", "--quiet").err == ""
    err = tool("decode", cut, code=4).err
    assert err.startswith(f"pxi-decode: {cut}: chunk ")
    assert err.endswith("; --tolerant decodes as much as is left\n")
    assert not (tmp_path / "cut.png").exists()
    ran = tool("decode", "--tolerant", cut, "--quiet", code=DAMAGED)
    assert ran.err.startswith("pxi-decode: warning: ")
    assert "chunk PLAN 0: levels used, coarsest first: 2 of 3" in ran.err
    assert (tmp_path / "cut.png").exists()
    assert launch("decode", "--tolerant", cut, "-f", "--quiet", code=7).err == ran.err
    assert "--tolerant" not in tool("decode", "--tolerant", bad, code=4).err
    bad.write_bytes(flat[:5])
    assert "--tolerant" not in tool("decode", bad, code=4).err
    help_ = tool("decode", "--help").out.decode()
    assert f"  {DAMAGED} damaged" in help_


def test_damage_that_is_found_while_drawing_is_named_too(tool, flat, tmp_path):
    """The stream of latents is decoded only when something is drawn."""
    chunks = [
        Chunk("PLAN", spoilt(chunk.payload)) if chunk.type == "PLAN" else chunk
        for chunk in read(flat)
    ]
    path = tmp_path / "spoilt.pxi"
    path.write_bytes(write(chunks))
    pxi.open(path)
    err = tool("decode", path, code=4).err
    assert err.startswith(f"pxi-decode: {path}: ")
    assert err.count(str(path)) == 1
    assert err.endswith("; --tolerant decodes as much as is left\n")


def spoilt(payload: bytes) -> bytes:
    """PLAN whose stream of latents has other bytes."""
    return payload[:-40] + bytes(v ^ 0x5A for v in payload[-40:])

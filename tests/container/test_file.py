from dataclasses import replace

import pytest

from proxyimg_codec import from_bytes
from proxyimg_codec.container import meta, tree
from proxyimg_codec.container.chunks import Chunk, read, write
from proxyimg_codec.container.fields import pack
from proxyimg_codec.container.file import parse, serialize
from proxyimg_codec.errors import FormatError, LimitError, UnsupportedError
from proxyimg_codec.limits import Limits


@pytest.fixture(scope="module")
def data(small_pxi):
    return small_pxi.read_bytes()


@pytest.fixture(scope="module")
def container(data):
    return parse(data)


@pytest.fixture(scope="module")
def plain(container):
    """Without meshes: chunks 0 HEAD, 1 to 3 LAYR, 4 NETW, 5 to 7 TEXR, 8 iNFO, 9 TAIL."""
    return serialize(replace(container, meshes=()))


def test_serialize_inverts_parse(data, container):
    assert serialize(container) == data


def test_layers_come_before_networks_before_textures(data):
    types = [c.type for c in read(data)]
    order = ["HEAD", "LAYR", "MESH", "POSE", "NETW", "TEXR", "iNFO", "TAIL"]
    assert types == sorted(types, key=order.index)
    assert [types.count(t) for t in order] == [1, 3, 3, 0, 1, 3, 1, 1]


def test_unknown_ancillary_chunks_survive_and_critical_ones_are_refused(data):
    chunks = read(data)
    extra = Chunk("teSt", b"kept")
    inside = write([*chunks[:2], extra, *chunks[2:]])
    assert parse(inside).extra[0].payload == b"kept"
    again = from_bytes(from_bytes(inside).to_bytes())
    assert [(c.type, c.payload) for c in again.extra] == [("teSt", b"kept")]
    with pytest.raises(UnsupportedError, match="TeST"):
        parse(write([*chunks[:2], Chunk("TeST", b""), *chunks[2:]]))


def test_metadata_is_carried(data, container):
    blocks = {"icc": b"i" * 5000, "exif": b"II*\0", "xmp": b"<x/>"}
    changed = serialize(replace(container, blocks=blocks))
    assert parse(changed).blocks == blocks
    assert len(changed) < len(data) + 400


def test_a_colour_in_numbers_is_carried(data, container):
    for primaries, transfer in ((9, 16), (1, 255)):
        values = {"primaries": primaries, "transfer": transfer}
        changed = serialize(replace(container, cicp=values))
        assert parse(changed).cicp == values
        assert len(changed) <= len(data) + 12 + 5
        image = from_bytes(changed)
        assert image.blocks["cicp"] == bytes([primaries, transfer, 0, 1])
        assert image.to_bytes() == changed
    assert parse(data).cicp is None


@pytest.mark.parametrize(
    "payload", [b"\x92\x00\x0d", b"\x92\x09\xcd\x01\x00", b"\x91\x09", b"\x94\x09\x10\x00\x01",
                b"\x92\x09\xcc\x10", b"\x82\x09\x10\x00\x01", b"", b"\x92\x09\xc0"],
)  # fmt: skip
def test_colours_that_are_none_are_refused(data, payload):
    chunks = read(data)
    with pytest.raises(FormatError, match="cICp"):
        parse(write([*chunks[:-1], Chunk("cICp", payload), chunks[-1]]))


def test_metadata_bombs_are_refused(container):
    bomb = meta.compress(b"\0" * 10_000_000)
    assert len(bomb) < 1000
    chunks = read(serialize(container))
    file = write([*chunks[:-1], Chunk("iCCp", bomb), chunks[-1]])
    with pytest.raises(LimitError, match="metadata"):
        parse(file, Limits(metadata_bytes=1 << 20))
    lying = meta.pack(meta.FIELDS, {"size": 10, "zstd": meta.unpack(meta.FIELDS, bomb, "")["zstd"]})
    with pytest.raises(FormatError, match="stated"):
        parse(write([*chunks[:-1], Chunk("iCCp", lying), chunks[-1]]))


def tree_chunk(groups, parents):
    return Chunk(tree.TYPE, pack(tree.FIELDS, {"groups": groups, "parents": parents}))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda c: c[1:], "not HEAD"),
        (lambda c: [c[0], *c], "twice"),
        (lambda c: [c[0], c[4], *c[1:4], *c[5:]], "out of order"),
        (lambda c: [*c[:3], *c[4:]], "announces 3 layers"),
        (lambda c: [*c[:4], *c[5:]], "announces 1 networks"),
        (lambda c: [*c[:7], *c[8:]], "textures"),
        (lambda c: [*c[:2], c[1], *c[3:]], "same name"),
        (lambda c: [*c[:-1], c[-2], c[-1]], "twice"),
        (lambda c: [*c[:-1], Chunk("TAIL", b"x")], "empty"),
        (lambda c: [*c[:-2], c[-2], c[-3], c[-1]], "out of order"),
        (
            lambda c: [*c[:-2], tree_chunk([], [0, 0, 0]), tree_chunk([], [0, 0, 0]), *c[-2:]],
            "twice",
        ),
        (lambda c: [*c[:5], tree_chunk([], [0, 0, 0]), *c[5:]], "out of order"),
    ],
)
def test_structure_is_checked(plain, change, message):
    with pytest.raises(FormatError, match=message):
        parse(write(change(read(plain))))


@pytest.mark.parametrize(
    ("part", "key", "value", "error"),
    [
        ("head", "depth", 9, FormatError),
        ("head", "opaque", 0, None),
        ("head", "channels", 4, None),
        ("layers", "box", [0, 0, 0, 5], FormatError),
        ("layers", "sampling", 3, None),
        ("layers", "sampling", 4, UnsupportedError),
        ("meshes", "layer", 1, FormatError),
        ("textures", "network", 1, FormatError),
        ("networks", "channels", 4, FormatError),
    ],
)
def test_values_must_agree(container, part, key, value, error):
    old = getattr(container, part)
    new = {**old, key: value} if part == "head" else ({**old[0], key: value}, *old[1:])
    changed = serialize(replace(container, **{part: new}))
    if error is None:
        parse(changed)
        return
    with pytest.raises(error):
        parse(changed)


@pytest.mark.parametrize("name", ["side", "layers", "segments", "gates", "codes", "parameters"])
def test_limits_hold(data, name):
    with pytest.raises(LimitError, match=name):
        parse(data, Limits(**{name: 0}))

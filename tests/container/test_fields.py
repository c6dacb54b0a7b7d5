import msgpack
import pytest

from proxyimg_codec.container.fields import Field, pack, unpack
from proxyimg_codec.errors import FormatError

FIELDS = (
    Field("n", "int", "A number.", 1, 9),
    Field("name", "str", "A name.", 1, 5),
    Field("data", "bin", "Bytes.", 0, 4),
    Field("pair", "ints", "Two numbers.", -3, 3, items=2),
    Field("names", "strs", "Names.", 1, 3),
)
GOOD = {"n": 4, "name": "abc", "data": b"xy", "pair": [-1, 2], "names": ["a", "äöü"]}
VALUES = list(GOOD.values())


def test_round_trip():
    packed = pack(FIELDS, GOOD)
    assert packed == msgpack.packb(VALUES)
    assert unpack(FIELDS, packed, "x") == GOOD


def test_maps_are_read_in_old_files_only():
    assert unpack(FIELDS, msgpack.packb(GOOD), "x", old=True) == GOOD
    with pytest.raises(FormatError, match="x: payload is not an array of n, name"):
        unpack(FIELDS, msgpack.packb(GOOD), "x")


@pytest.mark.parametrize(
    "change",
    [
        {"n": 0}, {"n": 10}, {"n": True}, {"n": "4"}, {"n": 4.0}, {"n": None},
        {"name": ""}, {"name": "abcdef"}, {"name": b"abc"}, {"data": b"12345"}, {"data": "ab"},
        {"pair": [1]}, {"pair": [1, 2, 3]}, {"pair": [1, 4]}, {"pair": [1, 2.0]}, {"pair": 1},
        {"names": "ab"}, {"names": [""]}, {"names": ["abcd"]}, {"names": [1]}, {"names": [b"a"]},
        {"names": [["a"]]},
    ],
)  # fmt: skip
def test_values_out_of_their_declaration_are_refused(change):
    (key,) = change
    for content in ({**GOOD, **change}, list({**GOOD, **change}.values())):
        with pytest.raises(FormatError, match=f"x: field '{key}' (is not|has)"):
            unpack(FIELDS, msgpack.packb(content), "x", old=True)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (VALUES[:-1], "4 values instead of 5: n, name, data, pair, names"),
        ([*VALUES, 1], "6 values instead of 5: n, name"),
        ([], "0 values instead of 5"),
        (VALUES[::-1], "'n' is not of type int"),
        ({**GOOD, "extra": 1}, "not an array of n, name, data, pair, names"),
        ({k: v for k, v in GOOD.items() if k != "n"}, "not an array"),
        (dict(reversed(GOOD.items())), "not an array"),
        ({}, "not an array"),
        (4, "not an array"),
        ("abc", "not an array"),
        (None, "not an array"),
    ],
)
def test_other_contents_are_refused(content, message):
    with pytest.raises(FormatError, match=message):
        unpack(FIELDS, msgpack.packb(content), "x", old=True)


@pytest.mark.parametrize(
    "payload",
    [
        b"", b"\xc1", msgpack.packb(GOOD)[:-1], msgpack.packb(GOOD) + b"\0",
        msgpack.packb(VALUES)[:-1], msgpack.packb(VALUES) + b"\0", b"\x91" * 5000,
        msgpack.packb([msgpack.ExtType(1, b"a"), *VALUES[1:]]),
    ],
)  # fmt: skip
def test_what_is_not_plain_msgpack_is_refused(payload):
    with pytest.raises(FormatError, match="not valid msgpack"):
        unpack(FIELDS, payload, "x")


@pytest.mark.parametrize(
    "payload",
    [
        msgpack.packb(GOOD).replace(b"\xa1n\x04", b"\xa1n\xcc\x04"),
        b"\xde\0\5" + msgpack.packb(GOOD)[1:],
        msgpack.packb(VALUES).replace(b"\x95\x04", b"\x95\xcc\x04"),
        msgpack.packb(VALUES).replace(b"\xa3abc", b"\xd9\3abc"),
        msgpack.packb(VALUES).replace(b"\xc4\2xy", b"\xc5\0\2xy"),
        b"\xdc\0\5" + msgpack.packb(VALUES)[1:],
    ],
)
def test_other_encodings_are_refused(payload):
    assert msgpack.unpackb(payload) in (GOOD, VALUES)
    with pytest.raises(FormatError, match="canonical"):
        unpack(FIELDS, payload, "x", old=True)


def test_the_writer_checks_too():
    with pytest.raises(ValueError, match="'n'"):
        pack(FIELDS, {**GOOD, "n": 99})

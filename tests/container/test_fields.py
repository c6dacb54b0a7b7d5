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


def test_round_trip():
    assert unpack(FIELDS, pack(FIELDS, GOOD), "x") == GOOD


@pytest.mark.parametrize(
    "change",
    [
        {"n": 0}, {"n": 10}, {"n": True}, {"n": "4"}, {"n": 4.0}, {"n": None},
        {"name": ""}, {"name": "abcdef"}, {"name": b"abc"}, {"data": b"12345"}, {"data": "ab"},
        {"pair": [1]}, {"pair": [1, 2, 3]}, {"pair": [1, 4]}, {"pair": [1, 2.0]}, {"pair": 1},
        {"names": "ab"}, {"names": [""]}, {"names": ["abcd"]}, {"names": [1]}, {"names": [b"a"]},
        {"names": [["a"]]}, {"extra": 1},
    ],
)  # fmt: skip
def test_values_out_of_their_declaration_are_refused(change):
    with pytest.raises(FormatError):
        unpack(FIELDS, msgpack.packb({**GOOD, **change}), "x")


@pytest.mark.parametrize(
    "payload",
    [
        b"", b"\xc1", b"\x93\1\2\3", msgpack.packb(GOOD)[:-1], msgpack.packb(GOOD) + b"\0",
        msgpack.packb(dict(reversed(GOOD.items()))),
        msgpack.packb({k: v for k, v in GOOD.items() if k != "n"}),
        msgpack.packb(GOOD).replace(b"\xa1n\x04", b"\xa1n\xcc\x04"),
        b"\x91" * 5000,
        msgpack.packb({**GOOD, "name": msgpack.ExtType(1, b"a")}),
    ],
)  # fmt: skip
def test_other_encodings_are_refused(payload):
    with pytest.raises(FormatError):
        unpack(FIELDS, payload, "x")


def test_the_writer_checks_too():
    with pytest.raises(ValueError, match="'n'"):
        pack(FIELDS, {**GOOD, "n": 99})

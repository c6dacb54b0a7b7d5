import struct
import zlib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from proxyimg_codec.container.chunks import PREFIX, READABLE, SIGNATURE, VERSION, Chunk, read, write
from proxyimg_codec.errors import FormatError, LimitError, UnsupportedError
from proxyimg_codec.limits import Budget, Limits

TAIL = Chunk("TAIL", b"")


@given(st.lists(st.tuples(st.sampled_from(["HEAD", "abCd", "xYZz"]), st.binary(max_size=40))))
def test_chunks_come_back(chunks):
    chunks = [*(Chunk(t, p) for t, p in chunks), TAIL]
    again = read(write(chunks))
    assert [(c.type, c.payload) for c in again] == [(c.type, c.payload) for c in chunks]
    assert again[0].offset == PREFIX.size


def test_layout():
    """The very bytes of the smallest chunk sequence."""
    body = b"TAIL" + struct.pack("<I", 0)
    expected = b"\x89PXI\r\n\x1a\n" + bytes(VERSION) + b"\0\0" + body
    assert write([TAIL]) == expected + struct.pack("<I", zlib.crc32(body))


@pytest.mark.parametrize(
    ("type_", "critical", "safe"),
    [("HEAD", True, False), ("iCCp", False, True), ("iNFO", False, False)],
)
def test_letter_case_carries_bits(type_, critical, safe):
    chunk = Chunk(type_, b"")
    assert (chunk.critical, chunk.safe_to_copy) == (critical, safe)


FILE = write([Chunk("HEAD", b"abc"), Chunk("anCs", b"12345"), TAIL])


@pytest.mark.parametrize("length", range(len(FILE)))
def test_every_truncation_is_refused(length):
    with pytest.raises(FormatError):
        read(FILE[:length])


@pytest.mark.parametrize("position", range(len(FILE)))
def test_every_flipped_bit_is_refused(position):
    for bit in range(8):
        damaged = bytearray(FILE)
        damaged[position] ^= 1 << bit
        if tuple(damaged[8:10]) in READABLE and position == 9:
            continue  # a file of another version
        with pytest.raises((FormatError, UnsupportedError)):
            read(bytes(damaged))


def test_trailing_bytes_are_refused():
    with pytest.raises(FormatError, match="follow the last chunk"):
        read(FILE + b"x")


def test_bad_type_is_refused():
    body = b"HE1D" + struct.pack("<I", 0)
    data = PREFIX.pack(SIGNATURE, *VERSION, 0) + body + struct.pack("<I", zlib.crc32(body))
    with pytest.raises(FormatError, match="four letters"):
        read(data)


def test_other_versions_are_unsupported_not_invalid():
    data = bytearray(FILE)
    data[8] = 1
    with pytest.raises(UnsupportedError, match=r"1\.12"):
        read(bytes(data))


@pytest.mark.parametrize(
    ("minor", "known"),
    [
        (0, False),
        (1, True),
        (2, True),
        (3, True),
        (4, False),
        (8, False),
        (9, True),
        (10, True),
        (11, True),
        (12, True),
        (13, False),
    ],
)
def test_known_versions_are_read(minor, known):
    data = bytearray(FILE)
    data[9] = minor
    if known:
        assert len(read(bytes(data))) == 3
        return
    with pytest.raises(
        UnsupportedError,
        match=rf"0\.{minor}, this program reads 0\.1, 0\.2, 0\.3, 0\.9, 0\.10, 0\.11, 0\.12;",
    ):
        read(bytes(data))


def test_limits_hold():
    with pytest.raises(LimitError, match="chunks"):
        read(FILE, Budget(Limits(chunks=2)))
    with pytest.raises(LimitError, match="file bytes"):
        read(FILE, Budget(Limits(file_bytes=10)))

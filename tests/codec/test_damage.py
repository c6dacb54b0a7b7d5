"""Damage anywhere in a file: cut off at every byte, and every bit flipped, with and without CRC."""

import zlib
from itertools import chain

import numpy as np
import pytest

from proxyimg_codec import from_bytes
from proxyimg_codec.container.chunks import READABLE, read, write
from proxyimg_codec.errors import FormatError, PxiError
from proxyimg_codec.validation.validate import validate
from tests.support.paths import ROOT

FILES = {
    "example": ROOT / "spec" / "example.pxi",
    "moves-posed": ROOT / "conformance" / "cases" / "motion" / "moves-posed" / "input.pxi",
    "pyramid-cells": ROOT / "conformance" / "cases" / "views" / "pyramid-cells" / "input.pxi",
}
"""Codes, boundaries and a network; a mesh, a pose and a motion; planes, with a mask."""

DRAWN = 5
"""Of so many files with a right CRC one is drawn, and of so many others one is validated."""


@pytest.fixture(params=FILES, scope="module")
def data(request):
    return FILES[request.param].read_bytes()


def flipped(data, bit):
    out = bytearray(data)
    out[bit >> 3] ^= 1 << (bit & 7)
    return bytes(out)


def errors(data):
    """What pxi-validate says, which never raises."""
    return [v for v in validate(data) if v.severity == "error"]


def shown(data):
    image = from_bytes(data)
    return image.render(width=min(image.width, 8), height=min(image.height, 8))


def test_a_file_that_is_cut_off_is_refused_wherever_it_ends(data):
    from_bytes(data)
    for end in range(len(data)):
        with pytest.raises(FormatError):
            from_bytes(data[:end])
        if end % DRAWN == 0:
            assert errors(data[:end])


def test_a_flipped_bit_is_noticed_wherever_it_is(data):
    versions = {}
    for bit in range(8 * len(data)):
        damaged = flipped(data, bit)
        try:
            from_bytes(damaged)
        except PxiError:
            if bit % (5 * DRAWN) == 0:
                assert errors(damaged)
        else:
            versions[bit] = damaged[8], damaged[9]
    # No CRC covers the version; what an older one reads as well is the same picture.
    assert set(versions.values()) <= set(READABLE)
    for bit in versions:
        assert bit >> 3 in (8, 9)
        assert np.array_equal(shown(flipped(data, bit)), shown(data))


@pytest.mark.slow
def test_what_a_crc_does_not_notice_is_refused_or_drawn(data):
    """Bits of payloads, each with the right CRC."""
    chunks = read(data)
    starts = [chunk.offset + 8 for chunk in chunks]
    places = [(s, len(c.payload)) for s, c in zip(starts, chunks, strict=True)]
    bits = chain(*(range(8 * s, 8 * (s + n)) for s, n in places))
    drawn = refused = 0
    for number, bit in enumerate(bits):
        if number % 4 and len(data) > 600:
            continue  # one in four bits of large files
        damaged = bytearray(flipped(data, bit))
        start, size = next(p for p in reversed(places) if p[0] <= bit >> 3)
        body = damaged[start - 8 : start + size]
        damaged[start + size : start + size + 4] = zlib.crc32(body).to_bytes(4, "little")
        try:
            if number // 4 % DRAWN:
                from_bytes(bytes(damaged))
            else:
                assert shown(bytes(damaged)).ndim == 3
            drawn += 1
        except PxiError:
            refused += 1
            if number // 4 % (5 * DRAWN) == 0:
                assert errors(bytes(damaged))
    assert drawn
    assert refused


def test_chunks_that_appear_twice_or_not_at_all_are_refused_or_passed_over(data):
    chunks = read(data)
    for k in range(len(chunks)):
        with pytest.raises(PxiError):
            from_bytes(write([*chunks[: k + 1], *chunks[k:]]))
        try:
            shown(write(chunks[:k] + chunks[k + 1 :]))
        except PxiError:
            continue
        assert chunks[k].type in ("MESH", "POSE", "mOTN", "iNFO")

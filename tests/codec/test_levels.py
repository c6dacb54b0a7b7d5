"""Profiles and levels of files."""

from dataclasses import replace

import pytest

from conformance.cases import load
from proxyimg_codec.codec.levels import COUNTED, LEVELS, PROFILES, profile_and_level
from proxyimg_codec.container.chunks import Chunk, read, write
from proxyimg_codec.errors import LimitError
from proxyimg_codec.limits import DEFAULT_LIMITS

FILES = {case.name: case.input.read_bytes() for case in load() if case.renders}


@pytest.mark.parametrize(
    ("name", "profile"),
    [
        ("layers", "still"), ("pyramid", "still"), ("moved", "posed"), ("node-global", "posed"),
        ("moves-loop", "moving"),
    ],
)  # fmt: skip
def test_profiles(name, profile):
    assert profile_and_level(FILES[name]) == (profile, 1)


def test_a_mesh_alone_needs_no_poses():
    moved = read(FILES["bent"])
    resting = write([c for c in moved if c.type != "POSE"])
    assert profile_and_level(resting)[0] == "still"


def test_levels_only_grow_up_to_the_defaults():
    assert LEVELS[-1] == DEFAULT_LIMITS
    for name in COUNTED:
        bounds = [getattr(limits, name) for limits in LEVELS]
        assert bounds == sorted(bounds)
    assert len({*PROFILES}) == 3


@pytest.mark.parametrize("more", [0, 1])
def test_one_count_above_a_level_makes_the_next(more):
    chunks = read(FILES["layers"])
    fill = LEVELS[0].chunks - len(chunks) + more
    assert profile_and_level(write([*chunks[:-1], *[Chunk("teST", b"")] * fill, chunks[-1]])) == (
        "still",
        1 + more,
    )


def test_the_faces_of_meshes_count(monkeypatch):
    assert profile_and_level(FILES["closing-1"]) == ("posed", 1)
    few = replace(LEVELS[0], faces=8)
    monkeypatch.setattr("proxyimg_codec.codec.levels.LEVELS", (few, *LEVELS[1:]))
    assert profile_and_level(FILES["closing-1"]) == ("posed", 2)


def test_above_all_levels_there_is_none():
    chunks = read(FILES["layers"])
    many = write([*chunks[:-1], *[Chunk("teST", b"")] * DEFAULT_LIMITS.chunks, chunks[-1]])
    with pytest.raises(LimitError):
        profile_and_level(many)
    assert profile_and_level(many, replace(DEFAULT_LIMITS, chunks=1 << 20)) == ("still", None)

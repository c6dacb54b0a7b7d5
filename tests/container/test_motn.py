"""mOTN: round trips, what is refused and where, and what a small file cannot ask for."""

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
import zstandard

import proxyimg_codec as pxi
from conformance.make.refused.motion import CASES, LINE, MOTION, Moving
from proxyimg_codec.api import from_bytes
from proxyimg_codec.container.chunks import read
from proxyimg_codec.container.file import parse, serialize
from proxyimg_codec.errors import FormatError, LimitError
from proxyimg_codec.geometry.track import Track
from proxyimg_codec.limits import Limits
from proxyimg_codec.model import Layers
from tests.support import moving
from tests.support.images import changed

BASE = Moving()

REFUSED = {
    "twice": "chunk mOTN at byte .*: appears twice",
    "order": "out of order",
    "none": "chunk mOTN: the layers that move are none",
    "descending": "chunk mOTN: .* not ascending",
    "same": "chunk mOTN: .* not ascending",
    "layer": "chunk mOTN: layer 4 moves, but has no mesh",
    "mesh": "chunk mOTN: layer 3 moves, but has no mesh",
    "back": "chunk mOTN: the back layer of an opaque file moves",
    "bodies-few": "chunk mOTN: the number of bodies",
    "bodies-many": "chunk mOTN: the number of bodies",
    "script-unsaid": "chunk mOTN: the script and its size do not fit",
    "script-missing": "chunk mOTN: the script and its size do not fit",
    "script-long": "chunk mOTN: metadata does not have the stated 3 bytes",
    "script-short": "chunk mOTN: metadata does not have the stated 3 bytes",
    "script-plain": "chunk mOTN: metadata is not a zstd frame",
    "script-latin": "chunk mOTN: the script is not UTF-8",
    "curves-few": "chunk mOTN: entropy-coded stream",
    "curves-many": "chunk mOTN: entropy-coded stream",
    "loop": "chunk mOTN: entropy-coded stream",
    "curve-raw": "chunk mOTN: the raw bits .* wrong length",
    "curve-padding": "chunk mOTN: padding bits",
    "curve-bit": "chunk mOTN: entropy-coded stream",
    "shapes-few": "chunk mOTN: entropy-coded stream",
    "shapes-many": "chunk mOTN: entropy-coded stream",
    "shape-row": "chunk mOTN: entropy-coded stream",
    "shape-raw": "chunk mOTN: the raw bits .* wrong length",
    "modes": "chunk mOTN: entropy-coded stream",
    "curve-high": "chunk mOTN: a curve or shape is out of range",
    "curve-low": "chunk mOTN: a curve or shape is out of range",
    "shape-high": "chunk mOTN: a curve or shape is out of range",
    "shape-low": "chunk mOTN: a curve or shape is out of range",
    "duration": "chunk mOTN at byte .* 'duration' has value 0",
    "hours": "chunk mOTN at byte .* 'duration' has value 3600001",
    "rate": "chunk mOTN at byte .* 'fps' has value 0",
    "looping": "chunk mOTN at byte .* 'loop' has value 2",
    "intervals": "chunk mOTN at byte .* 'intervals' has value 0",
    "unit": "chunk mOTN at byte .* 'unit' has value 7",
    "modes-none": "chunk mOTN at byte .* 'modes' has value 0",
    "modes-many": "chunk mOTN at byte .* 'modes' has value 65",
}


def peak(work) -> int:
    """Bytes that are allocated at most while `work` runs."""
    tracemalloc.start()
    try:
        work()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def test_every_refused_case_has_its_reason():
    assert {f"invalid-motion-{name}" for name in REFUSED} == {n for n in CASES if n[0] == "i"}


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_wrong_is_refused_with_its_place(name):
    with pytest.raises(FormatError, match=REFUSED[name]):
        from_bytes(CASES[f"invalid-motion-{name}"].build(BASE))


def test_what_they_are_made_of_is_right():
    assert serialize(parse(BASE.data)) == BASE.data
    again = from_bytes(BASE.set(MOTION, **BASE.moves([1, 2], curve=-300, shape=-5)))
    assert [v.track is not None for v in again.layers] == [False, True, True, False]
    assert again.layers[2].track.curves[1].tolist() == [0, 0, -300, 0, 0]
    assert again.layers[2].track.shapes[0, 2:5].tolist() == [[1, 1], [1, -5], [1, 1]]


@pytest.mark.parametrize("line", [moving.LOOP, moving.ONCE], ids=["loop", "once"])
def test_files_come_back_byte_for_byte(tmp_path, line):
    image = moving.picture(line=line)
    image.save(tmp_path / "a.pxi")
    again = pxi.open(tmp_path / "a.pxi")
    again.save(tmp_path / "b.pxi")
    assert (tmp_path / "a.pxi").read_bytes() == (tmp_path / "b.pxi").read_bytes()
    assert again.timeline == line
    for one, other in zip(image.layers, again.layers, strict=True):
        assert (one.track is None) == (other.track is None)
        if one.track is not None:
            np.testing.assert_array_equal(one.track.curves, other.track.curves)
            np.testing.assert_array_equal(one.track.shapes, other.track.shapes)
            assert one.track.body == other.track.body
    for t in (-0.4, 0.3, 99):
        np.testing.assert_array_equal(again.render(t=t), image.render(t=t))


def test_the_still_is_what_it_was():
    image = moving.picture()
    still = changed(
        image, timeline=None, layers=Layers(changed(v, track=None) for v in image.layers)
    )
    np.testing.assert_array_equal(from_bytes(image.to_bytes()).render(), still.render())
    with_motion, without = image.chunks, still.chunks
    assert [c for c in with_motion if c.type != "mOTN"] == list(without)


def test_a_damaged_motion_leaves_the_still():
    data = BASE.damage(MOTION, 5, 1)
    with pytest.raises(FormatError, match="CRC"):
        from_bytes(data)
    image = from_bytes(data, tolerant=True)
    assert image.timeline is None
    assert "mOTN" in image.damage[-1]
    np.testing.assert_array_equal(image.render(), from_bytes(BASE.data).render())


def numbers() -> tuple[int, int]:
    """Coefficients of a mode, and nodes, in the base file."""
    image = from_bytes(BASE.data)
    moves = [v for v in image.layers if v.track is not None]
    return len(moves) * LINE.coefficients, sum(len(v.mesh.refined.nodes) for v in moves)


def test_limits_count_coefficients_and_nodes():
    coefficients, nodes = numbers()
    total = 2 * (coefficients + 2 * nodes)
    from_bytes(BASE.data, Limits(motion=total))
    with pytest.raises(LimitError, match=f"motion: {total} exceeds"):
        from_bytes(BASE.data, Limits(motion=total - 1))
    with pytest.raises(LimitError, match=f"motion: {2 * coefficients} exceeds"):
        parse(BASE.data, Limits(motion=2 * coefficients - 1))
    steps = coefficients + 2 + nodes + 4
    others = sum(t["grid"][0] + 2 * t["grid"][1] for t in parse(BASE.data).textures if "grid" in t)
    from_bytes(BASE.data, Limits(wavefronts=others + steps))
    with pytest.raises(LimitError, match=f"wavefronts: {others + steps} exceeds"):
        from_bytes(BASE.data, Limits(wavefronts=others + steps - 1))
    with pytest.raises(LimitError, match="wavefronts"):
        parse(BASE.data, Limits(wavefronts=coefficients + 1))


@pytest.mark.parametrize("name", ["limit-motion", "limit-motion-script"])
def test_huge_requests_are_refused_before_anything_is_decoded(name):
    data = CASES[name].build(BASE)

    def refused():
        with pytest.raises(LimitError):
            parse(data)

    assert peak(refused) < 1 << 20


def test_few_bytes_do_not_make_many_numbers():
    # Within the limits, but the streams cannot hold as many symbols.
    data = BASE.set(MOTION, intervals=30000, modes=64)
    from_bytes(BASE.data)

    def refused():
        with pytest.raises(FormatError, match=r"chunk mOTN: .* too short for its array"):
            from_bytes(data)

    assert peak(refused) < 1 << 20


def test_a_script_cannot_grow_without_end():
    # A megabyte of zeros in some tens of bytes.
    frame = zstandard.ZstdCompressor().compress(bytes(1 << 20))
    data = BASE.set(MOTION, size=9, script=frame)
    assert len(data) < 1200

    def refused():
        with pytest.raises(FormatError, match="stated 9 bytes"):
            from_bytes(data)

    assert peak(refused) < 1 << 19


def test_a_writer_keeps_within_the_limits():
    image = moving.picture(("disc",))
    disc = image.layers["disc"]
    line = replace(image.timeline, intervals=65530)
    shapes = np.repeat(disc.track.shapes, 32, 0)
    long = changed(disc, track=Track(np.ones((64, 65530), np.int64), shapes))
    layers = Layers([*image.layers[:2], long])
    with pytest.raises(LimitError, match=r"motion: .* exceeds"):
        changed(image, layers=layers, timeline=replace(line, loop=True)).to_bytes()


def test_the_chunk_stands_with_the_metadata():
    types = [c.type for c in read(moving.picture().to_bytes())]
    assert types.index("mOTN") > max(k for k, t in enumerate(types) if t == "TEXR")
    assert types.count("mOTN") == 1

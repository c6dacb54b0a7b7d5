import msgpack
import pytest
from hypothesis import given
from hypothesis import strategies as st

from proxyimg_codec import from_bytes
from proxyimg_codec.container import meta, undo
from proxyimg_codec.container.chunks import Chunk, read, write
from proxyimg_codec.container.fields import pack, unpack
from proxyimg_codec.container.undo import Step
from proxyimg_codec.errors import FormatError, LimitError
from proxyimg_codec.limits import DEFAULT_LIMITS, Budget, Limits
from tests.support.paths import TESTS

PRESENT = [Chunk("HEAD", b"h"), Chunk("LAYR", b"a"), Chunk("LAYR", b"a"), Chunk("TEXR", b"t" * 99)]
TAIL = Chunk("TAIL", b"")

chunks = st.builds(Chunk, st.sampled_from(["HEAD", "LAYR", "teSt"]), st.binary(max_size=9))
steps = st.builds(Step, st.text(max_size=9), st.lists(chunks, max_size=6).map(tuple))


def decode(chunk, present=PRESENT, limits=DEFAULT_LIMITS):
    return undo.decode(chunk, present, "chunk uNDO", Budget(limits))


@given(st.lists(chunks, min_size=1, max_size=6), st.lists(steps, min_size=1, max_size=4))
def test_histories_come_back(present, history):
    assert decode(undo.encode(present, history), present) == tuple(history)


def test_shared_chunks_are_kept_once():
    history = [Step("{}", (*PRESENT[:3], Chunk("TEXR", b"u" * 90 + bytes([i % 2])))) for i in "ab"
               for i in (0, 1, 1)]  # fmt: skip
    packed = unpack(undo.FIELDS, undo.encode(PRESENT, history).payload, "")
    assert packed["size"] < 2 * 91 + 6 * 16 + 40


def test_a_history_of_another_state_is_ignored_unseen():
    chunk = undo.encode(PRESENT, [Step("{}", tuple(PRESENT))])
    assert decode(chunk, [*PRESENT[:-1], Chunk("TEXR", b"other")]) == ()
    assert decode(chunk, PRESENT[1:]) == ()
    rubbish = pack(undo.FIELDS, {"state": bytes(32), "size": 9, "zstd": b"rubbish"})
    assert decode(Chunk("uNDO", rubbish)) == ()


def test_a_file_loses_its_history_when_a_stranger_changes_it(small_pxi):
    image = from_bytes(small_pxi.read_bytes()).edited({"op": "move", "layer": "disc", "by": [1, 2]})
    data = image.to_bytes()
    assert len(from_bytes(data).history) == 1
    parts = read(data)
    changed = write([*parts[:-2], Chunk("teSt", b""), *parts[-2:]])
    assert from_bytes(changed).history == ()
    moved = write([*parts[:-3], parts[-2], parts[-3], parts[-1]])  # uNDO before another chunk
    assert len(from_bytes(moved).history) == 1


def test_steps_refer_to_states_that_open(small_pxi):
    image = from_bytes(small_pxi.read_bytes())
    edited = image.edited(
        {"op": "move", "layer": "disc", "by": [1, 2]}, {"op": "remove", "layer": "bar"}
    )
    again = from_bytes(edited.to_bytes())
    assert again.undone(2).to_bytes() == image.to_bytes()
    assert [layer.name for layer in again.undone().layers] == ["back", "bar", "disc"]


def test_old_histories_share_chunks_with_the_present_once_saved():
    """Version 0.2 wrote other payloads than today; kept as they were, nothing would be shared."""
    old = TESTS.joinpath("golden/0.2/edited.pxi").read_bytes()
    assert read(old)[0].payload[0] < 0x90
    image = from_bytes(old)
    kept = {c.payload[0] >> 4 for step in image.history for c in step.chunks}
    assert kept == {9}
    assert len(image.to_bytes()) < 0.7 * len(old)


def test_chunks_of_a_history_that_are_not_right_stay_as_they_are(small_pxi):
    present = read(small_pxi.read_bytes())[:-1]
    wrong = [("HEAD", b"\x80"), ("HEAD", b""), ("LAYR", b"\xc1"), ("TEXR", b"\x81\xa5coder\x09"),
             ("teSt", b"\x80")]  # fmt: skip
    step = Step("{}", tuple(Chunk(*pair) for pair in wrong))
    file = write([*present, undo.encode(present, [step]), TAIL])
    assert from_bytes(file).history == (step,)


def test_the_oldest_steps_are_forgotten(monkeypatch):
    history = [Step(str(i), (Chunk("TEXR", bytes([i]) * 50),)) for i in range(9)]
    monkeypatch.setattr(undo, "STEPS_MAX", 4)
    assert decode(undo.encode(PRESENT, history)) == tuple(history[-4:])
    monkeypatch.setattr(undo, "SIZE_MAX", 300)
    assert decode(undo.encode(PRESENT, history)) == tuple(history[-3:])
    monkeypatch.setattr(undo, "CHUNKS_MAX", len(PRESENT) + 2)
    assert decode(undo.encode(PRESENT, history)) == tuple(history[-2:])


def test_limits_hold():
    chunk = undo.encode(PRESENT, [Step("{}", (Chunk("TEXR", bytes(10_000)),))])
    with pytest.raises(LimitError, match="metadata"):
        decode(chunk, limits=Limits(metadata_bytes=9999))
    with pytest.raises(LimitError, match="chunks"):
        decode(chunk, limits=Limits(chunks=len(PRESENT)))


def holding(content, packed=None):
    """A chunk that is bound to the present state, whatever it holds."""
    history = msgpack.packb(content, use_bin_type=True) if packed is None else packed
    values = {
        "state": undo.digest(PRESENT), "size": len(history), "zstd": meta.compressed(history),
    }  # fmt: skip
    return Chunk("uNDO", pack(undo.FIELDS, values))


def test_what_the_tests_below_break_is_right():
    kept, step = ["LAYR", b"x"], ["{}", [0, 4]]
    want = Step("{}", (PRESENT[0], Chunk("LAYR", b"x")))
    assert decode(holding([[kept], [step]])) == (want,)


@pytest.mark.parametrize(
    "content",
    [
        5, "ab", {}, {"chunks": [], "steps": []}, [], [[]], [[], [], []],
        [[["LAYR", b"x", 1]], []], [[["LAYR"]], []],
        [[["LAY", b"x"]], []], [[["LAYÄ", b"x"]], []],
        [[["LA1R", b"x"]], []], [[[b"LAYR", b"x"]], []],
        [[["LAYR", 1 << 40]], []], [[["LAYR", [1, 2]]], []],
        [5, []], [[], 5], [[], [5]],
        [[], [["{}"]]], [[], [[1, [0]]]],
        [[], [["{}", 0]]], [[], [["{}", [4]]]],
        [[], [["{}", [-1]]]], [[], [["{}", [True]]]],
        [[], [["{}", ["0"]]]], [[], [["{}", [0.0]]]],
        [[], [["{}", []]] * (undo.STEPS_MAX + 1)],
    ],
)  # fmt: skip
def test_corrupt_histories_are_refused(content):
    with pytest.raises(FormatError, match="corrupt"):
        decode(holding(content))


@pytest.mark.parametrize("packed", [b"\xc1", b"\x92", b"\x91" * 5000, b"\x90\0"])
def test_what_is_no_array_is_refused(packed):
    with pytest.raises(FormatError, match="corrupt"):
        decode(holding(None, packed))


def test_other_encodings_are_refused():
    good = msgpack.packb([[], [["{}", [1]]]], use_bin_type=True)
    with pytest.raises(FormatError, match="corrupt"):
        decode(holding(None, good[:-1] + b"\xcc\x01"))


def test_a_damaged_frame_is_refused():
    values = {"state": undo.digest(PRESENT), "size": 9, "zstd": b"rubbish"}
    with pytest.raises(FormatError, match="zstd"):
        decode(Chunk("uNDO", pack(undo.FIELDS, values)))


def test_references_are_limited():
    # A few bytes can refer to the same chunks again and again.
    history = [Step("{}", tuple(PRESENT) * 5) for _ in range(3)]
    chunk = undo.encode(PRESENT, history)
    assert len(decode(chunk, limits=Limits(references=60))) == 3
    with pytest.raises(LimitError, match="references: 60 exceeds the limit of 59"):
        decode(chunk, limits=Limits(references=59))

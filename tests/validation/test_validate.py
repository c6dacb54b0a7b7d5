"""Checking files completely: rules, several errors at once, histories, and what is odd."""

import re
from dataclasses import replace

import pytest

from conformance.cases import load
from proxyimg_codec import from_bytes
from proxyimg_codec.container import fields, layr, mesh, meta, texr, undo
from proxyimg_codec.container.chunks import Chunk, read, write
from proxyimg_codec.container.undo import Step
from proxyimg_codec.errors import FormatError, LimitError, PxiError, UnsupportedError
from proxyimg_codec.geometry import deltas
from proxyimg_codec.limits import Limits
from proxyimg_codec.model import Layers
from proxyimg_codec.validation import validate, warnings
from tests.support import moving, pyramids
from tests.support.images import changed
from tests.support.paths import ROOT

CASES = load()
CLASSES = {"invalid": FormatError, "unsupported": UnsupportedError, "limit": LimitError}
RULE = r"[A-Z]{3}-\d+"


def check(data, **limits):
    return validate.validate(data, Limits(**limits))


def errors(data, **limits):
    return [v for v in check(data, **limits) if v.severity == warnings.ERROR]


def odd(image):
    """Codes of a picture that is valid."""
    issues = check(image.to_bytes())
    assert not any(v.severity == warnings.ERROR for v in issues), issues
    return [v.code for v in issues]


def first_of(chunks, type_):
    return next(k for k, c in enumerate(chunks) if c.type == type_)


def rewritten(data, type_, declared, **new):
    """A file with other values in its first chunk of a type."""
    chunks = read(data)
    k = first_of(chunks, type_)
    values = {**fields.unpack(declared, chunks[k].payload, ""), **new}
    chunks[k] = Chunk(type_, fields.pack(declared, values))
    return write(chunks)


@pytest.fixture(scope="module")
def still():
    return pyramids.implicit()


@pytest.fixture(scope="module")
def edited(still):
    move = {"op": "move", "layer": "disc", "by": [3, 4]}
    return still.edited(move, {"op": "hide", "layer": "bar"})


# Rules.


def test_rules_in_the_code_are_those_of_the_specification():
    spec = "".join(p.read_text("utf-8") for p in (ROOT / "spec").glob("*.md"))
    stated = set(re.findall(rf"\*\*\[({RULE})\]\*\*", spec))
    sources = [p.read_text("utf-8") for p in (ROOT / "proxyimg_codec").rglob("*.py")]
    named = {r for text in sources for r in re.findall(rf'"({RULE})"', text)}
    assert len(named) > 60
    assert {r for r in named - stated if not r.startswith("VAL-")} == set()


def test_valid_cases_have_no_errors():
    found = {c.name: errors(c.input.read_bytes()) for c in CASES if not c.error}
    assert len(found) > 100
    assert {name: v for name, v in found.items() if v} == {}


def test_invalid_cases_have_errors_of_their_class_and_rule():
    cited = 0
    for case in CASES:
        # What a view costs at its full size is nobody's error.
        views = ("limit-multiply-adds", "limit-work")
        if not case.error or case.name == "limit-beyond" or case.name.startswith(views):
            continue
        found = errors(case.input.read_bytes())
        assert {v.exit_code for v in found} == {CLASSES[case.error].exit_code}, (case.name, found)
        assert all(v.code for v in found), (case.name, found)
        ids = re.findall(RULE, " ".join(case.tests))
        assert not ids or {v.code for v in found} & set(ids), (case.name, ids, found)
        cited += bool(ids)
    assert cited >= 29


def test_errors_tell_their_rule():
    with pytest.raises(FormatError) as caught:
        from_bytes(b"\x89PNG\r\n\x1a\n")
    assert caught.value.rule == "CON-2"
    assert caught.value.problem in str(caught.value)
    assert FormatError("why", "chunk HEAD", 12).rule == ""


# Places, and several errors.


def test_an_error_tells_where_it_is(still):
    data = still.to_bytes()
    chunks = read(data)
    k = first_of(chunks, "TEXR") + 1
    at = chunks[k].offset
    (issue,) = errors(data[: at + 20] + bytes([data[at + 20] ^ 1]) + data[at + 21 :])
    assert (issue.code, issue.chunk, issue.offset) == ("CON-6", "TEXR 1", at)


def test_independent_errors_are_all_reported(still):
    chunks = read(still.to_bytes())
    first, net = first_of(chunks, "LAYR"), first_of(chunks, "NETW")
    info = Chunk(meta.INFO_TYPE, b"\x93\xa0\xa0\x81")
    chunks[first + 1] = Chunk("LAYR", chunks[first + 1].payload + b"\0")
    chunks = [*chunks[:-1], info, chunks[-1]]
    data = bytearray(write(chunks))
    places = {c.type: c.offset for c in read(bytes(data))}
    data[places["NETW"] + 30] ^= 1
    found = [(v.code, v.chunk) for v in errors(bytes(data))]
    assert found == [("CON-14", "LAYR 1"), ("CON-6", "NETW 0"), ("CON-14", "iNFO")]
    assert net == first_of(chunks, "NETW")


def test_streams_are_decoded_on_after_an_error(still):
    data = rewritten(still.to_bytes(), "LAYR", layr.FIELDS, unit=1)
    chunks = read(data)
    k = first_of(chunks, "TEXR")
    values = fields.unpack(texr.FIELDS, chunks[k].payload, "")
    chunks[k] = Chunk("TEXR", fields.pack(texr.FIELDS, {**values, "codes": values["codes"][:-1]}))
    found = [(v.code, v.chunk) for v in errors(write(chunks))]
    assert found[0] == ("CHK-8", "LAYR 0")
    assert [v[1] for v in found] == ["LAYR 0", "TEXR 0"]


def test_a_mesh_that_nothing_needs_is_checked(still):
    plain = changed(still, layers=Layers([changed(v, mesh=None) for v in still.layers]))
    whole = moving.picture()
    bar = next(v for v in whole.layers if v.name == "bar")
    image = changed(
        plain,
        layers=Layers(
            changed(v, mesh=bar.mesh) if v.name == "bar" else v for v in plain.layers
        ),
    )  # fmt: skip
    data = image.to_bytes()
    assert errors(data) == []
    (issue,) = errors(rewritten(data, "MESH", mesh.FIELDS, far=[0]))
    assert (issue.code, issue.chunk) == ("MSH-9", "MESH 0")


def test_truncation_anywhere_is_an_error(still):
    data = still.to_bytes()
    for end in range(0, len(data), 17):
        assert errors(data[:end]), end


def refused(data):
    """The rules that a reader says a file breaks: none or one."""
    try:
        from_bytes(data)
    except PxiError as error:
        return [error.rule]
    return []


def test_what_readers_refuse_is_an_error(still):
    """Bits flipped inside of payloads, with right CRCs."""
    chunks, rules = read(still.to_bytes()), set()
    for k, chunk in enumerate(chunks):
        for at in range(0, len(chunk.payload), 5):
            payload = bytearray(chunk.payload)
            payload[at] ^= 1 << at % 8
            data = write([*chunks[:k], Chunk(chunk.type, bytes(payload)), *chunks[k + 1 :]])
            expected = refused(data)
            assert [v.code for v in errors(data)][:1] == expected, (chunk.type, at)
            rules.update(expected)
    assert len(rules) >= 5


def test_limits(still):
    (issue,) = errors(still.to_bytes(), layers=2)
    assert (issue.code, issue.exit_code) == ("SEC-2", LimitError.exit_code)
    (issue,) = errors(still.to_bytes(), output_pixels=64 * 48 - 1)
    assert (issue.code, issue.exit_code) == ("SEC-2", LimitError.exit_code)


# Metadata and histories.


def with_chunk(image, chunk):
    chunks = read(image.to_bytes())
    return write([*chunks[:-1], chunk, chunks[-1]])


def test_a_bad_block_leaves_the_rest_to_be_checked(still):
    block = fields.pack(meta.FIELDS, {"size": 6, "zstd": meta.compressed(b"II*\0abc")})
    data = rewritten(with_chunk(still, Chunk("eXIf", block)), "LAYR", layr.FIELDS, unit=1)
    assert [(v.code, v.chunk) for v in check(data)] == [("CHK-8", "LAYR 0"), ("CHK-16", "eXIf")]


def with_history(image, steps):
    chunks = [c for c in read(image.to_bytes()) if c.type not in ("uNDO", "TAIL")]
    return write([*chunks, undo.encode(chunks, steps), Chunk("TAIL", b"")])


def spoilt(image, type_, change):
    """A history of one state, in which a chunk of the picture is another."""
    chunks = [c for c in read(image.to_bytes()) if c.type not in ("uNDO", "TAIL")]
    k = first_of(chunks, type_)
    chunks[k] = Chunk(type_, change(chunks[k].payload))
    return with_history(image, [Step("{}", tuple(chunks))])


def test_states_of_a_history_are_checked(still, edited):
    assert errors(edited.to_bytes()) == []
    (issue,) = errors(spoilt(still, "LAYR", lambda p: p[:-1]))
    assert (issue.code, issue.chunk) == ("CON-14", "uNDO")
    assert "the state before edit 1" in issue.message

    def cut(payload):
        values = fields.unpack(texr.FIELDS, payload, "")
        return fields.pack(texr.FIELDS, {**values, "codes": values["codes"][:-2]})

    (issue,) = errors(spoilt(still, "TEXR", cut))
    assert issue.chunk == "uNDO"
    assert issue.code.startswith("ENT-")
    assert "chunk TEXR 0" in issue.message


def test_a_state_has_no_history(still, edited):
    nested = tuple(read(edited.to_bytes())[:-1])
    (issue,) = errors(with_history(still, [Step("{}", nested)]))
    assert (issue.code, issue.chunk) == ("MET-16", "uNDO")


def test_what_states_share_is_decoded_once(edited, monkeypatch):
    calls = []
    decode = deltas.decode
    monkeypatch.setattr(deltas, "decode", lambda *args: calls.append(1) or decode(*args))
    assert errors(edited.to_bytes()) == []
    many = len(calls)
    calls.clear()
    assert errors(edited.baked().to_bytes()) == []
    assert len(calls) == many > 0


@pytest.mark.parametrize("bound", ["HISTORY_CHUNKS", "HISTORY_VALUES"])
def test_long_histories_are_not_checked_as_a_whole(still, edited, monkeypatch, bound):
    other = moving.picture().to_bytes()
    state = tuple(c for c in read(other) if c.type != "TAIL")
    data = with_history(still, [Step("{}", state)])
    assert check(data) == []
    monkeypatch.setattr(validate, bound, 9)
    assert [(v.code, v.severity) for v in check(data)] == [("VAL-11", "warning")]


# What is odd.


def posed(image, name, **new):
    return changed(
        image,
        layers=Layers(
            changed(v, pose=changed(v.pose, **new)) if v.name == name else v for v in image.layers
        ),
    )


def test_nothing_is_odd_about_a_plain_file(still, edited):
    assert odd(still) == []
    assert odd(moving.picture()) == []
    assert odd(edited.undone(1)) == []


def test_a_stranger_leaves_chunks_and_stale_histories(edited):
    chunks = read(edited.undone(1).to_bytes())
    data = write([*chunks[:-2], Chunk("teSt", b"x"), *chunks[-2:]])
    assert [(v.code, v.chunk) for v in check(data)] == [("VAL-1", "teSt"), ("VAL-2", "uNDO")]


def icc(size=128, space=b"RGB ", mark=b"acsp"):
    block = bytearray(128)
    block[:4], block[16:20], block[36:40] = size.to_bytes(4, "big"), space, mark
    return bytes(block)


@pytest.mark.parametrize(
    ("name", "block", "codes"),
    [
        ("icc", icc(), []),
        ("icc", icc(129), ["VAL-3"]),
        ("icc", icc(space=b"GRAY"), ["VAL-3"]),
        ("icc", icc(mark=b"ACSP"), ["VAL-3"]),
        ("icc", b"short", ["VAL-3"]),
        ("exif", b"MM\0*\0\0\0\x08", []),
        ("exif", b"Exif\0\0II*\0", ["VAL-4"]),
        ("cicp", bytes([12, 13, 0, 1]), []),
        ("cicp", bytes([2, 13, 0, 1]), ["VAL-13"]),
        ("cicp", bytes([9, 200, 0, 1]), ["VAL-13"]),
        ("xmp", b"<x><y/></x>", []),
        ("xmp", b"<x><y></x>", ["VAL-5"]),
        ("xmp", b"<!DOCTYPE x><x/>", ["VAL-5"]),
    ],
)
def test_metadata(still, name, block, codes):
    assert odd(changed(still, blocks={name: block})) == codes


@pytest.mark.parametrize(("text", "codes"), [('{"a": 1}', []), ("[]", ["VAL-6"]), ("{", ["VAL-6"])])
def test_settings(still, text, codes):
    assert odd(changed(still, info={"encoder": "x", "settings": text, "areas": []})) == codes
    whole = moving.picture()
    assert odd(changed(whole, timeline=replace(whole.timeline, script=text))) == codes


def test_layers_that_do_not_show(still):
    assert odd(posed(still, "disc", hidden=True)) == ["VAL-8"]
    assert odd(posed(still, "disc", shift=(-47 << 10, 0))) == ["VAL-7"]
    assert odd(posed(still, "disc", shift=(-45 << 10, 0))) == []
    assert odd(posed(still, "disc", shift=(0, 40 << 10))) == ["VAL-7"]


def test_folded_meshes():
    image = moving.picture().at(0)
    disc = image.layers["disc"]
    nodes = disc.mesh.refined.nodes
    zero = replace(disc.pose, sway=None, body=None)
    flipped = -2 * (nodes - nodes.mean(0).astype(int))[:, 0] >> 6
    swapped = zero.nodes if zero.nodes is not None else 0 * nodes
    swapped[:, 0] = flipped
    layers = [changed(v, pose=replace(zero, nodes=swapped if v == disc else None, sway=None))
              for v in image.layers]  # fmt: skip
    folded = changed(image, layers=Layers(layers))
    assert odd(folded) == ["VAL-9"]
    mirrored = posed(folded, "disc", matrix=(-1 << 24, 0, 0, 1 << 24), shift=(64 << 10, 0))
    assert odd(mirrored) == ["VAL-9"]
    unbent = posed(mirrored, "disc", nodes=None)
    assert odd(unbent) == []


def test_motion_without_displacement():
    whole = moving.picture()
    assert odd(whole) == []
    layers = [
        changed(v, track=v.track and replace(v.track, shapes=0 * v.track.shapes))
        if v.name == "bar"
        else v
        for v in whole.layers
    ]
    (issue,) = check(changed(whole, layers=Layers(layers)).to_bytes())
    assert (issue.code, issue.chunk) == ("VAL-10", "mOTN")
    assert "'bar'" in issue.message


def test_old_versions_are_noted():
    data = (ROOT / "tests/golden/0.2/edited.pxi").read_bytes()
    assert [(v.code, v.severity) for v in check(data)] == [("VAL-12", "note")]

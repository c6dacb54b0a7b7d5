"""What can be refused before anything is decoded."""

import msgpack
import pytest

from conformance.make.refused.poses import CASES, COPY_TEXR, DISC_TEXR, Clear, Odd, Posed
from proxyimg_codec.container import texr
from proxyimg_codec.container.file import parse, serialize
from proxyimg_codec.errors import FormatError, LimitError, UnsupportedError

BASES = {kind: kind() for kind in (Posed, Odd, Clear)}

REFUSED = {
    "invalid-mesh-order": "MESH.*out of order",
    "invalid-pose-order": "POSE.*out of order",
    "invalid-mesh-twice": "MESH: layers do not ascend",
    "invalid-mesh-descending": "MESH: layers do not ascend",
    "invalid-mesh-layer": "MESH: layers .* do not exist",
    "invalid-pose-twice": "POSE: layers do not ascend",
    "invalid-pose-layer": "POSE: layers .* do not exist",
    "invalid-shared-self": "earlier layer",
    "invalid-shared-later": "earlier layer",
    "invalid-shared-chain": "shared itself",
    "invalid-shared-values": "7 values instead of 2: coder, texture",
    "invalid-shared-sampling": "number of features",
    "invalid-sampling-mesh": "needs a mesh",
    "invalid-sampling-odd": "even number",
    "invalid-channels": "more channels",
    "invalid-opaque-alpha": "gives alpha",
    "invalid-opaque-moved": "cover the canvas",
    "invalid-opaque-turned": "cover the canvas",
    "invalid-opaque-bent": "cover the canvas",
    "invalid-opaque-opacity": "cover the canvas",
    "invalid-opaque-hidden": "cover the canvas",
    "invalid-levels": "'levels'",
    "invalid-step": "'step'",
    "invalid-pose-matrix": "'matrix'",
    "invalid-pose-shift": "'shift'",
    "invalid-pose-opacity": "'opacity'",
    "invalid-pose-hidden": "'hidden'",
}


@pytest.mark.parametrize("name", REFUSED)
def test_contradictions_are_refused(name):
    case = CASES[name]
    with pytest.raises(FormatError, match=REFUSED[name]):
        parse(case.build(BASES[case.base]))


def test_gates_are_limited():
    with pytest.raises(LimitError, match="gates"):
        parse(CASES["limit-gates"].build(BASES[Posed]))


@pytest.mark.parametrize("base", BASES)
def test_what_they_are_made_of_is_right(base):
    data = BASES[base].data
    container = parse(data)
    assert serialize(container) == data
    assert [v["layer"] for v in container.meshes] == [1, 2]
    assert [v["layer"] for v in container.poses] == [1]
    assert container.texture_of(2) is container.textures[1]


@pytest.mark.parametrize("coder", [3, 5, 127, 128, 200, 255])
def test_other_coders_are_not_known(coder):
    base = BASES[Posed]
    for at in (DISC_TEXR, COPY_TEXR):
        with pytest.raises(UnsupportedError, match=f"coder {coder} "):
            parse(base.set(at, coder=coder))


@pytest.mark.parametrize("start", [b"\x91", b"\x9f", b"\x81\xa5coder", b"\x8f\xa5coder"])
@pytest.mark.parametrize("coder", [*texr.CODERS, 3, 127, 128, 255])
def test_the_coder_stands_first_in_arrays_and_maps(start, coder):
    payload = start + msgpack.packb(coder)
    if coder in texr.CODERS:
        assert texr.fields_of(payload) is texr.CODERS[coder]
        return
    with pytest.raises(UnsupportedError, match=f"coder {coder} "):
        texr.fields_of(payload)


@pytest.mark.parametrize("value", [b"", b"\xcc\x01", b"\xcd\x01\x00", b"\xc3", b"\xa5coder\x03"])
@pytest.mark.parametrize("start", [b"\x91", b"\x81\xa5coder", b"\x81\xa5codes", b"\xa1", b""])
def test_what_has_no_small_coder_is_invalid(start, value):
    payload = start + value
    assert texr.fields_of(payload) is texr.FIELDS
    with pytest.raises(FormatError):
        parse(BASES[Posed].payload(DISC_TEXR, payload))

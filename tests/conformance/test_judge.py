"""What passes, and what is named as wrong."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis.extra.numpy import arrays

from conformance import judge, pixels
from conformance.cases import Case, Render
from conformance.judge import Ended
from proxyimg_codec.io import png
from tests.conformance.decoders import BY_NAME, CASES, picture


def test_a_refused_file_must_not_leave_a_picture():
    def decoder(source, target, flags):
        target.write_bytes(b"something")
        return Ended(4)

    assert judge.judge(BY_NAME["invalid-empty"], 0, decoder).problem.startswith("output: ")


def ending(code, picture=None):
    """A decoder that always ends so, and may write a picture."""

    def decoder(source, target, flags):
        assert flags == ("--bit-depth", "16")
        if picture is not None:
            target.write_bytes(picture)
        return Ended(code)

    return decoder


def test_what_is_optional_may_be_refused_or_shown():
    optional = [case for case in CASES if case.optional]
    assert len(optional) >= 40
    assert {case.error for case in optional} == {"invalid", "limit"}
    case = BY_NAME["invalid-tree-circle"]
    right = case.renders[0].expected.read_bytes()
    wrong = png.encode_png(pixels.read(right) ^ 0x4000)
    ends = [
        (ending(4), ""),
        (ending(0, right), ""),
        (ending(0, wrong), "pixels: "),
        (ending(0), "output: no picture"),
        (ending(4, right), "output: a picture was written"),
        (ending(5), "exit: code 5 instead of 4"),
        (ending(1), "exit: code 1 instead of 4"),
    ]
    for decoder, problem in ends:
        found = judge.judge(case, 0, decoder).problem
        assert found.startswith(problem)
        assert bool(found) == bool(problem)


def test_differences_are_premultiplied_8_bit_levels():
    grey = picture(32896, 32896, 32896)
    assert judge.difference(grey, grey) == (0, 0)
    peak, rms = judge.difference(grey, picture(0, 32896, 32896))
    assert peak == pytest.approx(128)
    assert rms == pytest.approx(64)
    clear = picture(9, 9, 9, 0), picture(65535, 0, 7, 0)
    assert judge.difference(*clear) == (0, 0)
    opaque = picture(0.5, 0.5, 0.5, 1, dtype=np.float32)
    assert judge.difference(opaque, picture(0.5, 0.5, 0.5, dtype=np.float32)) == (0, 0)
    assert judge.difference(opaque, picture(0.5, 0.5, 0.5, 0, dtype=np.float32))[0] == 255


@given(arrays(np.uint16, (3, 4, 4)), arrays(np.uint16, (3, 4, 3)))
def test_the_mean_error_never_exceeds_the_largest(a, b):
    peak, rms = judge.difference(a, b)
    assert 0 <= rms <= peak <= 255


@pytest.mark.parametrize("off", [1, 3, 7, 257, 65535])
def test_the_mean_of_errors_that_are_alike_is_their_size(off):
    a = np.zeros((37, 29, 3), np.uint16)
    peak, rms = judge.difference(a, a + np.uint16(off))
    assert rms <= peak
    # Alpha is alike: three samples of four are off.
    assert rms == pytest.approx(peak * 0.75**0.5)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_one_bad_number_is_enough(bad, tmp_path):
    def decoder(source, target, flags):
        almost = picture(0, 0, 0, dtype=np.float32)
        almost[1, 2, 0] = bad
        np.save(target, almost)
        return Ended(0)

    (tmp_path / "black.png").write_bytes(png.encode_png(picture(0, 0, 0)))
    case = Case("c", "", (), Path(), (Render({}, (), tmp_path / "black.png", 1e9, 1e9),), None)
    result = judge.judge(case, 0, decoder, ".npy")
    assert result.problem == "pixels: not all are finite numbers"
    assert result.peak is None

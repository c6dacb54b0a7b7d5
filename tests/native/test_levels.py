"""Levels of the compiled core: each gives the same pixels, and what runs is said."""

import subprocess
import sys
import zlib

import numpy as np
import pytest

from proxyimg_codec import from_bytes
from proxyimg_codec.native import kernel, levels
from proxyimg_codec.texture import planes, registered_model
from proxyimg_codec.texture.latents import Latents
from tests.support.paths import ROOT

GOLDEN = ROOT / "tests" / "golden"
PICTURES = {
    "0.2/edited": 2962218641,
    "0.9/edited": 877019302,
    "0.10/mixed": 1971581676,
    "0.10/cuts-moved": 161141074,
}
"""Checksums of their pixels, of both coders: the same on every processor that has a core."""


@pytest.fixture
def choose(monkeypatch):
    """A function that chooses a level, as a new process does."""

    def chosen(name):
        monkeypatch.setenv("PROXYIMG_CORE", name)
        monkeypatch.delenv("PROXYIMG_NO_KERNEL", raising=False)
        kernel.library.cache_clear()
        return levels.chosen()

    yield chosen
    monkeypatch.undo()
    kernel.library.cache_clear()


def pixels(name):
    image = from_bytes((GOLDEN / f"{name}.pxi").read_bytes())
    return image.render(), image.render(width=29, dtype=np.float32)


@pytest.mark.skipif(levels.chosen().library is None, reason="the core was not compiled")
@pytest.mark.parametrize("name", PICTURES)
def test_all_levels_give_the_same_pixels(name, choose):
    found = {}
    for level in levels.LEVELS:
        if choose(level).level == level:
            found[level] = pixels(name)
    assert found
    for whole, small in found.values():
        assert zlib.crc32(whole.tobytes()) == PICTURES[name]
        np.testing.assert_array_equal(small, next(iter(found.values()))[1])


def exaggerated(model, seed):
    """A model whose context networks have int8 weights of all sizes, many of them the largest."""
    rng = np.random.default_rng(seed)

    def grown(name, array):
        if array.values.ndim == 1:
            return array
        values = rng.integers(-128, 128, array.values.shape).astype(np.int32)
        values[rng.random(values.shape) < 0.17] = 127
        values[rng.random(values.shape) < 0.17] = -128
        return array._replace(
            values=values, exponent=array.exponent - (3 if name == "second" else 2)
        )

    contexts = [
        c._replace(**{n: grown(n, getattr(c, n)) for n in c._fields if n != "first_by_step"})
        for c in model.context
    ]
    return model._replace(context=tuple(contexts))


@pytest.mark.skipif(levels.chosen().library is None, reason="the core was not compiled")
def test_weights_of_all_sizes_give_the_same_bytes_and_latents(choose, monkeypatch):
    model = exaggerated(registered_model.registered(2), 5)
    monkeypatch.setattr(registered_model, "registered", lambda number: model)
    rng = np.random.default_rng(6)
    shapes = [(37, 45), (19, 23), (10, 12)]
    coarse = rng.integers(-3000, 3000, (3, 10, 12)).astype(np.int32)
    few = [
        (rng.laplace(0, 2, (9, h, w)) * (rng.random((h, w)) < 0.4)).astype(np.int32)
        for h, w in shapes
    ]
    latents = Latents(tuple(few), coarse)

    found = {}
    for level in (*levels.LEVELS, levels.NUMPY):
        if choose(level).level == level:
            packed = planes.encoded(latents, (90, 74), 300, tile=0).packed
            found[level] = packed, planes.Planes(packed).latents.levels
    assert len(found) > 1
    expected, kept = found[levels.NUMPY]  # latents that are certain to be 0 are not kept
    for packed, decoded in found.values():
        assert packed == expected
        for a, b in zip(decoded, kept, strict=True):
            np.testing.assert_array_equal(a, b)


def test_a_level_that_is_not_there_means_numpy_and_a_reason(choose):
    assert choose("best").level == "numpy"
    assert "PROXYIMG_CORE=best: there are" in str(choose("best")) or kernel.library() is None
    assert str(choose("numpy")) == "core: numpy (PROXYIMG_CORE asks for it)"
    assert not kernel.available()


class Old:
    """A library as on a processor that has nothing more than AVX2."""

    pxi_decode_avx512 = pxi_decode_avx2 = pxi_decode_baseline = None

    @staticmethod
    def pxi_lacking(name):
        return b"avx512bw" if name == b"avx512" else None


def test_why_no_better_level_runs_is_said(choose, monkeypatch):
    monkeypatch.setattr(levels, "_loaded", Old)
    assert str(choose("")) == "core: avx2 (the processor lacks avx512bw for avx512)"
    assert str(choose("avx512")) == "core: numpy (the processor lacks avx512bw for avx512)"
    assert choose("baseline").level == "baseline"


def test_a_library_that_does_not_load_means_numpy(choose, monkeypatch, tmp_path):
    monkeypatch.setattr(levels, "__file__", str(tmp_path / "levels.py"))
    assert "core: numpy (the compiled core is not installed" in str(choose(""))
    (tmp_path / "_kernel.so").write_bytes(b"not a library")
    assert "core: numpy (the compiled core does not load: " in str(choose(""))


def test_info_says_which_core_runs(tool):
    lines = tool("info", "--version").out.decode().splitlines()
    assert lines[1:] == [str(levels.chosen())]


def test_choosing_needs_no_numpy():
    code = (
        "import sys; from proxyimg_codec.native import levels; "
        "levels.chosen(); print('numpy' in sys.modules)"
    )
    command = [sys.executable, "-c", code]
    ran = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    assert ran.stdout == "False\n"

"""The engine numpy uses nothing compiled: not to open, decode, warp or blend."""

import numpy as np
import pytest

import proxyimg_codec as pxi
from proxyimg_codec.native import kernel
from tests.support.paths import ROOT

needs_kernel = pytest.mark.skipif(not kernel.available(), reason="the kernel was not compiled")

CASES = {
    kind: sorted((ROOT / "conformance" / "cases" / kind).rglob("*.pxi"))
    for kind in ("layers", "meshes", "motion", "pyramids", "samplings", "textures", "views")
}


def forbidden():
    raise AssertionError("the engine numpy asked for the kernel")


@pytest.fixture
def no_kernel(monkeypatch):
    """What loads the kernel fails."""
    monkeypatch.setattr(kernel, "library", forbidden)


@pytest.mark.parametrize("kind", CASES)
def test_decoding_never_loads_the_kernel(kind, no_kernel, tool, tmp_path):
    assert CASES[kind]
    for path in CASES[kind][::3]:
        tool("decode", path, tmp_path / "a.npy", "--engine", "numpy", "-f")


@pytest.mark.parametrize("suffix", [".ora", ".svg"])
def test_layers_are_written_without_it(suffix, moving_pxi, no_kernel, tool, tmp_path):
    tool("decode", moving_pxi, tmp_path / f"a{suffix}", "--engine", "numpy")
    assert (tmp_path / f"a{suffix}").stat().st_size > 0


def test_clips_are_drawn_without_it(moving_pxi, no_kernel, tool, tmp_path):
    pytest.importorskip("OpenImageIO")
    tool("animate", moving_pxi, tmp_path / "a.apng", "--engine", "numpy", "--fps", 2)
    assert (tmp_path / "a.apng").stat().st_size > 0


@pytest.mark.parametrize("engine", ["auto", "ort"])
def test_other_engines_ask_for_it(engine, small_pxi, no_kernel):
    if engine == "ort":
        pytest.importorskip("onnxruntime")
    with pytest.raises(AssertionError, match="asked for the kernel"):
        pxi.open(small_pxi).render(engine=engine)


@needs_kernel
@pytest.mark.parametrize("path", CASES["views"][::4], ids=lambda p: p.parent.name)
def test_what_the_kernel_decoded_is_not_taken(path, monkeypatch):
    image, other = pxi.open(path), pxi.open(path)
    wanted = {"width": 37, "height": 29, "dtype": np.float32}
    fast = image.render(engine="native", **wanted)
    with monkeypatch.context() as patch:
        patch.setattr(kernel, "library", forbidden)
        plain = image.render(engine="numpy", **wanted)
        alone = other.render(engine="numpy", **wanted)
    assert np.array_equal(plain, alone)
    assert np.array_equal(image.render(engine="native", **wanted), fast)
    assert np.abs(plain - fast).max() < 1e-3


@needs_kernel
def test_the_kernel_is_back_afterwards(small_pxi):
    seen = []
    image = pxi.open(small_pxi)
    with pytest.raises(ZeroDivisionError):
        image.render(engine="numpy", progress=lambda n: seen.append(kernel.available()) or 1 / 0)
    assert seen == [False]
    assert kernel.available()

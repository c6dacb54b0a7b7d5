"""pxi-bench paper: sections on compression, ablations, animation, and figures of rivals."""

import numpy as np
import pytest

from proxyimg_codec.bench.paper import ablations, checks, compression, explicit, items
from proxyimg_codec.bench.paper.animation import _masks as regions_of
from proxyimg_codec.encoder.implicit.node_problem import NodeOptions
from proxyimg_codec.io import raster
from tests.support.paper import rows_of
from tests.support.pictures import disc, smooth


def ran(tool, data, tmp_path, section, *more):
    out = tmp_path / "out"
    tool("bench", "paper", "--data", data, "--out", out, "--quick", "--only", section, *more)
    return rows_of(out, section), (out / "report.md").read_text()


def test_compression_of_folders_that_are_named(tool, data, tmp_path, here, monkeypatch):
    monkeypatch.setattr(compression, "CODECS", ("jpeg", "jp2", "webp"))
    monkeypatch.setattr(compression, "RATES", (4.0,))
    monkeypatch.setattr(compression, "TRIES", 1)
    photos = tmp_path / "my photos"
    photos.mkdir()
    raster.write(photos / "x.png", smooth(61, 53))
    rows, text = ran(tool, data, tmp_path, "compression", "--photos", photos)
    assert {r["picture"] for r in rows} == {"my photos x"}
    assert [r["method"] for r in rows if r["method"].startswith("pxi")] == [
        "pxi implicit", "pxi pyramid",
    ]  # fmt: skip
    by = {r["method"]: r for r in rows}
    for method in ("COIN", "2-D Gaussians", "WebP", "JPEG", "pxi pyramid"):
        assert 0.1 < by[method]["bpp"] < 4.1, method
        assert by[method]["encoding"] > 0
        assert by[method]["decoding"] > 0
    assert min(by["WebP"]["psnr"], by["pxi pyramid"]["psnr"]) > 24
    assert "pxi pyramid at 4 bpp: " in text


def test_codecs_that_are_missing_are_named(monkeypatch):
    class Gone:
        label = "Gone"

        qualities = (1, 2)

        def encode(self, pixels, quality):
            raise OSError("no plug-in")

    from proxyimg_codec.bench import peers

    real = peers.codecs()
    monkeypatch.setattr(peers, "codecs", lambda: real | {"jxl": Gone()})
    assert compression._present() == ["jpeg", "jp2", "webp", "avif444"]
    rows = [{"picture": "a", "rate": "0.5", "method": "JPEG", "psnr": 30.0, "bpp": 0.5}]
    said = compression.conclusions(rows)
    assert "not installed: JPEG 2000, WebP, AVIF 4:4:4, Gone." in said[-1]


def test_files_that_are_too_large_are_not_compared():
    rows = [
        {"picture": "a", "rate": "0.5", "method": m, "psnr": v, "bpp": b}
        for m, v, b in (("WebP", 40.0, 0.9), ("JPEG", 31.0, 0.5), ("pxi pyramid", 32.0, 0.52),
                        ("pxi implicit", 39.0, 0.6))
    ]  # fmt: skip
    assert compression.conclusions(rows)[:2] == [
        "pxi pyramid at 0.5 bpp: ahead of all.",
        "pxi implicit cannot be as small as 0.5 bpp here; not compared.",
    ]


def test_ablations_and_sweeps(tool, data, tmp_path, here, monkeypatch):
    few = {k: ablations.ABLATIONS[k] for k in ("edge only", ablations.METHOD)}
    monkeypatch.setattr(ablations, "ABLATIONS", few)
    monkeypatch.setattr(
        ablations, "SWEEPS", {"width": {16: NodeOptions(hidden=16), 64: NodeOptions()}}
    )
    rows, text = ran(tool, data, tmp_path, "ablations")
    by = {(r["study"], r["variant"]): r for r in rows}
    whole = by["parts", ablations.METHOD]
    assert by["width", "64"] | {"study": "parts", "variant": ablations.METHOD} == whole
    assert by["width", "16"]["parameters"] < by["parts", "edge only"]["parameters"]
    assert by["parts", "edge only"]["parameters"] < whole["parameters"]
    assert "edge only: " in text
    assert "dB against the method." in text


def test_sizes_of_the_network_are_those_asked_for():
    paper = NodeOptions().network(3)
    assert paper.parameters == 55747
    assert NodeOptions(dim=8).network(3).dim == 16
    assert NodeOptions(hidden=32, depth=2).network(3).parameters == 672 * 32 + 32 + 33 * 32 + 99


def test_animation(tool, data, tmp_path, here, monkeypatch):
    from proxyimg_codec.bench.paper import animation

    monkeypatch.setattr(animation, "CODERS", ("pyramid",))
    monkeypatch.setattr(animation, "PRESETS", {"sway": None})
    monkeypatch.setattr(animation, "SECONDS", 0.5)
    (data / "kodak_masks").mkdir()
    label = np.repeat(disc(50, 45)[..., None], 3, 2).astype(np.uint8)
    raster.write(data / "kodak_masks" / "b c.png", label * 255)
    rows, _ = ran(tool, data, tmp_path, "animation")
    aside, moved = sorted(rows, key=lambda r: r["coder"])
    assert (aside["motion"], moved["motion"]) == ("moved aside 8 px", "sway")
    assert 0 < moved["flow"] < moved["idle"]
    assert moved["frechet"] > 0
    assert 0 < moved["gradients"] < 1.5


def test_masks_of_a_crop_are_neither_empty_nor_all_of_it(tmp_path):
    marks = np.zeros((60, 80, 3), np.uint8)
    marks[:, :40], marks[25:35, 45:55], marks[:5] = 1, 2, 3
    np.save(tmp_path / "m.npy", marks[..., 0])
    found = regions_of(tmp_path / "m.npy", np.zeros((60, 80, 3), np.uint8), 40)
    assert {int(r.mask.sum()) for r in found if r.name != "back"} == {800, 100}


def test_figures_of_rivals(tool, data, tmp_path, here):
    rows, text = ran(tool, data, tmp_path, "checks")
    assert {(r["rival"], r["published"], r["parameters"]) for r in rows} == {
        ("COIN, 5 layers of 30", 24.6411, 3903), ("GaussianImage, 800", 24.65, 6400),
    }  # fmt: skip
    assert "against the published mean (of 1, where the published figure is of 24), below" in text
    rows = [{"rival": "GaussianImage, 800", "psnr": 24.2, "picture": str(k)} for k in range(24)]
    assert checks.conclusions(rows) == [
        "GaussianImage, 800: -0.45 dB against the published mean, within ±0.7 dB."
    ]


@pytest.mark.parametrize(
    ("value", "verdict"), [(0.1, "is reached"), (0.3, "is not reached")]
)  # fmt: skip
def test_the_paper_s_figures_of_flat_art_are_told(value, verdict):
    rows = [{"folder": "emoji", "method": m, "mse": v, "picture": "a"}
            for m, v in (("pxi pyramid", value), ("WebP", 0.2))]  # fmt: skip
    first, absent = explicit.conclusions(rows)
    assert verdict in first
    assert first.endswith("Lowest of all: " + ("pxi pyramid." if value < 0.2 else "WebP."))
    assert absent.startswith("VTracer is missing")


def test_what_others_measure_may_change_without_measuring_again(monkeypatch, tmp_path):
    versions = {name: items.code_version(name) for name in ("editing", "implicit")}
    assert versions["editing"] != versions["implicit"]

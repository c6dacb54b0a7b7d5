"""pxi-bench paper: sections, resuming, and the report."""

from functools import partial

import numpy as np
import pytest

from proxyimg_codec.bench.paper import (
    SECTIONS,
    explicit,
    items,
    pictures,
    report,
    resolution,
    run,
    store,
)
from proxyimg_codec.bench.paper import implicit as implicit_section
from proxyimg_codec.bench.paper.ours import SHAPE, grid_of, of_size
from proxyimg_codec.bench.paper.tables import Column, Table
from proxyimg_codec.bench.peers import codecs
from proxyimg_codec.bench.rivals import sines
from proxyimg_codec.errors import InputError
from proxyimg_codec.io import raster
from tests.support.paper import rows_of
from tests.support.pictures import disc, smooth


def test_a_run_from_pictures_to_a_report(tool, data, tmp_path, here):
    out = tmp_path / "out"
    tool("bench", "paper", "--data", data, "--out", out, "--quick", "--only", "implicit")
    rows = rows_of(out, "implicit")
    count = sines.count(48, 4)
    named = {(r["method"], r["fit"]) for r in rows}
    rivals = ("SIREN, 3 layers", "COIN", "hash grid", "2-D Gaussians", "LIIF-like grid")
    for rival in ("SIREN, 5 layers", *rivals):
        assert {(rival, "long"), (rival, "equal time")} <= named
    assert {m for m, _ in named} >= {"pxi direct", "pxi node", "pxi pyramid"}
    assert {r["picture"] for r in rows} == {"a"}
    counts = [r["parameters"] for r in rows if r["method"] in rivals]
    assert all(0.8 * count < n <= count for n in counts)
    text = (out / "report.md").read_text()
    assert text.startswith("# The paper's tables, made again\n\n```\n$ pxi-bench paper --data")
    assert "| ProxyImg (paper) |  | 59955 | 36.99 |" in text
    assert "pxi direct against SIREN, 3 layers, long: " in text
    page = (out / "report.html").read_text()
    assert "<td>ProxyImg (paper)</td>" in page
    assert "<em>equal time</em>" in page
    assert "spacing o = 8 there are " in text
    assert (out / "implicit.svg").read_text().count("2-D Gaussians") == 2
    assert (out / "implicit.png").read_bytes()[:4] == b"\x89PNG"


def test_resolution(tool, data, tmp_path, here, monkeypatch):
    monkeypatch.setattr(resolution, "CODERS", {"direct": resolution.CODERS["direct"]})
    out = tmp_path / "out"
    tool("bench", "paper", "--data", data, "--out", out, "--quick", "--only", "resolution")
    rows = rows_of(out, "resolution")
    assert len(rows) == 2 * (2 + 3)
    for factor in ("1/2", "1/4"):
        plain = [r for r in rows if r["factor"] == factor and r["method"] == "no coder"]
        coded = [r for r in rows if r["factor"] == factor and r["method"] == "pxi direct"]
        assert {r["drawn"] for r in coded} == {"by itself", "bicubic", "Lanczos"}
        assert all(0 < r["bytes"] < 5000 for r in coded)
        assert max(r["psnr"] for r in coded) - min(r["psnr"] for r in coded) < 1.5
        assert all(r["small_psnr"] > 20 and 0.2 < r["sharpness"] < 1 for r in coded)
        assert all(r["small_psnr"] is None and r["psnr"] > 24 for r in plain)
    assert "pxi direct, 1/2: drawing at the first size " in (out / "report.md").read_text()


def test_explicit(tool, data, tmp_path, here):
    (data / "emoji").mkdir()
    face = np.dstack([smooth(41, 43), 255 * disc(41, 43).astype(np.uint8)])
    raster.write(data / "emoji" / "face.png", face)
    out = tmp_path / "out"
    tool("bench", "paper", "--data", data, "--out", out, "--quick", "--only", "explicit")
    rows = [r for r in rows_of(out, "explicit") if r["folder"] == "emoji"]
    by = {r["method"]: r for r in rows}
    files = {"WebP", "pxi pyramid", "pxi pyramid, found layers"}
    assert by.keys() - {"VTracer, as few numbers", "VTracer, any number"} == (
        files | {"2-D Gaussians", "Bézier paths"}
    )
    assert by["2-D Gaussians"]["parameters"] == by["Bézier paths"]["parameters"] == 280
    for row in rows:
        assert row["psnr"] == pytest.approx(-10 * np.log10(row["mse"] / 1000), abs=0.01)
        assert row["psnr"] > (20 if row["method"] in files else 3)
    assert all(by[m]["bytes"] < 1300 for m in files)
    assert "| icons | ProxyImg (paper) | 0.110 |" in (out / "report.md").read_text()


def test_pictures_are_drawn_over_white(tmp_path):
    clear = np.zeros((9, 7, 4), np.uint8)
    clear[2, 3] = (200, 100, 0, 51)
    raster.write(tmp_path / "a.png", clear)
    ((name, pixels),) = pictures.over_white(tmp_path, 5, 8)
    assert (name, pixels.shape) == ("a", (8, 7, 3))
    assert pixels[2, 3].tolist() == [244, 224, 204]
    assert (np.delete(pixels.reshape(-1, 3), 2 * 7 + 3, 0) == 255).all()


def test_pictures_are_chosen_evenly(tmp_path):
    for k in range(7):
        raster.write(tmp_path / f"{k}.png", smooth(12, 12))
    assert [n for n, _ in pictures.crops(tmp_path, 3, 12)] == ["0", "2", "4"]
    assert len(pictures.crops(tmp_path, 24, 12)) == 7


def test_files_are_as_large_as_they_may_be():
    webp, picture = codecs()["webp"], smooth(64, 48)
    sizes = [len(webp.encode(picture, q)) for q in range(101)]
    size = sizes[60]
    assert sizes[-1] > len(explicit.largest(webp, picture, size)) > 0.9 * size
    assert len(explicit.largest(webp, picture, size)) <= size
    assert explicit.largest(webp, picture, 1) == webp.encode(picture, 0)


def test_sizes_out_of_reach_are_the_nearest():
    picture = smooth(29, 23)
    most, least = (len(of_size(picture, n, effort=1).to_bytes()) for n in (10**6, 20))
    assert 20 < least < most < 10**6


def test_sharpness():
    picture = smooth(60, 50)
    assert resolution.sharpness(picture, picture) == pytest.approx(1)
    dull = (picture.astype(int) // 2 + 60).astype(np.uint8)
    assert resolution.sharpness(picture, dull) == pytest.approx(0.5, abs=0.02)


def made(data, out, measure, settings="s", names=("one", "two")):
    pixels = smooth(5, 4)
    found = [items.Item("implicit", "a", n, settings, pixels, partial(measure, n)) for n in names]
    return run.Plan({"implicit": found})


def test_resuming_measures_what_does_not_hold(data, tmp_path, here):
    ran = []

    def measure(name, pixels, earlier):
        ran.append((name, sorted(earlier)))
        return [{"method": name, "fit": "", "psnr": 20.0}]

    plan = made(data, tmp_path, measure)
    for _ in range(2):
        run.measure(plan.groups(tmp_path), 1, lambda result: None)
    assert ran == [("one", []), ("two", ["one"])]
    assert store.load(tmp_path, plan.items["implicit"][1])[0]["picture"] == "a"

    store.path_of(tmp_path, plan.items["implicit"][1]).write_text('{"key": ')
    run.measure(plan.groups(tmp_path), 1, lambda result: None)
    assert ran[2:] == [("two", ["one"])]

    other = made(data, tmp_path, measure, "other settings")
    run.measure(other.groups(tmp_path), 1, lambda result: None)
    assert ran[3:] == [("one", []), ("two", ["one"])]
    run.forget(tmp_path, other)
    assert len(other.groups(tmp_path)) == 1


def test_a_failure_leaves_the_rest(data, tmp_path, here):
    def measure(name, pixels, earlier):
        if name == "two":
            raise InputError("bad luck")
        return [{"method": name, "fit": "", "psnr": 20.0}]

    plan = made(data, tmp_path, measure, names=("one", "two", "three"))
    failed = []
    run.measure(plan.groups(tmp_path), 1, failed.append)
    assert [f.message for f in failed] == ["implicit, a, two: bad luck"]
    run.write(tmp_path, plan, ["head"])
    text = (tmp_path / "report.md").read_text()
    assert "| one |" in text
    assert "- Only 1 of 3 measurements are there yet." in text


def test_results_are_kept(tool, data, tmp_path, here, monkeypatch):
    def items_of(data, effort):
        return [items.Item("implicit", "a", "one", "s", smooth(5, 4), lambda pixels, earlier: [
            {"method": "pxi direct", "fit": "", "psnr": 31.25}])]  # fmt: skip

    monkeypatch.setattr(implicit_section, "items", items_of)
    words = ("bench", "paper", "--data", data, "--out", tmp_path / "out", "--only", "implicit")
    tool(*words)
    first = (tmp_path / "out/implicit.csv").read_text()
    assert "31.25" in first
    assert "--resume" in tool(*words, code=3).err
    tool(*words, "--resume")
    assert (tmp_path / "out/implicit.csv").read_text() == first
    (tmp_path / "out/report.md").unlink()
    tool(*words, "--report")
    assert "| pxi direct |" in (tmp_path / "out/report.md").read_text()
    (held,) = (tmp_path / "out/items/implicit").iterdir()
    held.unlink()
    tool(*words, "--report")
    assert "or is to come" in (tmp_path / "out/report.md").read_text()
    assert not held.exists()
    tool(*words, "--force", "--quiet")
    tool(*words, "--force", "--resume", code=2)


def test_failures_and_interruptions_are_told(tool, data, tmp_path, here, monkeypatch):
    def items_of(data, effort):
        return [items.Item("implicit", name, "one", "s", smooth(5, 4), fail) for name in "ab"]

    def fail(pixels, earlier):
        raise error("bad luck")

    monkeypatch.setattr(implicit_section, "items", items_of)
    words = ("bench", "paper", "--data", data, "--out", tmp_path / "out", "--only", "implicit")
    error = InputError
    message = tool(*words, code=3).err
    assert "2 of 2 pictures failed, the first: implicit, a, one: bad luck" in message
    assert "every measurement failed" in (tmp_path / "out/report.md").read_text()
    error = KeyboardInterrupt
    assert b"--resume goes on from there" in tool(*words, "--force", code=130).out


def test_what_is_wrong_is_said(tool, data, tmp_path):
    words = ("bench", "paper", "--out", tmp_path / "out", "--data")
    assert "explicit, implicit, compression" in tool(*words, data, "--only", "video", code=2).err
    message = tool(*words, data / "kodak", code=3).err
    assert "holds none of the folders emoji" in message
    message = tool(*words, data / "kodak", "--only", "resolution", code=3).err
    assert "kodak: is not a folder" in message
    assert "--jobs 0" in tool(*words, data, "-j", "0", code=2).err
    tool("bench", "paper", "--out", data, "--data", data, code=2)
    tool("bench", "paper", "--out", tmp_path / "x/y", "--data", data, code=3)
    assert not (tmp_path / "out").exists()


def test_sections_without_pictures_are_named(tmp_path):
    rows = [{"picture": "a", "method": "pxi direct", "fit": "", "psnr": 30.0}]
    absent = report.Part("resolution", "resolution freedom", resolution.TABLE, [], "no <kodak>")
    parts = [report.Part("implicit", "implicit", implicit_section.TABLE, rows), absent]
    assert "Not measured: no <kodak>" in report.markdown(parts, [])
    assert "Not measured: no &lt;kodak&gt;" in report.page(parts, [])


def test_tables_average_and_count():
    table = Table(("method",), (Column("psnr", "PSNR", "{:.1f}"),), "psnr", (),
                  ({"method": "paper", "psnr": 36.99},))  # fmt: skip
    rows = [{"picture": p, "method": "ours", "psnr": v} for p, v in (("a", 30.0), ("b", 31.0))]
    rows.append({"picture": "a", "method": "other", "psnr": None})
    assert table.lines(rows) == [
        ["method", "PSNR", "pictures"], ["ours", "30.5", "2"], ["other", "–", "1"],
        ["paper", "37.0", "–"],
    ]  # fmt: skip


def test_leads_are_over_networks_of_the_same_size():
    rows = [
        {"picture": "a", "method": m, "fit": f, "psnr": v}
        for m, f, v in (
            ("pxi direct", "at most 50307", 33.0), ("pxi direct", "at most 83331", 35.0),
            ("SIREN, 3 layers", "long", 29.0), ("SIREN, 5 layers", "long", 33.0),
            ("hash grid", "long", 33.5),
        )
    ]  # fmt: skip
    assert implicit_section.conclusions(rows) == [
        "pxi direct against SIREN, 3 layers, long: +4.00 dB: at least 3 dB.",
        "pxi direct against SIREN, 5 layers, long: +2.00 dB: less than 3 dB.",
        "pxi direct against hash grid, long: -0.50 dB.",
    ]


@pytest.mark.parametrize("parameters", [7347, 50307, 83331])
def test_direct_sampling_uses_the_parameters_it_may(parameters):
    for height, width in ((512, 512), (100, 341)):
        pixels = np.zeros((height, width, 3), np.uint8)

        def count(grid, size=(width, height)):
            spacing = max(size) / (grid - 1)
            columns, rows = (max(round(n / spacing) + 1, 2) for n in size)
            return columns * rows * SHAPE.dim + SHAPE.parameters

        grid = grid_of(pixels, parameters)
        assert count(grid) <= parameters < count(grid + 1)


def test_help_names_all_sections(tool):
    text = tool("bench", "paper", "--help").out.decode()
    assert all(name in text for name in SECTIONS)

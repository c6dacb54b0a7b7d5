"""pxi-bench rd: from a folder of pictures to measurements, tables and plots."""

import csv
import multiprocessing
import shutil
from dataclasses import replace

import numpy as np
import pytest

from proxyimg_codec.bench import peers, rd, rows, summary
from proxyimg_codec.bench.measure import bd_rate, psnr, ssimulacra2
from proxyimg_codec.bench.rows import Row, read_csv
from proxyimg_codec.io import raster
from tests.support import codecs as fakes
from tests.support.codecs import fake, folder_of, picture
from tests.support.paths import ROOT

FAKES = {
    c.name: c
    for c in (
        fake("plain"),
        fake("opaque", alpha=False),
        fake("layers", encode=fakes.encode_with_masks, masks=True, default=False),
        fake("bad", encode=fakes.encode_badly, default=False),
        fake("halved", decode=fakes.decode_halved, default=False),
        fake("slow", encode=fakes.encode_slowly, default=False),
    )
}


@pytest.fixture
def fake_codecs(monkeypatch):
    """Only codecs of the tests, run in this process."""
    ran = []

    def run(tasks, jobs, finished):
        for task in tasks:
            ran.append((task.source.path.stem, task.codec.name, task.quality))
            finished(rd.measure(task))

    monkeypatch.setattr(peers, "codecs", lambda effort=5: dict(FAKES))
    monkeypatch.setattr(rd, "run", run)
    return ran


@pytest.fixture
def two(tmp_path):
    return folder_of(tmp_path / "two", a=picture(1), b=picture(2))


def test_jpeg_and_webp_in_workers(tool, tmp_path):
    source = folder_of(tmp_path / "in", x=picture(1, 200, 180), y=picture(2, 190, 176))
    out = tmp_path / "out"
    text = tool("bench", "rd", source, "--codecs", "jpeg,webp", "--out", out, "-j", "1",
                "--qualities", "jpeg=20,50,80,90").out.decode()  # fmt: skip
    assert text.startswith(f"$ pxi-bench rd {source} --codecs jpeg,webp ")
    for part in ("2 pictures, 22 measurements", "jpeg: 4:2:0", "webp: lossy, method 6; Pillow ",
                 "BD-rate by PSNR over 0.15 to 1.2 bpp", "vs webp"):  # fmt: skip
        assert part in text
    measured = read_csv(out / "rd.csv")
    assert [r.quality for r in measured if (r.picture, r.codec) == ("x", "jpeg")] == [
        20, 50, 80, 90,
    ]  # fmt: skip
    for name in ("x", "y"):
        for codec in ("jpeg", "webp"):
            mine = [r for r in measured if (r.picture, r.codec) == (name, codec)]
            assert all(r.encode_s >= 0 and r.bpp == pytest.approx(
                8 * r.bytes / (r.width * r.height), abs=1e-6) for r in mine)  # fmt: skip
            for field in ("bytes", "psnr", "ms_ssim"):
                values = [getattr(r, field) for r in mine]
                assert values == sorted(values)
            assert 20 < mine[0].psnr < mine[-1].psnr < 50
    for name in ("psnr", "msssim"):
        assert (out / f"{name}.png").read_bytes()[:4] == b"\x89PNG"
        drawn = (out / f"{name}.svg").read_text()
        assert ">JPEG<" in drawn
        assert "published" not in drawn
    assert (out / "summary.md").read_text() in text


def test_measurements_are_of_the_pixels(tool, two, tmp_path, fake_codecs):
    tool("bench", "rd", two, "--codecs", "plain", "--out", tmp_path / "out", "--quiet")
    first = read_csv(tmp_path / "out" / "rd.csv")[0]
    pixels = picture(1)
    data = fakes.encode(pixels, 2)
    assert (first.picture, first.quality, first.bytes) == ("a", 2, len(data))
    error = ((pixels.astype(float) - fakes.decode(data)) ** 2).mean()
    assert first.psnr == pytest.approx(10 * np.log10(255**2 / error), abs=1e-4)
    assert (first.width, first.height, first.version) == (48, 40, "fake 1")


def test_quiet_prints_nothing(tool, two, tmp_path, fake_codecs):
    done = tool("bench", "rd", two, "--out", tmp_path / "out", "--quiet")
    assert (done.out, done.err) == (b"", "")


def test_summary_says_what_the_rows_say(tool, two, tmp_path, fake_codecs, monkeypatch):
    """A codec whose files are 10 % smaller has a BD-rate of -10 % everywhere."""
    tool("bench", "rd", two, "--codecs", "plain", "--out", tmp_path / "out", "--quiet")
    measured = read_csv(tmp_path / "out" / "rd.csv")
    less = [replace(r, codec="opaque", bpp=0.9 * r.bpp) for r in measured if r.picture == "a"]
    less += [replace(r, codec="opaque", bpp=1.2 * r.bpp) for r in measured if r.picture == "b"]
    results = summary.collect(measured + less, [FAKES["plain"], FAKES["opaque"]])
    for metric in ("PSNR", "MS-SSIM"):
        c = summary.compare(results[1], results[0], metric, (0, 24))
        assert c.mean == pytest.approx(5)
        assert (c.better, c.pictures) == (1, 2)
        assert -10 < c.curve < 20
    lines = list(csv.reader(summary.to_csv(results, (0, 24)).splitlines()))
    assert ["opaque", "bd_psnr_mean_pct", "plain", "5", "2"] in lines
    assert ["opaque", "bd_psnr_better", "plain", "1", "2"] in lines
    assert "+5.0 (" in summary.tables(results, (0, 24))
    average = results[0].average("PSNR")
    assert average[0] == pytest.approx(
        [np.mean([getattr(r, f) for r in measured if r.quality == 2]) for f in ("bpp", "psnr")]
    )


def test_masks_reach_the_codec(two, tmp_path):
    masks = tmp_path / "masks"
    masks.mkdir()
    labels = np.zeros((40, 48, 3), np.uint8)
    labels[10:30, 10:30] = 1
    raster.write(masks / "b.png", labels)
    tasks = rd.plan(rd.find(two, None, masks), [FAKES["plain"], FAKES["layers"]])
    done = [rd.measure(t) for t in tasks]
    assert [(r.picture, r.codec) for r in done] == (
        [("a", "plain")] * 4 + [("b", "plain")] * 4 + [("b", "layers")] * 4
    )
    assert [layered.bytes - plain.bytes for plain, layered in zip(done[4:8], done[8:], strict=True)
            ] == [2] * 4  # fmt: skip
    plain, layers = summary.collect(done, [FAKES["plain"], FAKES["layers"]])
    assert summary.compare(layers, plain, "PSNR", (0, 24)).pictures == 1
    assert plain.average("PSNR", ["b"]) != plain.average("PSNR")


def test_transparent_pictures_are_left_out_by_codecs_without_alpha(tmp_path):
    clear = picture(3, channels=4)
    solid = clear.copy()
    solid[..., 3] = 255
    source = folder_of(tmp_path / "in", clear=clear, solid=solid)
    np.save(source / "grey.npy", picture(4)[..., 0])
    found = rd.find(source)
    assert [(s.path.stem, s.alpha) for s in found] == [
        ("clear", True), ("grey", False), ("solid", False),
    ]  # fmt: skip
    tasks = rd.plan(found, [FAKES["opaque"]])
    assert {t.source.path.stem for t in tasks} == {"grey", "solid"}
    assert (rd.load(source / "solid.png") == solid[..., :3]).all()
    assert (rd.load(source / "grey.npy") == picture(4)[..., :1]).all()


def test_the_header_says_who_leaves_out_what(tool, tmp_path, fake_codecs):
    source = folder_of(tmp_path / "in", clear=picture(3, channels=4), solid=picture(4))
    text = tool("bench", "rd", source, "--out", tmp_path / "out", "--codecs", "plain,opaque",
                "--qualities", "plain=4").out.decode()  # fmt: skip
    assert "plain: none; fake 1\n" in text
    assert "opaque: none; fake 1; only 1 of 2 pictures (no transparency)\n" in text
    assert ">opaque (1 of 2)<" in (tmp_path / "out" / "psnr.svg").read_text()


def test_deep_pictures_become_8_bit(tmp_path):
    path = tmp_path / "deep.npy"
    np.save(path, np.array([[[0, 128, 65535], [129, 386, 257]]], np.uint16))
    assert rd.load(path).tolist() == [[[0, 0, 255], [1, 2, 1]]]
    np.save(path, np.array([[[0.0, 0.5, 1.0]]], np.float32))
    assert rd.load(path).tolist() == [[[0, 128, 255]]]


def test_reuse(tool, two, tmp_path, fake_codecs, monkeypatch):
    out, again = tmp_path / "out", tmp_path / "again"
    tool("bench", "rd", two, "--codecs", "plain", "--out", out)
    before = read_csv(out / "rd.csv")
    raster.write(two / "c.png", picture(1))
    raster.write(two / "b.png", picture(5))
    fake_codecs.clear()
    text = tool("bench", "rd", two, "--codecs", "plain,opaque", "--qualities", "opaque=3,4",
                "--reuse", out / "rd.csv", "--out", again).out.decode()  # fmt: skip
    assert "8 measurements reused from" in text
    assert {name for name, codec, _ in fake_codecs if codec == "plain"} == {"b"}
    after = read_csv(again / "rd.csv")
    assert [r for r in after if r.picture == "a" and r.codec == "plain"] == before[:4]
    assert [r.bytes for r in after if r.picture == "c" and r.codec == "plain"] == [
        r.bytes for r in before[:4]
    ]
    assert len(after) == 3 * (4 + 2)
    newer = replace(FAKES["plain"], version=lambda: "fake 2")
    monkeypatch.setattr(peers, "codecs", lambda effort=5: {"plain": newer})
    fake_codecs.clear()
    tool("bench", "rd", two, "--out", tmp_path / "new", "--reuse", again / "rd.csv")
    assert len(fake_codecs) == 12


def test_interrupted_runs_go_on(tool, two, tmp_path, fake_codecs, monkeypatch):
    out = tmp_path / "out"
    serial = rd.run

    def interrupted(tasks, jobs, finished):
        serial(tasks[:3], jobs, finished)
        raise KeyboardInterrupt

    monkeypatch.setattr(rd, "run", interrupted)
    text = tool("bench", "rd", two, "--codecs", "plain", "--out", out, code=130).out.decode()
    assert "3 of 8 measurements are in" in text
    assert len(read_csv(out / "rd.csv")) == 3
    assert not (out / "summary.csv").exists()
    monkeypatch.setattr(rd, "run", serial)
    fake_codecs.clear()
    tool("bench", "rd", two, "--codecs", "plain", "--out", out, "--reuse", out / "rd.csv")
    assert len(fake_codecs) == 5
    assert len(read_csv(out / "rd.csv")) == 8


def test_an_interrupt_ends_the_workers(tmp_path):
    source = folder_of(tmp_path / "in", a=picture(1, 20, 20), b=picture(2, 48, 40))

    def interrupt(result):
        assert isinstance(result, Row)
        raise KeyboardInterrupt

    tasks = rd.plan(rd.find(source), [fake("slow", encode=fakes.encode_slowly, qualities=(4,))])
    with pytest.raises(KeyboardInterrupt):
        rd.run(tasks, 1, interrupt)
    assert multiprocessing.active_children() == []


def test_failures_leave_the_rest(tool, two, tmp_path, fake_codecs):
    out = tmp_path / "out"
    done = tool("bench", "rd", two, "--codecs", "plain,bad,halved", "--out", out, code=3)
    assert "10 of 24 measurements failed" in done.err
    assert "a.png by bad at quality 4: no quality of 4 here" in done.err
    measured = read_csv(out / "rd.csv")
    assert [r.quality for r in measured if r.codec == "bad"] == [2, 5, 6] * 2
    assert not [r for r in measured if r.codec == "halved"]
    assert (out / "psnr.svg").exists()


def test_csv_round_trip(tmp_path):
    row = Row("a, \"b\"", "12ab", 3, 4, "jpeg", "4:2:0", "x 1", "cpu", 0.1, 5, 3.333333, 30.5,
              float("nan"), 61.25, 1e-5, 0.0)  # fmt: skip
    path = tmp_path / "rd.csv"
    path.write_text(rows.to_csv([row, replace(row, ms_ssim=0.5)]) + "a,12ab,3,4,jp")
    first, second = read_csv(path)
    assert second == replace(row, ms_ssim=0.5)
    assert np.isnan(first.ms_ssim)
    assert replace(first, ms_ssim=0.5) == second


def test_ssimulacra2_is_measured_when_it_is_asked_for(tool, two, tmp_path, fake_codecs):
    pytest.importorskip("ssimulacra2")
    first, out = tmp_path / "first", tmp_path / "out"
    words = ["bench", "rd", two, "--codecs", "plain,opaque"]
    assert "SSIMULACRA" not in tool(*words, "--out", first).out.decode()
    made = len(fake_codecs)
    words += ["--perceptual", "--out", out]
    text = tool(*words, "--reuse", first / "rd.csv").out.decode()
    assert "BD-rate by SSIMULACRA 2" in text
    assert len(fake_codecs) == 2 * made  # those without the score do not count
    measured = [r for r in read_csv(out / "rd.csv") if (r.picture, r.codec) == ("a", "plain")]
    scores = [r.ssimulacra2 for r in measured]
    assert scores == sorted(scores)
    assert scores[0] < scores[-1] < 100
    assert (out / "ssimulacra2.svg").exists()
    tool(*words, "--reuse", out / "rd.csv")
    assert len(fake_codecs) == 2 * made


def test_ssimulacra2_sees_alpha_and_small_pictures():
    pytest.importorskip("ssimulacra2")
    opaque = picture(1)
    clear = np.dstack([opaque, np.full(opaque.shape[:2], 255, np.uint8)])
    assert ssimulacra2(clear, clear) == ssimulacra2(opaque, opaque) == 100
    faded = clear.copy()
    faded[:20, :, 3] = 100
    assert ssimulacra2(clear, faded) < 50
    assert np.isnan(ssimulacra2(opaque[:7], opaque[:7]))


def test_svt_codes_any_size():
    pytest.importorskip("av")
    codec = peers.codecs()["svt"]
    # The encoder refuses sides below 64.
    for width, height in ((141, 93), (64, 65)):
        pixels = picture(3, width, height)
        files = [codec.encode(pixels, q) for q in (codec.qualities[0], codec.qualities[-1])]
        found = [psnr(pixels, codec.decode(data)) for data in files]
        assert len(files[0]) < len(files[1])
        assert found[0] < found[1]
        assert found[1] > 24
        assert codec.decode(files[0]).shape == pixels.shape
    assert "PyAV" in codec.version()


def test_avif_as_slow_as_our_codec_is_found(two, monkeypatch):
    names = ["pxi", "avif444", *(f"avif444-s{n}" for n in peers.EQUAL_TIME)]
    now = [0.0]
    took = {"pxi": 5.0, "avif444": 1.0, "avif444-s3": 2.0, "avif444-s2": 4.0, "avif444-s1": 8.0}

    def table(effort):
        def codec(name):
            def encode(pixels, quality):
                now[0] += took[name]
                return fakes.encode(pixels, quality)

            return fake(name, encode=encode)

        return {name: codec(name) for name in names}

    monkeypatch.setattr(rd, "codecs", table)
    monkeypatch.setattr(rd.time, "process_time", lambda: now[0])
    source = rd.find(two)[0]
    assert rd.as_slow(source, None).name == "avif444-s2"
    took["pxi"] = 0.5
    assert rd.as_slow(source, None).name == "avif444"


def test_published_curves_are_drawn_for_kodak(tool, tmp_path, fake_codecs):
    source = folder_of(tmp_path / "in", **{f"kodim{i:02d}": picture(i) for i in range(1, 25)})
    text = tool("bench", "rd", source, "--codecs", "plain", "--out", tmp_path / "out").out.decode()
    for name in ("VTM", "Cool-Chic", "ELIC", "C3", "COIN", "GaussianImage", "Ballé 2018"):
        assert f"| {name}" in text
        assert name in (tmp_path / "out" / "psnr.svg").read_text()
    vtm = next(line for line in text.splitlines() if line.startswith("| VTM"))
    known = [30.42, 33.29, 35.65, 38.21]
    assert [float(cell) for cell in vtm.split("|")[3:7]] == pytest.approx(known, abs=0.02)
    assert all(len(e.published["PSNR"]) > 4 for e in summary.published())
    text = tool("bench", "rd", source, "--codecs", "plain", "--out", tmp_path / "some",
                "--images", "3").out.decode()  # fmt: skip
    assert "VTM" not in text


BAD = [
    ([], 2, "one folder"),
    (["nowhere"], 3, "nowhere: is not a folder"),
    (["empty"], 3, "holds no pictures"),
    (["two", "--dataset", "two"], 2, "one folder"),
    (["two", "--codecs", "plain,gif"], 2, "unknown codec 'gif'; there are plain, opaque"),
    (["two", "--images", "a,z"], 2, "no picture 'z'"),
    (["two", "--images", "0"], 2, "at least one"),
    (["two", "--qualities", "plain=1.5"], 2, "must be a whole number from 1 to 7"),
    (["two", "--qualities", "plain=9"], 2, "must be a whole number from 1 to 7"),
    (["two", "--qualities", "plain"], 2, "must be CODEC=Q"),
    (["two", "--qualities", "jpeg=9"], 2, "not a codec of this run"),
    (["two", "--codecs", "layers"], 2, "needs --masks"),
    (["two", "--range", "1,1"], 2, "LOW,HIGH"),
    (["two", "--range", "a"], 2, "LOW,HIGH"),
    (["two", "--effort", "0"], 2, "must be 1..9"),
    (["two", "--jobs", "0"], 2, "at least one process"),
    (["two", "--reuse", "none.csv"], 3, "none.csv"),
    (["two", "--reuse", "two/a.png"], 3, "not an rd.csv"),
    (["two", "--out", "none/out"], 3, "its folder does not exist"),
    (["two", "--out", "two/a.png"], 3, "is not a folder"),
    (["twins"], 3, "two pictures are called a"),
    (["broken"], 3, "a.png"),
]


@pytest.mark.parametrize(("words", "code", "message"), BAD)
def test_bad_command_lines(tool, two, tmp_path, fake_codecs, monkeypatch, words, code, message):
    monkeypatch.chdir(tmp_path)
    for name in ("empty", "broken", "twins"):
        (tmp_path / name).mkdir()
    (tmp_path / "broken" / "a.png").write_bytes(b"\x89PNG nothing")
    for suffix in (".png", ".ppm"):
        raster.write(tmp_path / "twins" / f"a{suffix}", picture(1))
    assert message in tool("bench", "rd", *words, code=code).err
    assert not fake_codecs


def test_results_are_not_replaced(tool, two, tmp_path, fake_codecs):
    words = ["rd", two, "--codecs", "plain", "--images", "a", "--out", tmp_path / "out"]
    tool("bench", *words)
    shutil.copy(tmp_path / "out" / "rd.csv", tmp_path / "copy.csv")
    assert "--force" in tool("bench", *words, code=3).err
    assert "--force" in tool("bench", *words, "--reuse", tmp_path / "copy.csv", code=3).err
    tool("bench", *words, "--reuse", tmp_path / "out" / "rd.csv")
    tool("bench", *words, "--force")


def test_results_do_not_go_among_the_pictures(tool, two, tmp_path, fake_codecs):
    (tmp_path / "also").symlink_to(two)
    for out in (two, tmp_path / "also"):
        words = two, "-o", out, "--codecs", "plain", "-f"
        assert "a folder of their own" in tool("bench", "rd", *words, code=2).err
    assert sorted(p.name for p in two.iterdir()) == ["a.png", "b.png"]


def test_odd_names_and_files_with_a_dot(tool, tmp_path, fake_codecs, monkeypatch):
    monkeypatch.chdir(tmp_path)
    folder = folder_of(tmp_path / "-p\udcff", **{"a\udcfe\n": picture(1)})
    (folder / "._a.png").write_bytes(b"\0\5\x16\7 of a Mac")
    ran = tool("bench", "rd", "--codecs", "plain", "-o", "out", "--", folder.name)
    assert "1 pictures" in ran.out.decode()
    assert len(read_csv(tmp_path / "out" / "rd.csv")) == len(fake_codecs)
    assert (tmp_path / "out" / "psnr.png").exists()


def test_qualities_of_the_table_are_ones_that_the_codecs_know():
    for codec in peers.codecs().values():
        assert [codec.checked(q) for q in codec.qualities] == list(codec.qualities)
        assert 5 <= len(codec.qualities) <= 8


@pytest.mark.parametrize("name", ["webp", "jp2", "jxl", "avif420", "avif444"])
def test_peers_keep_alpha(name):
    codec = peers.codecs()[name]
    pixels = np.dstack([picture(6, 64, 64), picture(7, 64, 64)[..., 0]])
    files = [codec.encode(pixels, quality) for quality in (codec.qualities[3], codec.limits[1])]
    assert len(files[0]) < len(files[1])
    worse, better = (np.abs(codec.decode(f).astype(float) - pixels) for f in files)
    assert worse.shape == pixels.shape
    assert better.mean() < worse.mean()
    assert better[..., 3].mean() < 6


def test_avif_is_tuned_for_psnr():
    """Pillow's default is not."""
    pixels = rd.load(ROOT / "docs" / "images" / "photo.png")[:192, :192]
    options = {**peers.codecs()["avif420"].encode.keywords, "speed": 8}
    curves = []
    for advanced in (options["advanced"], {}):
        files = [
            peers.pillow_encode(pixels, q, **{**options, "advanced": advanced})
            for q in (30, 45, 60, 75)
        ]
        curves.append([(len(f), psnr(pixels, peers.pillow_decode(f))) for f in files])
    assert bd_rate(*curves) < 0

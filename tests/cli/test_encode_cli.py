"""pxi-encode: every flag, every kind of picture and mask, and every way to fail."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest

import proxyimg_codec as pxi
from proxyimg_codec.io.png import encode_png, encode_ppm
from proxyimg_codec.io.psnr import psnr_8bit
from proxyimg_codec.io.raster import write
from tests.support.paths import ROOT

TINY = ("-e", "1", "-j", "1")


@pytest.fixture
def photo_png(tmp_path, photo):
    path = tmp_path / "photo.png"
    write(path, photo)
    return path


@pytest.fixture
def encode(tool, tmp_path, photo_png):
    """encode(*flags) encodes the photo and gives the bytes of the file."""

    def call(*flags) -> bytes:
        out = tmp_path / "out.pxi"
        tool("encode", photo_png, out, "-f", *TINY, *flags)
        return out.read_bytes()

    return call


def info(data: bytes) -> dict:
    from proxyimg_codec.cli.info import describe
    from proxyimg_codec.container.file import parse

    return describe(parse(data), len(data))


# What it makes and says


def test_report_and_default_name(tool, photo_png):
    ran = tool("encode", photo_png, *TINY)
    size = photo_png.with_suffix(".pxi").stat().st_size
    assert ran.out == b""
    assert f"48x40, {size} bytes" in ran.err
    assert "PSNR" in ran.err


def test_quiet_and_json(tool, photo_png, photo, tmp_path):
    assert tool("encode", photo_png, *TINY, "--quiet").err == ""
    ran = tool("encode", photo_png, tmp_path / "b.pxi", *TINY, "--quiet", "--json")
    report = json.loads(ran.out)
    image = pxi.open(tmp_path / "b.pxi")
    assert ran.err == ""
    assert report["output"] == str(tmp_path / "b.pxi")
    assert (report["width"], report["height"]) == (48, 40)
    assert report["bytes"] == (tmp_path / "b.pxi").stat().st_size
    assert report["layers"] == [layer.name for layer in image.layers]
    assert report["psnr"] == pytest.approx(psnr_8bit(photo, image.render()), abs=1e-3)
    assert report["psnr"] > 28


def test_launcher_with_pipes_gives_the_same_bytes(launch, photo, encode):
    ran = launch("encode", "-", *TINY, "--quiet", input=encode_png(photo))
    assert ran.err == ""
    assert ran.out == encode()


def test_same_seed_same_bytes_with_any_number_of_threads(encode):
    implicit = ("--texture", "implicit", "--seed")
    first = encode(*implicit, "3")
    assert encode(*implicit, "3", "-j", "2") == first
    assert encode(*implicit, "4") != first
    assert info(first)["settings"]["seed"] == 3


def test_quality_changes_size(encode):
    sizes = [len(encode("-q", q)) for q in (0, 50, 100)]
    assert sizes == sorted(set(sizes))


@pytest.mark.parametrize(
    ("flags", "effort"),
    [(("--preset", "fast"), 2), (("--preset", "best", "-e", "1"), 1), (("--effort", "1"), 1)],
)
def test_effort_and_presets(tool, photo_png, tmp_path, flags, effort):
    tool("encode", photo_png, tmp_path / "a.pxi", "-j", "1", "--texture", "implicit", *flags)
    assert info((tmp_path / "a.pxi").read_bytes())["settings"]["effort"] == effort


def test_widths_in_bits(encode):
    facts = info(encode("--feature-bits", "2", "--net-bits", "6", "--layers", "1"))
    assert [layer["bits"] for layer in facts["layers"]] == [2]
    assert [network["bits"] for network in facts["networks"]] == [6]
    wide = info(encode("--feature-bits", "8", "--layers", "1"))
    assert wide["layers"][0]["texture_bytes"] > 2 * facts["layers"][0]["texture_bytes"]


def test_number_of_layers(encode):
    colours = ("--segmenter", "regions")  # which finds both shapes, whatever the network learns
    found = [len(info(encode(*colours, *f))["layers"]) for f in ((), ("--max-layers", "2"))]
    assert found[0] > found[1] == 2
    assert [v["segments"] for v in info(encode("--layers", "1"))["layers"]] == [0]


@pytest.mark.parametrize("texture", ["implicit", "pyramid"])
def test_boundary_method(texture, encode, monkeypatch, tmp_path, photo):
    pytest.importorskip("torch")
    chamfer = pytest.importorskip("proxyimg_codec.encoder.shapes.chamfer")
    slow = chamfer.fit_paths_chamfer
    monkeypatch.setattr(
        chamfer, "fit_paths_chamfer", lambda mask, step: slow(mask, step, iterations=10)
    )
    masks = save_masks(tmp_path / "masks", object=photo[..., 0] == 220)
    facts = [
        info(encode("--texture", texture, "--masks", masks, "--boundary", b))
        for b in ("lsq", "chamfer")
    ]
    if texture == "implicit":  # what is usual is not recorded
        assert [f["settings"].get("boundary") for f in facts] == [None, "chamfer"]
    assert facts[0]["chunk_bytes"]["LAYR"] != facts[1]["chunk_bytes"]["LAYR"]


BACKGROUNDS = ("diffuse", "complete")


def test_background_completion_stores_more_of_the_back(encode, tmp_path):
    pytest.importorskip("proxyimg_codec.encoder.completion.background")
    big = np.zeros((40, 48), bool)
    big[4:36, 4:44] = True
    masks = save_masks(tmp_path / "masks", object=big)
    plain, full = (info(encode("--masks", masks, "--background", b)) for b in BACKGROUNDS)
    assert full["settings"]["background"] == "complete"
    assert full["layers"][0]["texture_bytes"] > plain["layers"][0]["texture_bytes"]


def test_metadata_is_carried_unless_stripped(tool, tmp_path, photo):
    blocks = {"exif": b"II*\0\x08\0\0\0\0\0\0\0\0\0", "xmp": b"<x:xmpmeta/>"}
    (tmp_path / "a.png").write_bytes(encode_png(photo, blocks))
    for flags, expected in (((), blocks), (("--strip",), {})):
        tool("encode", tmp_path / "a.png", "-f", *TINY, *flags)
        assert pxi.open(tmp_path / "a.pxi").blocks == expected


def test_device_cuda_acts_or_is_refused(tool, tmp_path, photo_png):
    torch = pytest.importorskip("torch")
    there = torch.cuda.is_available()
    out = tmp_path / "a.pxi"
    ran = tool("encode", photo_png, out, *TINY, "--device", "cuda", code=0 if there else 5)
    assert out.exists() == there
    assert there or "cuda" in ran.err


# Masks


def save_masks(folder: Path, **masks: np.ndarray) -> Path:
    folder.mkdir()
    for name, mask in masks.items():
        write(folder / f"{name}.png", np.repeat(255 * mask[..., None].astype(np.uint8), 3, axis=2))
    return folder


def left_to(column: int) -> np.ndarray:
    return np.tile(np.arange(48) < column, (40, 1))


def painted(image, name: str) -> np.ndarray:
    return image.render(layers=[name])[..., 3] >= 128


@pytest.mark.parametrize("kind", ["folder", "labels"])
def test_masks_become_layers(tool, photo_png, tmp_path, photo, kind):
    mask = photo[..., 0] == 220
    if kind == "folder":
        masks, name = save_masks(tmp_path / "masks", ball=mask), "ball"
    else:
        masks, name = tmp_path / "labels.png", "object 7"
        write(masks, np.repeat(7 * mask[..., None].astype(np.uint8), 3, axis=2))
    tool("encode", photo_png, tmp_path / "a.pxi", *TINY, "--masks", masks)
    image = pxi.open(tmp_path / "a.pxi")
    assert [layer.name for layer in image.layers] == ["back", name]
    drawn = painted(image, name)
    assert (drawn & mask).sum() > 0.95 * (drawn | mask).sum()


def test_overlapping_masks_and_masks_that_cover_all(tool, photo_png, tmp_path, photo):
    masks = save_masks(tmp_path / "masks", a=left_to(48), b=left_to(30), c=left_to(10))
    tool("encode", photo_png, tmp_path / "a.pxi", *TINY, "--masks", masks)
    image = pxi.open(tmp_path / "a.pxi")
    assert [layer.name for layer in image.layers] == ["a", "b", "c"]
    assert psnr_8bit(photo, image.render()) > 26
    assert not painted(image, "c")[:, 12:].any()
    assert painted(image, "b")[:, 12:28].all()


@pytest.mark.parametrize(
    ("mask", "why"),
    [
        (np.ones((40, 47), bool), "47x40"),
        (np.zeros((40, 48), bool), "empty"),
        (left_to(0), "empty"),
    ],
)
def test_unusable_masks(tool, photo_png, tmp_path, mask, why):
    masks = save_masks(tmp_path / "masks", ball=mask)
    ran = tool("encode", photo_png, *TINY, "--masks", masks, code=3)
    assert "ball" in ran.err
    assert why in ran.err
    assert not photo_png.with_suffix(".pxi").exists()


def test_a_mask_hidden_by_another(tool, photo_png, tmp_path):
    masks = save_masks(tmp_path / "masks", a=left_to(10), b=left_to(48))
    assert '"a" is empty, hidden' in tool("encode", photo_png, "--masks", masks, code=3).err


def test_soft_masks_are_cut_and_it_is_said(tool, photo_png, tmp_path):
    soft = np.tile(np.linspace(0, 255, 48).astype(np.uint8), (40, 1))
    (tmp_path / "masks").mkdir()
    write(tmp_path / "masks" / "veil.png", np.repeat(soft[..., None], 3, 2))
    words = "encode", photo_png, tmp_path / "a.pxi", "-f", *TINY, "--masks", tmp_path / "masks"
    words = *words, "--matte", "hard"
    lines = tool(*words).err.splitlines()
    assert len(lines) == 2
    assert lines[0].startswith("pxi-encode: warning: soft masks are cut at one half")
    assert lines[0].endswith("veil")
    assert tool(*words, "--quiet").err == ""
    assert not painted(pxi.open(tmp_path / "a.pxi"), "veil")[:, :20].any()


def test_masks_that_are_not_there(tool, photo_png, tmp_path):
    (tmp_path / "empty").mkdir()
    for masks in (tmp_path / "missing.png", tmp_path / "empty"):
        tool("encode", photo_png, *TINY, "--masks", masks, code=3)


# Kinds of pictures


def gradient(height: int, width: int) -> np.ndarray:
    y, x = np.mgrid[0:height, 0:width]
    z = 128 + 100 * np.sin(x / 20) * np.cos(y / 20)
    return np.dstack([z, 255 - z, z / 2]).astype(np.uint8)


GREY = gradient(24, 30)[..., :1]
ALPHA = np.where(np.mgrid[0:24, 0:30][1:] < 15, 255, 0).astype(np.uint8).transpose(1, 2, 0)
PALETTE = np.array([[250, 20, 20], [20, 20, 250]], np.uint8)
INDICES = (np.mgrid[0:24, 0:30][1] > 14).astype(np.uint8)


def rgba(colour: np.ndarray, alpha: np.ndarray) -> np.ndarray:
    return np.dstack([np.broadcast_to(colour, (*alpha.shape[:2], 3)), alpha])


PICTURES = {  # what is stored (an array is saved as it is), and what must come out
    "1x1": (gradient(1, 1), gradient(1, 1)),
    "1x9": (gradient(9, 1), gradient(9, 1)),
    "9x1": (gradient(1, 9), gradient(1, 9)),
    "2x2": (gradient(2, 2), gradient(2, 2)),
    "6001x2": (gradient(2, 6001), gradient(2, 6001)),
    "grey": (GREY, GREY.repeat(3, 2)),
    "grey-alpha": (np.dstack([GREY, ALPHA]), rgba(GREY, ALPHA)),
    "rgba": (rgba(GREY, ALPHA), rgba(GREY, ALPHA)),
    "soft-alpha": (rgba(GREY, gradient(24, 30)[..., 2]), rgba(GREY, gradient(24, 30)[..., 2])),
    "16-bit": (gradient(24, 30).astype(np.uint16) * 257, gradient(24, 30)),
    "float": (gradient(24, 30).astype(np.float32) / 255, gradient(24, 30)),
    "one-colour": (np.full((24, 30, 3), 77, np.uint8), np.full((24, 30, 3), 77, np.uint8)),
    "black": (np.zeros((24, 30, 3), np.uint8), np.zeros((24, 30, 3), np.uint8)),
    "transparent": (rgba(GREY, 0 * ALPHA), rgba(GREY, 0 * ALPHA)),
    "one-colour-alpha": (rgba(0 * GREY + 200, ALPHA), rgba(0 * GREY + 200, ALPHA)),
}


@pytest.mark.parametrize("name", PICTURES)
def test_kinds_of_pictures(tool, tmp_path, name):
    stored, expected = PICTURES[name]
    np.save(tmp_path / "a.npy", stored)
    report = json.loads(tool("encode", tmp_path / "a.npy", *TINY, "--json").out)
    image = pxi.open(tmp_path / "a.pxi")
    pixels = image.render()
    assert pixels.shape == expected.shape
    quality = psnr_8bit(expected, pixels)
    assert quality is None or quality > 30
    if quality is None:
        assert report["psnr"] is None
    else:
        assert report["psnr"] == pytest.approx(quality, abs=0.5)
    assert image.depth == (8 if stored.dtype == np.uint8 else 16)


def test_hard_alpha_becomes_the_outline_of_layers(tool, tmp_path, rgba_photo):
    write(tmp_path / "a.png", rgba_photo)
    tool("encode", tmp_path / "a.png", *TINY)
    image = pxi.open(tmp_path / "a.pxi")
    assert (image.channels, image.opaque) == (3, False)
    assert all(layer.boundary is not None for layer in image.layers)
    drawn, mask = image.render()[..., 3] >= 128, rgba_photo[..., 3] > 0
    assert (drawn & mask).sum() > 0.95 * (drawn | mask).sum()


@pytest.mark.parametrize("name", ["one-colour", "black", "transparent"])
def test_flat_pictures_are_nearly_exact_and_small(tool, tmp_path, name):
    stored, expected = PICTURES[name]
    np.save(tmp_path / "a.npy", stored)
    tool("encode", tmp_path / "a.npy", *TINY)
    pixels = pxi.open(tmp_path / "a.pxi").render().astype(int)
    if name == "transparent":
        assert not pixels[..., 3].any()
    else:
        assert abs(pixels - expected).max() <= 1
    assert (tmp_path / "a.pxi").stat().st_size < 2000


def test_cmyk(tool, tmp_path):
    """The inks of a CMYK file come out as the RGB that they look like."""
    target = oiio.ImageOutput.create(str(tmp_path / "a.tif"))
    spec = oiio.ImageSpec(30, 24, 4, "uint8")
    spec.channelnames = tuple("CMYK")
    spec.attribute("tiff:ColorSpace", "CMYK")
    assert target.open(str(tmp_path / "a.tif"), spec)
    assert target.write_image(np.dstack([255 - gradient(24, 30), 0 * GREY]))
    target.close()
    tool("encode", tmp_path / "a.tif", *TINY)
    assert psnr_8bit(gradient(24, 30), pxi.open(tmp_path / "a.pxi").render()) > 30


def with_sample(value: float) -> np.ndarray:
    picture = np.full((6, 6, 3), 0.5, np.float32)
    picture[2, 3, 1] = value
    return picture


@pytest.mark.parametrize(
    ("array", "why"),
    [
        (with_sample(np.nan), "NaN"),
        (with_sample(np.inf), "infinite"),
        (with_sample(1.5), "0..1"),
        (with_sample(-0.1), "0..1"),
        (np.zeros((6, 6, 3), np.int32), "int32"),
        (np.zeros((6, 6, 3), np.complex64), "complex64"),
        (np.zeros((6, 6, 5), np.uint8), "(6, 6, 5)"),
        (np.zeros(6, np.uint8), "(6,)"),
        (np.zeros((6, 0, 3), np.uint8), "(6, 0, 3)"),
    ],
)
def test_arrays_that_are_no_pictures(tool, tmp_path, array, why):
    np.save(tmp_path / "a.npy", array)
    assert why in tool("encode", tmp_path / "a.npy", *TINY, code=3).err
    assert not (tmp_path / "a.pxi").exists()


@pytest.mark.parametrize("data", [b"", b"hello", encode_png(gradient(9, 9))[:70]])
def test_files_that_are_no_pictures(tool, tmp_path, data):
    (tmp_path / "a.png").write_bytes(data)
    assert str(tmp_path / "a.png") in tool("encode", tmp_path / "a.png", code=3).err
    assert "standard input" in tool("encode", "-", tmp_path / "b.pxi", code=3, stdin=data).err
    assert os.listdir(tmp_path) == ["a.png"]


# Refusals


@pytest.mark.parametrize(
    "flags",
    [
        ("-q", "101"),
        ("-q", "nan"),
        ("-q", "-1"),
        ("-q", "high"),
        ("-e", "0"),
        ("-e", "10"),
        ("--preset", "fastest"),
        ("--max-layers", "0"),
        ("--max-layers", "65"),
        ("--layers", "2"),
        ("--layers", "1", "--masks", "labels.png"),
        ("--layers", "1", "--max-layers", "3"),
        ("--max-layers", "3", "--masks", "labels.png"),
        ("--feature-bits", "1"),
        ("--feature-bits", "9"),
        ("--net-bits", "9"),
        ("--seed", "-1"),
        ("--seed", str(1 << 32)),
        ("-j", "0"),
        ("--device", "tpu"),
        ("--boundary", "spline"),
        ("--background", "fog"),
        ("--background", "exemplar", "--texture", "implicit"),
        ("--background", "none", "--behind", "photo.png"),
        ("--unknown",),
        ("--qual", "50"),
        ("two", "outputs"),
    ],
    ids=" ".join,
)
def test_usage_errors(tool, photo_png, tmp_path, flags):
    tool("encode", photo_png, *flags, code=2)
    assert os.listdir(tmp_path) == ["photo.png"]


def test_output_that_is_there_is_kept_without_force(tool, photo_png, tmp_path):
    out = tmp_path / "a.pxi"
    out.write_bytes(b"precious")
    assert "--force" in tool("encode", photo_png, out, *TINY, code=3).err
    assert out.read_bytes() == b"precious"
    tool("encode", photo_png, out, *TINY, "--force")
    pxi.open(out)


def test_unusable_outputs(tool, photo_png, tmp_path):
    before = photo_png.read_bytes()
    tool("encode", photo_png, photo_png, "--force", code=2)
    tool("encode", photo_png, tmp_path / "missing" / "a.pxi", code=3)
    tool("encode", photo_png, tmp_path, "--force", code=3)
    tool("encode", photo_png, "", code=2)
    tool("encode", photo_png, tmp_path / f"{'x' * 300}.pxi", code=3)
    tool("encode", photo_png, "-", "--json", code=2)
    assert photo_png.read_bytes() == before
    assert os.listdir(tmp_path) == ["photo.png"]


def test_unusable_inputs(tool, tmp_path):
    (tmp_path / "old.pxi").write_bytes(b"precious")
    tool("encode", tmp_path / "missing.png", code=3)
    tool("encode", tmp_path / "missing.png", tmp_path / "old.pxi", code=3)
    tool("encode", tmp_path / "missing.png", tmp_path / "old.pxi", "-f", code=3)
    tool("encode", tmp_path, tmp_path / "a.pxi", code=3)
    tool("encode", "/", code=3)
    assert (tmp_path / "old.pxi").read_bytes() == b"precious"
    assert os.listdir(tmp_path) == ["old.pxi"]


# Trouble from outside


@pytest.mark.parametrize("old", [None, b"precious"])
def test_a_full_disk_loses_nothing(launch, tmp_path, photo, old):
    """A limit of 512 or 1024 bytes breaks the write in the middle, like a full disk."""
    np.save(tmp_path / "a.npy", photo)
    if old:
        (tmp_path / "a.pxi").write_bytes(old)
    before = sorted(os.listdir(tmp_path))
    ran = launch("encode", tmp_path / "a.npy", "-f", *TINY, code=3, first="ulimit -f 1")
    assert "cannot be written" in ran.err
    assert sorted(os.listdir(tmp_path)) == before
    assert old is None or (tmp_path / "a.pxi").read_bytes() == old


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="there is no /dev/full")
def test_a_full_standard_output(launch, photo_png):
    with open("/dev/full", "wb") as full:
        launch("encode", photo_png, "-", *TINY, code=3, stdout=full)


@pytest.mark.parametrize("old", [None, b"precious"])
def test_ctrl_c_loses_nothing(check_error, tmp_path, old):
    out = tmp_path / "a.pxi"
    if old:
        out.write_bytes(old)
    command = [sys.executable, ROOT / "bin" / "pxi-encode", "-", out, "-f", "-e", "9", "-j", "1"]
    # Where the tests run in the background of a shell, interrupts are ignored, which is inherited.
    process = subprocess.Popen(
        command,
        stdin=subprocess.PIPE,
        stderr=subprocess.PIPE,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )
    # More than a pipe holds: once it is through, the tool is at work.
    process.stdin.write(encode_ppm(gradient(256, 256)))
    process.stdin.close()
    time.sleep(1.5)
    process.send_signal(signal.SIGINT)
    code, text = process.wait(30), process.stderr.read().decode()
    process.stderr.close()
    assert code == 130
    check_error("pxi-encode", text)
    assert os.listdir(tmp_path) == (["a.pxi"] if old else [])
    assert old is None or out.read_bytes() == old


def test_what_is_not_installed_is_named(check_error, photo_png):
    script = "import sys; sys.modules['cv2'] = None; from proxyimg_codec.cli.encode import main; "
    command = [sys.executable, "-c", f"{script}sys.exit(main(sys.argv[1:]))", photo_png]
    ran = subprocess.run(command, capture_output=True, timeout=60, cwd=ROOT)
    assert ran.returncode == 5
    check_error("pxi-encode", ran.stderr.decode())
    assert b"cv2: pip install" in ran.stderr


def test_coders(encode, tool, photo_png, tmp_path):
    sizes = {}
    for coder in ("pyramid", "implicit"):
        facts = info(encode("--texture", coder, "--layers", "1"))
        assert facts["layers"][0]["coder"] == coder
        sizes[coder] = facts["bytes"]
    assert encode("--layers", "1") == encode("--texture", "pyramid", "--layers", "1")
    ran = tool("encode", photo_png, tmp_path / "said.pxi", *TINY, "--layers", "1")
    assert "pyramid" in ran.err
    assert sizes["pyramid"] < sizes["implicit"]


def test_target_size(encode):
    assert len(encode("--target-size", "1500", "--layers", "1")) == pytest.approx(1500, rel=0.02)


def test_a_large_picture_takes_less_effort_and_says_so(monkeypatch, tool, photo_png, tmp_path):
    monkeypatch.setattr("proxyimg_codec.encoder.settings.LARGE", 1000)
    files = []
    for flags in ((), ("-e", "4"), ("-e", "5")):
        files.append(tmp_path / f"{len(files)}.pxi")
        ran = tool("encode", photo_png, files[-1], "--layers", "1", *flags)
        assert ("effort 4 instead of 5; -e chooses another" in ran.err) == (not flags)
    by_size, four, five = (file.read_bytes() for file in files)
    assert by_size == four != five


def test_quality_and_target_contradict_each_other(tool, photo_png, tmp_path):
    ran = tool("encode", photo_png, tmp_path / "a.pxi", "-q", "30", "--target-bpp", "1", code=2)
    assert "contradict" in ran.err

"""Programs around libpxi: pxi-dec, examples of the guide, the loader of gdk-pixbuf, installing."""

import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import proxyimg_codec as pxi
from proxyimg_codec.io import raster
from tests.libpxi.conftest import run
from tests.support.paths import ROOT

CASES = ROOT / "conformance/cases"
PHOTO = CASES / "views/pyramid-cuts/input.pxi"
EXAMPLES = ROOT / "libpxi/examples"
GUIDE = ROOT / "docs/guide/libpxi.md"
QUERY = "gdk-pixbuf-2.0/gdk-pixbuf-query-loaders"

SMALL = ["canvases", "networks", "meshes", "poses", "views", "behind", "motion", "refused-views"]
"""Kinds of cases that are run here; `python -m conformance.runner` runs all."""


@pytest.mark.parametrize("kind", SMALL)
def test_pxi_dec_passes_the_conformance_suite(pxi_dec, kind, tmp_path):
    command = f"{shlex.quote(str(pxi_dec))} {{in}} {{out}} {{args}}"
    hashing = f"{shlex.quote(str(pxi_dec))} --latents {{in}}"
    words = [sys.executable, "-m", "conformance.runner", "--decoder", command, "--latents", hashing,
             "--cases", CASES / kind]  # fmt: skip
    assert "cases passed" in run(*words, cwd=ROOT)


def test_pxi_dec_writes_png_of_both_depths(pxi_dec, tmp_path):
    image, out = pxi.open(PHOTO), tmp_path / "out.png"
    for flags, options in (
        (["--width", "301"], {"width": 301}), (["--scale", "0.5"], {"scale": 0.5}),
        (["--region=3,4,9,7", "--layer", "0"], {"region": (3, 4, 9, 7), "layers": [0]}),
    ):  # fmt: skip
        for bits, dtype in ((8, np.uint8), (16, np.uint16)):
            run(pxi_dec, PHOTO, out, "--bit-depth", str(bits), *flags)
            found, expected = raster.read(out).pixels, image.render(dtype=dtype, **options)
            assert found.dtype == dtype
            assert np.abs(found.astype(int) - expected).max() <= (1 if bits == 8 else 13)


@pytest.mark.parametrize(
    ("words", "code"),
    [
        (["IN"], 2), (["IN", "OUT", "x"], 2), (["IN", "OUT", "--width", "0"], 2),
        (["IN", "OUT", "--width"], 2), (["IN", "OUT", "--layer", "nobody"], 2),
        (["IN", "OUT", "--bit-depth", "12"], 2), (["IN", "OUT", "--time", "now"], 2),
        (["IN", "OUT", "--region", "0,0,0,1"], 2), (["nothing.pxi", "OUT"], 3),
        (["IN", "no/such/folder.png"], 3), (["IN", "OUT", "--width", "9999999"], 6),
    ],
)  # fmt: skip
def test_pxi_dec_explains_what_is_wrong(pxi_dec, words, code, tmp_path):
    out = tmp_path / "out.png"
    places = {"IN": str(PHOTO), "OUT": str(out)}
    done = subprocess.run(
        [pxi_dec, *(places.get(w, w) for w in words)], capture_output=True, text=True, cwd=tmp_path
    )
    assert done.returncode == code, done.stderr
    assert done.stderr
    assert not out.exists()


def test_pxi_dec_lists_layers(pxi_dec):
    lines = run(pxi_dec, "--list", PHOTO).splitlines()
    assert [line.split(" ", 1)[1] for line in lines[1:]] == [v.name for v in pxi.open(PHOTO).layers]


def blocks(language):
    return re.findall(rf"```{language}\n(.*?)```", GUIDE.read_text("utf-8"), re.S)


def test_the_guide_shows_the_examples():
    for language, name in (("c", "thumbnail.c"), ("rust", "thumbnail.rs")):
        assert blocks(language) == [(EXAMPLES / name).read_text("utf-8")]


def pixels_of(ppm):
    size = re.match(rb"P6 (\d+) (\d+) 255\n", ppm)
    width, height = map(int, size.groups())
    return np.frombuffer(ppm[size.end() :], np.uint8).reshape(height, width, 3)


@pytest.fixture(scope="module")
def guide(build, tmp_path_factory):
    """Runs a block of commands of the guide, by its number, in a folder with a picture."""
    home = tmp_path_factory.mktemp("guide")
    (home / "libpxi").symlink_to(ROOT / "libpxi")
    shutil.copy(PHOTO, home / "photo.pxi")
    rustup = os.environ.get("RUSTUP_HOME", str(Path.home() / ".rustup"))
    env = {**os.environ, "HOME": str(home), "RUSTUP_HOME": rustup}
    here = {"-S libpxi": f"-S {ROOT / 'libpxi'}", "libpxi/build": str(build)}

    def run_block(number):
        commands = blocks("bash")[number]
        for there, place in here.items():
            commands = commands.replace(there, place)
        run("bash", "-euc", commands, cwd=home, env=env)
        return home

    run_block(0)
    return run_block


def check_thumbnail(home, program):
    expected = pxi.open(PHOTO).render(width=64)
    found = pixels_of((home / "thumbnail.ppm").read_bytes())
    assert np.abs(found.astype(int) - expected[..., :3]).max() <= 1
    env = {**os.environ, "LD_LIBRARY_PATH": str(home / "pxi/lib")}
    broken = subprocess.run([home / program], input=b"no picture", capture_output=True, env=env)
    assert broken.returncode == 1
    assert b"this is no .pxi file" in broken.stderr
    return env


def test_a_c_program_finds_the_installed_library(guide):
    if shutil.which("pkg-config") is None:
        pytest.skip("pkg-config is not installed")
    home = guide(1)
    env = check_thumbnail(home, "thumbnail")
    assert raster.read(home / "photo.png").pixels.shape[1] == 200
    if shutil.which("valgrind"):
        words = ["valgrind", "-q", "--error-exitcode=9", "--leak-check=full", home / "thumbnail"]
        done = subprocess.run(words, input=PHOTO.read_bytes(), capture_output=True, env=env)
        assert done.returncode == 0, done.stderr.decode()


def test_a_rust_program_calls_the_library(guide):
    if shutil.which("rustc") is None:
        pytest.skip("rustc is not installed")
    check_thumbnail(guide(2), "thumbnail-rust")


def test_a_desktop_shows_a_thumbnail(build, tmp_path):
    loader = build / "libpixbufloader-pxi.so"
    thumbnailer = shutil.which("gdk-pixbuf-thumbnailer")
    if not (loader.is_file() and thumbnailer and shutil.which("update-mime-database")):
        pytest.skip("gdk-pixbuf, its thumbnailer or update-mime-database is not installed")
    libraries = run("pkg-config", "--variable=libdir", "gdk-pixbuf-2.0").strip()
    own = tmp_path / "loaders.cache"
    own.write_text(run(f"{libraries}/{QUERY}", loader))
    shutil.copytree(ROOT / "share/mime", tmp_path / "mime")
    env = {**os.environ, "XDG_DATA_HOME": str(tmp_path), "GDK_PIXBUF_MODULE_FILE": str(own)}
    subprocess.run(
        ["update-mime-database", tmp_path / "mime"], env=env, check=True, capture_output=True
    )
    own.write_text(own.read_text() + run(f"{libraries}/{QUERY}"))
    run(thumbnailer, "-s", "16", PHOTO, tmp_path / "out.png", env=env)
    found = raster.read(tmp_path / "out.png").pixels
    height, width = found.shape[:2]
    assert max(height, width) == 16
    expected = pxi.open(PHOTO).render(width=width, height=height)
    assert np.abs(found[..., :3].astype(int) - expected[..., :3]).max() <= 1
    broken = tmp_path / "broken.pxi"
    broken.write_bytes(PHOTO.read_bytes()[:100])
    done = subprocess.run(
        [thumbnailer, "-s", "16", broken, tmp_path / "no.png"], env=env, capture_output=True
    )
    assert done.returncode == 1
    assert not (tmp_path / "no.png").exists()

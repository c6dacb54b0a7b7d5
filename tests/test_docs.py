"""Every command and Python block of the README and the guide is run; links lead somewhere."""

import json
import re
import shlex
import shutil
import subprocess
import sys
from importlib.util import find_spec
from pkgutil import resolve_name

import numpy as np
import pytest

from proxyimg_codec.io import raster
from tests.support import onnx_models
from tests.support.paths import ROOT
from tests.support.pictures import disc, smooth

GUIDE = ROOT / "docs/guide"
CHAPTERS = re.findall(r"^\d+\. \[.*?\]\((.*?)\)", (GUIDE / "README.md").read_text("utf-8"), re.M)
PAGES = ["README.md", *(f"docs/guide/{name}" for name in CHAPTERS)]
"""In the order of the guide's index: commands use files that those of earlier pages made."""

LINKED = ["CHANGELOG.md", "CONTRIBUTING.md", "README.md", "SECURITY.md"]
LINKED += [p.relative_to(ROOT).as_posix() for p in sorted(ROOT.glob("docs/**/*.md"))]


def blocks(page, language):
    return re.findall(rf"```{language}\n(.*?)```", (ROOT / page).read_text("utf-8"), re.S)


def with_blocks(language):
    return [page for page in PAGES if blocks(page, language)]


def commands(page):
    lines = [
        shlex.split(line, comments=True)
        for b in blocks(page, "sh")
        for line in b.replace("\\\n", " ").splitlines()
    ]
    return [words for words in lines if words and words[0] != "make"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    psd_tools = pytest.importorskip("psd_tools")
    path = tmp_path_factory.mktemp("docs")
    raster.write(path / "photo.png", smooth(96, 64))
    raster.write(path / "without.png", smooth(96, 64)[::-1])
    (path / "pictures" / "2026").mkdir(parents=True)
    for name, size in (("1.png", (24, 17)), ("2026/2.png", (19, 23))):
        raster.write(path / "pictures" / name, smooth(*size))
    (path / "masks" / "cat").mkdir(parents=True)
    mask = disc(96, 64)
    low = np.zeros_like(mask)
    low[50:] = True
    eye = np.zeros_like(mask)
    eye[26:32, 44:50] = True
    for name, m in (("1 bush", low), ("2 cat", mask), ("cat/eye", eye)):
        raster.write(path / "masks" / f"{name}.png", np.repeat(m[..., None] * np.uint8(255), 3, 2))
    (path / "soft").mkdir()
    rim = np.clip(
        1.6 - np.hypot(*(np.mgrid[:64, :96] - np.array([30, 50])[:, None, None])) / 16, 0, 1
    )
    fur = np.rint(255 * rim).astype(np.uint8)
    raster.write(path / "soft" / "1 fur.png", np.repeat(fur[..., None], 3, 2))
    labels = np.where(mask, 2, low.astype(int)).astype(np.uint8)
    raster.write(path / "labels.png", np.repeat(labels[..., None], 3, 2))
    clear = np.dstack([smooth(96, 64), disc(96, 64) * np.uint8(255)])
    raster.write(path / "character.png", np.ascontiguousarray(clear.transpose(1, 0, 2)))
    raster.write(path / "bear.png", clear)
    raster.write(path / "parrots.png", smooth(96, 64))
    raster.write(path / "parrots-labels.png", np.repeat(labels[..., None], 3, 2))
    layered = psd_tools.PSDImage.new("RGB", (96, 64))
    layered.create_pixel_layer_from_array(smooth(96, 64), name="back")
    layered.create_pixel_layer_from_array(clear, name="bear")
    layered.save(path / "poster.psd")
    (path / "parts" / "2 eyes").mkdir(parents=True)
    for name in ("back.png", "1 body.png", "2 eyes/left.png"):
        raster.write(path / "parts" / name, smooth(96, 64) if name == "back.png" else clear)
    (path / "breathe.json").write_text(blocks("docs/guide/animation.md", "json")[0])
    onnx_models.write(path / "u2netp.onnx", onnx_models.figures())
    onnx_models.write(path / "depth.onnx", onnx_models.depth())
    onnx_models.write(path / "lama.onnx", onnx_models.inpainting("64, 64", 255))
    from proxyimg_codec.generate import denoiser

    classes = ("flags", "food")
    denoiser.save(path / "denoiser.pt", denoiser.Denoiser(denoiser.Shape(32, (8, 8), classes)))
    edits = [{"op": "move", "layer": "cat", "by": [3, 4]}]
    (path / "edits.json").write_text(json.dumps({"version": 1, "edits": edits}))
    return path


def test_guide_lists_its_pages():
    assert sorted(CHAPTERS) == sorted(p.name for p in GUIDE.glob("*.md") if p.stem != "README")


@pytest.fixture(scope="module")
def encoded(folder):
    """The folder, with the file that most pages begin with."""
    launched(["pxi-encode", "photo.png", "--preset", "fast"], folder)
    return folder


def launched(words, folder):
    """Runs a command as a user does, in a process of its own."""
    program = [sys.executable, str(ROOT / "bin" / words[0])]
    done = subprocess.run([*program, *words[1:]], cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, (words, done.stderr)


@pytest.mark.parametrize("page", with_blocks("sh"))
def test_commands_run(page, encoded, tool, monkeypatch):
    monkeypatch.chdir(encoded)
    assert commands(page)
    for words in commands(page):
        force = words[0] in ("pxi-encode", "pxi-edit", "pxi-animate") and "--force" not in words
        # Those of the README run as they are; for the others it is no matter how hard it tries.
        quick = words[0] == "pxi-encode" and page != "README.md" and "-e" not in words
        more = [*(["--force"] if force else []), *(["-e", "1"] if quick else [])]
        if page == "README.md":
            launched([*words, *more], encoded)
        else:
            tool(words[0].removeprefix("pxi-"), *words[1:], *more)


@pytest.mark.parametrize("page", with_blocks("python"))
def test_python_blocks_run(page, encoded):
    for block in blocks(page, "python"):
        env = {"PYTHONPATH": str(ROOT), "PATH": "/usr/bin:/bin", "OMP_WAIT_POLICY": "PASSIVE"}
        done = subprocess.run(
            [sys.executable, "-W", "error", "-c", block],
            cwd=encoded, env=env, capture_output=True, text=True,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("page", LINKED)
def test_links_lead_somewhere(page):
    text = (ROOT / page).read_text("utf-8")
    for link in re.findall(r"\]\(([^)#]+)\)", text):
        if not link.startswith("http"):
            assert ((ROOT / page).parent / link).exists(), link


@pytest.mark.parametrize(
    "page", sorted((ROOT / "docs/reference").glob("*.md")), ids=lambda p: p.stem
)
def test_reference_names_what_there_is(page):
    # The site leaves out members that it does not find, without a warning.
    pytest.importorskip("cv2")
    entry = r"^::: (\S+)(?:\n {4}options:(?:\n {6}(?!members).*)*(?:\n {6}members: \[(.*?)\])?)?"
    for name, members in re.findall(entry, page.read_text("utf-8"), re.M):
        found = resolve_name(name)
        for member in filter(None, members.split(", ")):
            assert hasattr(found, member), f"{name}.{member}"


def test_records_are_in_the_index():
    folder = ROOT / "docs/decisions"
    linked = re.findall(r"^\| \[.*?\]\((.*?)\)", (folder / "README.md").read_text("utf-8"), re.M)
    assert linked == sorted(p.name for p in folder.glob("[0-9]*.md"))


def test_glossary_names_modules():
    rows = (ROOT / "docs/glossary.md").read_text("utf-8").splitlines()
    places = [row.split("|")[-2] for row in rows if row.startswith("| ")]
    named = {name for place in places for name in re.findall(r"`([\w.]+)`", place)}
    assert "geometry.pose" in named
    for name in named:
        assert find_spec(f"proxyimg_codec.{name}"), name


@pytest.mark.skipif(shutil.which("git") is None, reason="git is not installed")
def test_no_machine_paths():
    files = subprocess.run(
        ["git", "ls-files"], cwd=ROOT, capture_output=True, text=True
    ).stdout.split("\n")
    for name in files:
        if name.startswith(("tests/", ".ci/")) or not name.endswith((".py", ".md", ".cpp", ".h")):
            continue
        assert not re.search(
            r"(^|\W)/(work|home|root)/|\.\./shared", (ROOT / name).read_text("utf-8")
        ), name

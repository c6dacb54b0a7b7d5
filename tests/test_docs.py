"""Every command and Python block of the README and the guide is run."""

import json
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from proxyimg_codec.io import raster
from tests.support.paths import ROOT
from tests.support.pictures import disc, smooth

PAGES = ["README.md", "docs/guide.md"]


def blocks(page, language):
    return re.findall(rf"```{language}\n(.*?)```", (ROOT / page).read_text(), re.S)


def commands(page):
    lines = [
        shlex.split(line, comments=True) for b in blocks(page, "sh") for line in b.splitlines()
    ]
    return [words for words in lines if words and words[0] != "make"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("docs")
    raster.write(path / "photo.png", smooth(96, 64))
    (path / "masks").mkdir()
    mask = disc(96, 64)
    low = np.zeros_like(mask)
    low[50:] = True
    for name, m in (("1 bush", low), ("2 cat", mask)):
        raster.write(path / "masks" / f"{name}.png", np.repeat(m[..., None] * np.uint8(255), 3, 2))
    labels = np.where(mask, 2, low.astype(int)).astype(np.uint8)
    raster.write(path / "labels.png", np.repeat(labels[..., None], 3, 2))
    clear = np.dstack([smooth(96, 64), disc(96, 64) * np.uint8(255)])
    raster.write(path / "character.png", np.ascontiguousarray(clear.transpose(1, 0, 2)))
    raster.write(path / "bear.png", clear)
    raster.write(path / "parrots.png", smooth(96, 64))
    raster.write(path / "parrots-labels.png", np.repeat(labels[..., None], 3, 2))
    (path / "breathe.json").write_text(blocks("docs/guide.md", "json")[0])
    edits = [{"op": "move", "layer": "cat", "by": [3, 4]}]
    (path / "edits.json").write_text(json.dumps({"version": 1, "edits": edits}))
    return path


@pytest.mark.parametrize("page", PAGES)
def test_commands_run(page, folder):
    assert commands(page)
    if not (folder / "photo.pxi").exists():
        run([*tool("pxi-encode"), "photo.png", "--preset", "fast"], folder)
    for words in commands(page):
        force = words[0] in ("pxi-encode", "pxi-edit", "pxi-animate") and "--force" not in words
        # Those of the README run as they are; for the others it is no matter how hard it tries.
        quick = words[0] == "pxi-encode" and page != "README.md" and "-e" not in words
        more = [*(["--force"] if force else []), *(["-e", "1"] if quick else [])]
        run([*tool(words[0]), *words[1:], *more], folder)


def tool(name):
    return [sys.executable, str(ROOT / "bin" / name)]


def run(words, folder):
    done = subprocess.run(words, cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, (words, done.stderr)


@pytest.mark.parametrize("page", PAGES)
def test_python_blocks_run(page, folder):
    if not (folder / "photo.pxi").exists():
        run([*tool("pxi-encode"), "photo.png", "--preset", "fast"], folder)
    assert blocks(page, "python")
    for block in blocks(page, "python"):
        env = {"PYTHONPATH": str(ROOT), "PATH": "/usr/bin:/bin", "OMP_WAIT_POLICY": "PASSIVE"}
        done = subprocess.run(
            [sys.executable, "-W", "error", "-c", block],
            cwd=folder, env=env, capture_output=True, text=True,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("page", [*PAGES, *map(str, Path(ROOT, "docs/decisions").glob("*.md"))])
def test_links_lead_somewhere(page):
    text = (ROOT / page).read_text()
    for link in re.findall(r"\]\(([^)#]+)\)", text):
        if not link.startswith("http"):
            assert ((ROOT / page).parent / link).exists(), link


@pytest.mark.skipif(shutil.which("git") is None, reason="git is not installed")
def test_no_machine_paths():
    files = subprocess.run(
        ["git", "ls-files"], cwd=ROOT, capture_output=True, text=True
    ).stdout.split("\n")
    for name in files:
        if name.startswith(("tests/", ".ci/")) or not name.endswith((".py", ".md", ".cpp", ".h")):
            continue
        assert not re.search(r"(^|\W)/(work|home|root)/|\.\./shared", (ROOT / name).read_text()), (
            name
        )

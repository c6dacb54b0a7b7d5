"""libpxi as WebAssembly, with its face in JavaScript; test_wasm_suite.py judges it."""

import gzip
import json
import os
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

import proxyimg_codec as pxi
from conformance.cases import find
from proxyimg_codec.io import raster
from tests.support.paths import ROOT

HERE = Path(__file__).parent
NODE = shutil.which("node")

ESBUILD = HERE / "node_modules" / ".bin" / "esbuild"

needs_node = pytest.mark.skipif(NODE is None, reason="node is not installed")


def run(*words: str | Path, cwd: Path = ROOT, **env: str) -> str:
    """What a program that must succeed prints."""
    ran = subprocess.run(
        [*map(str, words)], capture_output=True, text=True, cwd=cwd, env=os.environ | env
    )
    assert ran.returncode == 0, ran.stdout + ran.stderr
    return ran.stdout


@pytest.mark.usefixtures("wasm")
@pytest.mark.parametrize("still", ["pyramid-alpha", "layers"])
def test_face(still: str) -> None:
    files = {"PXI_STILL": str(find(still).input), "PXI_MOVING": str(find("moves-loop").input)}
    run(str(NODE), "--test", HERE / "wasm.test.mjs", **files)


@pytest.mark.usefixtures("wasm")
def test_metadata_is_that_of_the_package() -> None:
    path = find("metadata-all").input
    script = (
        "import { readFileSync } from 'node:fs';"
        "import { Image } from './web/pxi-wasm/index.js';"
        f"const image = await Image.open(readFileSync({json.dumps(str(path))}));"
        "const blocks = image.metadata.map((b) => [b.kind, Buffer.from(b.bytes).toString('hex')]);"
        "const cicp = Buffer.from([image.primaries, image.transfer, 0, 1]).toString('hex');"
        "console.log(JSON.stringify([...blocks, ['cicp', cicp]]));"
    )
    told = dict(json.loads(run(str(NODE), "--input-type=module", "-e", script)))
    assert told == {kind: block.hex() for kind, block in pxi.open(path).blocks.items()}


@needs_node
def test_falls_back_to_the_plain_decoder(tmp_path: Path) -> None:
    for folder in ("web/pxi", "web/pxi-wasm", "proxyimg_codec/models"):
        without = shutil.ignore_patterns("*.wasm", "__pycache__")
        shutil.copytree(ROOT / folder, tmp_path / folder, ignore=without)
    shutil.copy(ROOT / "package.json", tmp_path)
    script = (
        "import { readFileSync } from 'node:fs';"
        "import { Image, render } from './web/pxi-wasm/index.js';"
        f"const image = await Image.open(readFileSync({json.dumps(str(find('layers').input))}));"
        "console.log(JSON.stringify([...render(image, { width: 20 }).data]));"
    )
    told = json.loads(run(str(NODE), "--input-type=module", "-e", script, cwd=tmp_path))
    expected = pxi.open(find("layers").input).render(width=20)
    shown = np.array(told).reshape(*expected.shape[:2], 4)[..., : expected.shape[2]]
    assert np.abs(shown - expected.astype(int)).max() <= 1


@needs_node
def test_program_of_the_guide(tmp_path: Path, small_pxi: Path) -> None:
    [program, _] = re.findall(r"```js\n(.*?)```", (ROOT / "docs/guide/web.md").read_text(), re.S)
    (tmp_path / "node_modules").mkdir()
    (tmp_path / "node_modules" / "proxyimg-codec").symlink_to(ROOT)
    shutil.copy(small_pxi, tmp_path / "photo.pxi")
    (tmp_path / "program.mjs").write_text(program)
    assert "'bar'" in run(str(NODE), "program.mjs", cwd=tmp_path)
    expected = pxi.open(small_pxi).render(width=64)
    shown = raster.read(tmp_path / "thumbnail.png").pixels
    assert np.abs(shown.astype(int) - expected.astype(int)).max() <= 1


def test_package_holds_what_it_exports() -> None:
    package = json.loads((ROOT / "package.json").read_text())
    files = [ROOT / name for name in package["files"]]
    for entry in package["exports"].values():
        for path in [entry] if isinstance(entry, str) else entry.values():
            assert (ROOT / path).is_file()
            assert any((ROOT / path).is_relative_to(file) for file in files), path
    assert all(file.exists() for file in files)
    assert package["version"] == pxi.__version__


def packed(path: Path) -> int:
    """Bytes of a file in transit."""
    return len(gzip.compress(path.read_bytes(), 9))


@pytest.mark.usefixtures("wasm")
@pytest.mark.skipif(not ESBUILD.exists(), reason="no bundler: npm install --prefix tests/web")
def test_a_bundle_is_small_and_runs(tmp_path: Path) -> None:
    folder = tmp_path / "web" / "pxi-wasm"
    flags = ("--bundle", "--minify", "--splitting", "--format=esm", "--external:node:*")
    run(ESBUILD, ROOT / "web/pxi-wasm/index.js", *flags, f"--outdir={folder}")
    module = Path(shutil.copy(ROOT / "web/pxi-wasm/pxi.wasm", folder))
    shutil.copytree(ROOT / "proxyimg_codec/models", tmp_path / "proxyimg_codec/models")
    needed = re.findall(r'from"\./(chunk-\w+\.js)"', (folder / "index.js").read_text())
    face = sum(packed(folder / name) for name in ["index.js", *needed])
    assert packed(module) + face < 80 * 1024
    script = (
        "import { readFileSync } from 'node:fs';"
        "import { Image, render } from './web/pxi-wasm/index.js';"
        f"const image = await Image.open(readFileSync({json.dumps(str(find('pyramid').input))}));"
        "console.log(image.plain, render(image, { width: 7 }).height);"
    )
    assert run(str(NODE), "--input-type=module", "-e", script, cwd=tmp_path) == "false 5\n"

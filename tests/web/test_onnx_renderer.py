"""The renderer as ONNX makes the same pictures in WebAssembly."""

import json
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

import proxyimg_codec as pxi
from conformance import pixels
from conformance.cases import find
from tests.support.models import agrees, model_of, samples, view_of

HERE = Path(__file__).parent
NODE = shutil.which("node")

CASES = (
    "beyond", "colours-alpha", "enlarged", "folded-flipped", "hole", "moves-layers", "node-bent",
    "octaves-7", "opacity", "pyramid-alpha", "pyramid-bent", "pyramid-mixed", "reduced", "sheared",
)  # fmt: skip
"""Every kind of node that models have."""

pytestmark = pytest.mark.skipif(
    NODE is None or not (HERE / "node_modules" / "onnxruntime-web").exists(),
    reason="no runtime: npm install --prefix tests/web",
)


def test_conformance(tmp_path):
    pytest.importorskip("onnx")
    jobs, wanted = [], []
    for name in CASES:
        case = find(name)
        image, render = pxi.open(case.input), case.renders[-1]
        view = view_of(image, render.args)
        inputs = samples(view)
        numbers = np.concatenate([inputs["pixel_size"], inputs["points"].ravel()])
        (tmp_path / f"{name}.onnx").write_bytes(model_of(image, render.args).SerializeToString())
        numbers.astype("<f8").tofile(tmp_path / f"{name}.in")
        jobs.append([f"{name}.onnx", f"{name}.in", f"{name}.out"])
        wanted.append((view, pixels.read(render.expected.read_bytes())))
    (tmp_path / "jobs.json").write_text(json.dumps(jobs))
    ran = subprocess.run(
        [str(NODE), str(HERE / "onnx.mjs"), str(tmp_path)], capture_output=True, text=True
    )
    assert ran.returncode == 0, ran.stderr
    for (_, _, output), (view, expected) in zip(jobs, wanted, strict=True):
        agrees(np.fromfile(tmp_path / output, "<f4"), view, expected)

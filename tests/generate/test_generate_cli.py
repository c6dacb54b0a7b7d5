"""pxi-edit --generate and its flags."""

import json

import numpy as np
import pytest

import proxyimg_codec as pxi
from proxyimg_codec.io import raster


@pytest.fixture
def work(pictures, tmp_path, mixture, monkeypatch):
    """A folder with in.pxi, which becomes the current one."""
    pictures["implicit"].save(tmp_path / "in.pxi")
    monkeypatch.chdir(tmp_path)
    return tmp_path


GENERATE = ("--generate", "disc", "1", "--guide", "mixture", "--steps", "3")


def test_all_flags(tool, work):
    tool(
        "edit", "in.pxi", "out.pxi", *GENERATE, "--seed", "4", "--guidance", "2", "--resolution",
        "24", "--times", "0.1,0.8", "--weighting", "uniform", "--clip", "1.5", "--precision",
        "full", "--keep-structure", "0.5", "--negative", "0", "--device", "cpu", "--offload",
        "--previews", "seen", "--every", "1", "--resume", "state.pt", "-e", "1",
    )  # fmt: skip
    out = pxi.open("out.pxi")
    (step,) = out.history
    assert json.loads(step.operation) == {
        "op": "generate", "layer": "disc", "prompt": "1", "guide": "mixture", "steps": 3,
        "seed": 4, "guidance": 2.0, "resolution": 24, "times": [0.1, 0.8], "effort": 1,
        "weighting": "uniform", "clip": 1.5, "precision": "full", "keep_structure": 0.5,
        "negative": "0",
    }  # fmt: skip
    assert len(list((work / "seen").iterdir())) == 3
    assert (work / "state.pt").exists()
    tool("edit", "out.pxi", "back.pxi", "--undo", "1")
    assert (work / "back.pxi").read_bytes() == (work / "in.pxi").read_bytes()
    same = pxi.open("in.pxi").edited(json.loads(step.operation))
    assert same.to_bytes() == (work / "out.pxi").read_bytes()


def test_positions_and_more_than_one(tool, work):
    tool("edit", "in.pxi", "out.pxi", *GENERATE, "--generate", "0", "2", "--move", "disc", "2,0")
    edits = [json.loads(step.operation) for step in pxi.open("out.pxi").history]
    assert [v.get("prompt") for v in edits] == ["1", "2", None]
    assert edits[1]["layer"] == "back"


def test_a_script_generates_too(tool, work):
    edit = {"op": "generate", "layer": "disc", "prompt": "1", "guide": "mixture", "steps": 3}
    (work / "edits.json").write_text(json.dumps({"version": 1, "edits": [edit]}))
    tool(
        "edit", "in.pxi", "out.pxi", "--script", "edits.json", "--previews", "seen", "--every", "2"
    )
    assert len(pxi.open("out.pxi").history) == 1
    assert len(list((work / "seen").iterdir())) == 1


@pytest.mark.parametrize(
    ("words", "code", "said"),
    [
        (["--generate", "disc", "fur"], 2, "needs --guide"),
        (["--guide", "mixture"], 2, "--guide belongs to --generate"),
        ([*GENERATE, "--times", "0.1"], 2, "LEAST,MOST"),
        ([*GENERATE, "--every", "3"], 2, "--previews"),
        ([*GENERATE, "--previews", "seen", "--every", "0"], 2, "at least 1"),
        ([*GENERATE, "--generate", "back", "2", "--resume", "a.pt"], 2, "one --generate"),
        ([*GENERATE, "--resume", "in.pxi"], 3, "no file to go on from"),
        ([*GENERATE, "--resume", "."], 2, "is a folder"),
        ([*GENERATE, "--resume", "nowhere/a.pt"], 3, "nowhere/a.pt"),
        ([*GENERATE, "--guidance", "-2"], 2, "guidance"),
        (["--generate", "cat", "1", "--guide", "mixture"], 2, "no layer 'cat'"),
        (["--generate", "disc", " ", "--guide", "mixture"], 2, "prompt is empty"),
        (["--generate", "disc", "fur", "--guide", "empty"], 3, "holds no pipeline"),
        (["--generate", "disc", "fur", "--guide", "no/where"], 2, "no guide 'no/where'"),
        (["--generate", "disc", "", "--guide", "in.pxi"], 3, "in.pxi"),
        (["--generate", "disc", "fur", "--guide", "broken.pt"], 3, "is not a denoiser"),
        ([*GENERATE, "--device", "cuda"], 5, "no CUDA device"),
    ],
)
def test_bad_input(tool, work, words, code, said):
    import torch

    if "cuda" in words and torch.cuda.is_available():
        pytest.skip("there is a CUDA device")
    (work / "empty").mkdir()
    (work / "broken.pt").write_bytes(b"PK\x03\x04 nothing")
    assert said in tool("edit", "in.pxi", "out.pxi", *words, code=code).err
    assert not (work / "out.pxi").exists()


def test_the_output_is_not_what_is_read(tool, work):
    raster.write(work / "a.png", np.zeros((20, 20, 3), np.uint8))
    words = ("--generate", "disc", "", "--guide", "a.png")
    assert "same file" in tool("edit", "in.pxi", "a.png", *words, "--force", code=2).err
    assert "same file" in tool(
        "edit", "in.pxi", "b.pxi", *GENERATE, "--resume", "b.pxi", code=2
    ).err  # fmt: skip


def test_without_torch_it_says_which_extra(launch, work):
    """In a process that cannot import torch."""
    (work / "torch").mkdir()
    (work / "torch/__init__.py").write_text("raise ModuleNotFoundError('no', name='torch')")
    said = launch(
        "edit", "in.pxi", "out.pxi", *GENERATE, code=5,
        env={"PYTHONPATH": str(work), "PATH": "/usr/bin:/bin"},
    ).err  # fmt: skip
    assert "needs torch: pip install 'proxyimg-codec[generate]'" in said

"""`render` of the JavaScript decoder takes what that of the package takes, and refuses the rest."""

import json
import math
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import proxyimg_codec as pxi
from tests.support.paths import ROOT

NODE = shutil.which("node")
SCRIPT = Path(__file__).with_name("requests.mjs")
CASES = ROOT / "conformance" / "cases"

pytestmark = pytest.mark.skipif(NODE is None, reason="node is not installed")

TAKEN: list[dict[str, Any]] = [
    {},
    {"width": None, "height": None, "region": None, "scale": None, "layers": None, "t": None},
    {"width": 37},
    {"height": 29},
    {"width": 37, "height": 29},
    {"width": 1},
    {"height": 1},
    {"width": 40},  # 30 rows
    {"width": 2},  # 1.5 rows, ties to even
    {"region": [0, 0, 4, 10], "width": 3},  # 7.5 rows
    {"region": [0, 0, 4, 10], "width": 1},  # 2.5 rows
    {"region": [3, 5, 31, 17]},
    {"region": [3, 5, 31, 17], "width": 50},
    {"region": [3, 5, 31, 17], "height": 50},
    {"region": [63, 47, 1, 1], "width": 7},
    {"scale": 0.5},
    {"scale": 1 / 3},
    {"scale": 1.7, "region": [1, 2, 33, 21]},
    {"scale": 1e-9},
    {"scale": 2.5, "region": [10, 10, 5, 3]},  # ties: 12.5 and 7.5
    {"layers": ["disc"]},
    {"layers": [-1, 1]},
    {"layers": [2, "bar", "disc", 2]},
    {"layers": ["back"]},
    {"layers": ["disc", "back"], "background": False},
    {"background": False},
    {"background": True},
]

REFUSED: list[dict[str, Any]] = [
    {"width": 0}, {"height": 0}, {"width": -5}, {"height": -1, "width": 9}, {"width": 1.5},
    {"width": "9"}, {"height": [9]}, {"width": "<nan>"}, {"height": "<inf>"}, {"width": 1 << 22},
    {"height": 1 << 22}, {"width": 1 << 60}, {"width": 1 << 20, "height": 1 << 20},
    {"scale": 0}, {"scale": -1}, {"scale": "<nan>"}, {"scale": "<inf>"}, {"scale": "2"},
    {"scale": [1]}, {"scale": 1e5}, {"scale": 1e4}, {"scale": 1e300},
    {"scale": 2, "width": 9}, {"scale": 2, "height": 9}, {"scale": 0, "height": 9},
    {"region": []}, {"region": [1, 2, 3]}, {"region": [0, 0, 9, 9, 9]}, {"region": 7},
    {"region": "0,0,9,9"}, {"region": [0, 0, 0, 9]}, {"region": [0, 0, 9, -1]},
    {"region": [-1, 0, 9, 9]}, {"region": [0, -2, 9, 9]}, {"region": [0, 0, 65, 9]},
    {"region": [60, 0, 5, 9]}, {"region": [0, 40, 5, 9]}, {"region": [0.5, 0, 9, 9]},
    {"region": ["0", 0, 9, 9]}, {"region": [None, 0, 9, 9]},
    {"layers": []}, {"layers": ["nobody"]}, {"layers": [3]}, {"layers": [-4]}, {"layers": "disc"},
    {"layers": 1}, {"layers": [1.5]}, {"layers": [None]}, {"layers": ["0"]},
    {"layers": ["back"], "background": False}, {"layers": [[1]]},
    {"t": 0.5}, {"dtype": "int8"}, {"dtype": "magic"},
]  # fmt: skip

MOMENTS: list[dict[str, Any]] = [
    {"t": t, "width": 23} for t in (0, 0.25, 0.5000005, -0.3, 1.75, 1e6 + 0.1, 1e300)
]

KINDS = {pxi.UsageError: "usage", pxi.LimitError: "limit"}


def asked(path: Path, requests: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """What the JavaScript decoder answers."""
    lines = "\n".join(map(json.dumps, requests))
    ran = subprocess.run(
        [str(NODE), str(SCRIPT), str(path)], input=lines, capture_output=True, text=True
    )
    assert ran.returncode == 0, ran.stderr
    answers = [json.loads(line) for line in ran.stdout.splitlines()]
    assert len(answers) == len(requests)
    return answers


def compare(path: Path, requests: Sequence[dict[str, Any]], tolerance: float = 1e-4) -> None:
    image = pxi.open(path)
    for request, answer in zip(requests, asked(path, requests), strict=True):
        expected = image.render(**({"dtype": "float32"} | request))
        assert answer.get("shape") == list(expected.shape), (request, answer.get("message"))
        got = np.array(answer["data"], np.float64).reshape(expected.shape)
        assert np.abs(got - expected).max() <= tolerance, request
        assert answer["drawn"] == expected.shape[0] * expected.shape[1]


def test_requests_that_are_taken(small_pxi: Path) -> None:
    compare(small_pxi, TAKEN)


def test_moments(moving_pxi: Path) -> None:
    compare(moving_pxi, MOMENTS)


@pytest.mark.parametrize(
    "name", ["views/pyramid-cuts", "views/pyramid-cuts-hidden", "layers/alpha"]
)
def test_other_pictures(name: str) -> None:
    path = CASES / name / "input.pxi"
    width, height = (getattr(pxi.open(path), side) for side in ("width", "height"))
    region = [width // 3, height // 4, max(width // 2, 1), max(height // 2, 1)]
    compare(path, [{"width": 19}, {"height": 11, "region": region}, {"scale": 0.6}], 2e-3)


@pytest.mark.parametrize(("dtype", "tolerance"), [("uint8", 1), ("uint16", 3), ("float32", 1e-4)])
def test_types_of_samples(small_pxi: Path, dtype: str, tolerance: float) -> None:
    requests = [{"dtype": dtype, "width": 20}, {"dtype": dtype, "background": False}]
    compare(small_pxi, requests, tolerance)


def test_requests_that_are_refused(small_pxi: Path) -> None:
    special = {"<nan>": math.nan, "<inf>": math.inf}
    image = pxi.open(small_pxi)
    for request, answer in zip(REFUSED, asked(small_pxi, REFUSED), strict=True):
        given = {k: special.get(str(v), v) for k, v in request.items()}
        with pytest.raises(tuple(KINDS)) as caught:
            image.render(**given)
        assert answer.get("kind") == KINDS[caught.type], (request, str(caught.value), answer)
        assert answer["message"]


def test_unknown_options_and_limits(small_pxi: Path) -> None:
    requests = [{"widht": 3}, {"time": 1}, {"drawn": [0]}, {"limits": {"output_pixels": 50}},
                {"limits": {"output_pixels": 50}, "width": 8}]  # fmt: skip
    answers = asked(small_pxi, requests)
    assert [a.get("kind") for a in answers] == ["usage", "usage", "usage", "limit", None]
    assert "output_pixels" in answers[3]["message"]


def test_times_that_are_none(moving_pxi: Path) -> None:
    requests = [{"t": t} for t in ("<nan>", "<inf>", "1", [1], True)]
    assert [a.get("kind") for a in asked(moving_pxi, requests)] == ["usage"] * 5

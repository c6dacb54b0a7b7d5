"""The page bends meshes as `drag` does: the same cases, in Python and under node."""

import json
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from proxyimg_codec.edit import deform

SCRIPT = Path(__file__).with_name("arap.mjs")

pytestmark = pytest.mark.skipif(not shutil.which("node"), reason="node is not installed")


def grid(across, down, pitch, at=(0.0, 0.0)):
    """Nodes and triangles of a jittered rectangle."""
    y, x = np.mgrid[: down + 1, : across + 1]
    nodes = np.stack([x, y], 2).reshape(-1, 2) * pitch
    nodes = nodes + np.random.default_rng(3).uniform(-0.2, 0.2, nodes.shape) * pitch + at
    a = (y * (across + 1) + x)[:-1, :-1].ravel()
    b, c, d = a + 1, a + across + 1, a + across + 2
    return nodes, np.concatenate([np.stack([a, b, c], 1), np.stack([b, d, c], 1)]).astype(np.int32)


def two(first, second):
    """Two meshes as one."""
    triangles = [first[1], second[1] + len(first[0])]
    return np.concatenate([first[0], second[0]]), np.concatenate(triangles).astype(np.int32)


BAR, SMALL = grid(20, 6, 11.3), grid(4, 3, 9.7, at=(40, 130))
ENDS = [[12.0, 25.0], [13.0, 40.0], [190.0, 25.0], [191.0, 40.0]]
CASES = {
    "one handle": (BAR, [[30.0, 30.0]], [[47.5, 11.0]]),
    "bend": (BAR, ENDS, [[12.0, 25.0], [13.0, 40.0], [130.0, 170.0], [115.0, 165.0]]),
    "stretch": (BAR, [[20.0, 30.0], [200.0, 33.0]], [[20.0, 30.0], [290.0, 60.0]]),
    "folds": (BAR, ENDS, [[12.0, 25.0], [13.0, 40.0], [40.0, 60.0], [90.0, 33.0]]),
    "squeeze": (BAR, [[20.0, 30.0], [200.0, 33.0]], [[20.0, 30.0], [60.0, 30.0]]),
    "outside": (BAR, [[-20.0, 30.0], [240.0, 33.0]], [[-20.0, 30.0], [220.0, 90.0]]),
    "one place": (BAR, [[20.0, 30.0]] * 2 + [[99.0, 20.0]], [[25.0, 30.0]] * 2 + [[99.0, 50.0]]),
    "parts": (two(BAR, SMALL), ENDS, [[12.0, 25.0], [13.0, 40.0], [130.0, 170.0], [115.0, 165.0]]),
}  # fmt: skip


def test_bends_as_python_does():
    cases, expected = [], []
    for (nodes, triangles), points, targets in CASES.values():
        for rest in (nodes, nodes * [1.0, 1.1]):
            points, targets = np.array(points), np.array(targets)
            expected.append(deform.drag(nodes, triangles, points, targets, rest))
            arrays = {"nodes": nodes, "triangles": triangles, "points": points,
                      "targets": targets, "rest": rest}  # fmt: skip
            cases.append({key: value.tolist() for key, value in arrays.items()})
    done = subprocess.run(
        ["node", str(SCRIPT)], input=json.dumps(cases), capture_output=True, text=True, check=True
    )
    worst = {
        f"{name}, {k}": np.abs(np.reshape(got, (-1, 2)) - want).max()
        for (name, k), got, want in zip(
            [(name, k) for name in CASES for k in range(2)],
            json.loads(done.stdout),
            expected,
            strict=True,
        )
    }
    assert {name: gap for name, gap in worst.items() if gap > 0.05} == {}

"""The conformance suite for decoders under Node, one process for many runs."""

import json
import shutil
import subprocess
from collections.abc import Sequence

import pytest

from conformance.cases import FOLDER, load
from conformance.judge import Ended
from conformance.runner import run, table
from tests.support.paths import ROOT

DECODER = ROOT / "web" / "decode.mjs"
NODE = shutil.which("node")

needs_node = pytest.mark.skipif(NODE is None, reason="node is not installed")

KINDS = {
    "pictures": ["canvases", "layers", "meshes", "metadata", "motion", "networks", "poses",
                 "samplings", "textures"],
    "pyramids": ["levels", "pyramids", "versions", "views"],
    "hidden": ["behind", "mattes"],
    "refused": ["refused-arrays", "refused-behind", "refused-framing", "refused-mattes",
                "refused-metadata", "refused-motion", "refused-poses", "refused-pyramids",
                "refused-structure", "refused-values", "refused-views"],
    "bombs": ["refused-bombs"],
}  # fmt: skip
"""All kinds of cases, by the module of tests that tries them: modules run beside each other."""

ALL_KINDS = [kind for kinds in KINDS.values() for kind in kinds]


class Batch:
    """A decoder that stays in memory for many runs: starting node costs more than most cases."""

    def __init__(self) -> None:
        self.process = subprocess.Popen(
            [str(NODE), str(DECODER), "--batch"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
        )

    def ask(self, words: Sequence[str]) -> Ended:
        """How a command line ends; its message is what it says, perhaps a hash."""
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        self.process.stdin.write(json.dumps(list(words)) + "\n")
        self.process.stdin.flush()
        answer = [self.process.stdout.readline().strip()]
        while len(answer[-1]) > 3:
            answer.append(self.process.stdout.readline().strip())
        assert answer[-1], "the decoder has died"
        return Ended(int(answer[-1]), "\n".join(answer[:-1]))

    def end(self) -> None:
        """Waits for its end."""
        self.process.communicate()
        assert self.process.returncode == 0


def check(batch: Batch, kind: str, *flags: str) -> None:
    """Tries all cases of a kind; with the hashes of latents, unless there are `flags`."""
    results = run(
        load(FOLDER / kind),
        lambda source, target, more: batch.ask([*flags, str(source), str(target), *more]),
        digester=None if flags else lambda source: batch.ask(["--latents", str(source)]),
    )
    failed = [result for result in results if not result.passed]
    assert results
    assert not failed, "\n" + table(failed)

"""The JavaScript decoder passes the conformance suite, and so does libpxi as WebAssembly."""

import json
import queue
import shutil
import subprocess
from collections.abc import Iterator, Sequence

import pytest

from conformance.cases import load
from conformance.judge import Ended
from conformance.runner import run, table
from tests.support.paths import ROOT

DECODER = ROOT / "web" / "decode.mjs"
NODE = shutil.which("node")

pytestmark = pytest.mark.skipif(NODE is None, reason="node is not installed")


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

    def ask(self, words: Sequence[str]) -> list[str]:
        """What it answers to a command line: perhaps a hash, and in the end the exit code."""
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        self.process.stdin.write(json.dumps(list(words)) + "\n")
        self.process.stdin.flush()
        answer = [self.process.stdout.readline().strip()]
        while len(answer[-1]) > 3:
            answer.append(self.process.stdout.readline().strip())
        assert answer[-1], "the decoder has died"
        return answer

    def end(self) -> None:
        self.process.communicate()
        assert self.process.returncode == 0


@pytest.fixture
def batches() -> Iterator["queue.Queue[Batch]"]:
    """Decoders that nobody uses just now."""
    free: queue.Queue[Batch] = queue.Queue()
    started = [Batch(), Batch()]
    for batch in started:
        free.put(batch)
    yield free
    for batch in started:
        batch.end()


def judged(batches: "queue.Queue[Batch]", more: list[str]) -> None:
    def ask(words: Sequence[str]) -> Ended:
        batch = batches.get()
        try:
            *said, code = batch.ask(words)
        finally:
            batches.put(batch)
        return Ended(int(code), "\n".join(said))

    results = run(
        load(),
        lambda source, target, flags: ask([*more, str(source), str(target), *flags]),
        jobs=2,
        digester=None if more else lambda source: ask(["--latents", str(source)]),
    )
    failed = [result for result in results if not result.passed]
    assert not failed, "\n" + table(failed)


def test_suite(batches: "queue.Queue[Batch]") -> None:
    judged(batches, [])


@pytest.mark.usefixtures("wasm")
def test_suite_of_webassembly(batches: "queue.Queue[Batch]") -> None:
    judged(batches, ["--wasm"])

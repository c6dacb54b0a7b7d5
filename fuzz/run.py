"""Start of a fuzz target, and helpers of all targets."""

from __future__ import annotations

import contextlib
import sys
import tempfile
from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any
from unittest import mock

from .mutate import Mutator

ROOT = Path(__file__).parents[1]


def imports(name: str) -> AbstractContextManager[Any]:
    """Context in which a target imports the package.

    If the target is the program that runs, the imported modules report their coverage.
    """
    if name != "__main__":
        return contextlib.nullcontext()
    import atheris

    found: AbstractContextManager[Any] = atheris.instrument_imports(include=["proxyimg_codec"])
    return found


def seeds(largest: int = 4096) -> list[bytes]:
    """Files of the conformance suite of at most `largest` bytes, and the example."""
    paths = sorted((ROOT / "conformance" / "cases").rglob("input.pxi"))
    files = [path.read_bytes() for path in (*paths, ROOT / "spec" / "example.pxi")]
    return [data for data in files if len(data) <= largest]


def main(target: str, one_input: Callable[[bytes], None], first: list[bytes], files: bool) -> None:
    """Fuzzes until an error is found, with the command line of libFuzzer.

    Args:
        target: Name of the target, which is that of its corpus's folder.
        one_input: Function that tries an input; it raises an exception if something is wrong.
        first: Seeds that are not in the corpus.
        files: Whether inputs are `.pxi` files.
    """
    import atheris

    with tempfile.TemporaryDirectory() as folder:
        for k, data in enumerate(first):
            (Path(folder) / f"{k:04}").write_bytes(data)
        corpus = ROOT / "fuzz" / "corpus" / target
        given = [] if any(not a.startswith("-") for a in sys.argv[1:]) else [str(corpus)]
        # For a merge, libFuzzer starts the program again by this name.
        program = f"{sys.executable} -m fuzz.{target}"
        arguments = [program, *sys.argv[1:], *given, folder]
        options = {}
        if files:
            # The lambda looks up `Mutate` at each call, because it is replaced when fuzzing starts.
            options["custom_mutator"] = Mutator(first, lambda d, n: atheris.Mutate(d, n))
        atheris.Setup(arguments, one_input, **options)
        atheris.Fuzz()


def numpy_only() -> AbstractContextManager[Any]:
    """Context in which the compiled kernel is not used."""
    from proxyimg_codec.native import kernel

    def none() -> None:
        return None

    return mock.patch.object(kernel, "library", none)

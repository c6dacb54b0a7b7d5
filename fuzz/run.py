"""How a fuzz target is started."""

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
    """Around the imports of a target: they report coverage where the target is the program."""
    if name != "__main__":
        return contextlib.nullcontext()
    import atheris

    found: AbstractContextManager[Any] = atheris.instrument_imports(include=["proxyimg_codec"])
    return found


def seeds(largest: int = 4096) -> list[bytes]:
    """The files of the conformance suite that have at most `largest` bytes, and the example."""
    paths = sorted((ROOT / "conformance" / "cases").rglob("input.pxi"))
    files = [path.read_bytes() for path in (*paths, ROOT / "spec" / "example.pxi")]
    return [data for data in files if len(data) <= largest]


def main(target: str, one_input: Callable[[bytes], None], first: list[bytes], files: bool) -> None:
    """Fuzzes until something is found, with the arguments of libFuzzer.

    Args:
        target: Name of the folder of its corpus.
        one_input: What is tried; it raises if something is wrong.
        first: Seeds that are not in the corpus.
        files: Whether inputs are `.pxi` files.
    """
    import atheris

    with tempfile.TemporaryDirectory() as folder:
        for k, data in enumerate(first):
            (Path(folder) / f"{k:04}").write_bytes(data)
        corpus = ROOT / "fuzz" / "corpus" / target
        given = [] if any(not a.startswith("-") for a in sys.argv[1:]) else [str(corpus)]
        # Merging starts the program again, by this name.
        program = f"{sys.executable} -m fuzz.{target}"
        arguments = [program, *sys.argv[1:], *given, folder]
        options = {}
        if files:
            # Looked up at each call: it is replaced when fuzzing starts.
            options["custom_mutator"] = Mutator(first, lambda d, n: atheris.Mutate(d, n))
        atheris.Setup(arguments, one_input, **options)
        atheris.Fuzz()


def numpy_only() -> AbstractContextManager[Any]:
    """Without the compiled kernel."""
    from proxyimg_codec.native import kernel

    def none() -> None:
        return None

    return mock.patch.object(kernel, "library", none)

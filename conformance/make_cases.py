"""Makes all cases anew: ``python -m conformance.make_cases``; with --check only compares.

Inputs and descriptions are the same on every machine. Expected pixels come from the package's
plain numpy decoder, whose last bits may differ from machine to machine, and are not compared.
"""

from __future__ import annotations

import argparse
import functools
import json
import os
import shutil
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np

from proxyimg_codec import errors, kernel
from proxyimg_codec.image import from_bytes
from proxyimg_codec.pictures import encode_png

from . import (
    bent,
    invalid,
    invalid_motion,
    invalid_posed,
    invalid_pyramids,
    moving,
    nodes,
    posed,
    pyramid_views,
    pyramids,
    symbols,
    valid,
    views,
)
from .builders import Numbers
from .cases import EXIT_CODES, FOLDER

VALID = {
    **valid.CASES, **views.CASES, **bent.CASES, **posed.CASES, **nodes.CASES, **pyramids.CASES,
    **pyramid_views.CASES, **moving.CASES,
}  # fmt: skip
INVALID = {
    **invalid.CASES, **invalid_posed.CASES, **invalid_pyramids.CASES, **invalid_motion.CASES,
}  # fmt: skip

PEAK, RMS = 0.05, 0.01
"""Errors in 8-bit levels that are allowed: ten times what float32 sums in another order cost."""


@functools.cache
def build() -> dict[str, tuple[bytes, dict[str, Any]]]:
    """Input and description of every case, by name."""
    out: dict[str, tuple[bytes, dict[str, Any]]] = {}
    for name, case in VALID.items():
        numbers = Numbers(name)
        made = case.build(numbers)
        renders = [
            {"args": args, "expected": f"expected-{i}.png", "peak": PEAK, "rms": RMS}
            for i, args in enumerate(case.renders, 1)
        ]
        description: dict[str, Any] = {
            "title": case.title,
            "tests": list(case.tests),
            "provenance": {"generator": "conformance.make_cases", "seed": numbers.seed},
            "renders": renders,
        }
        data = made if isinstance(made, bytes) else made.to_bytes()
        latents = symbols.digest(data)
        if latents:
            description["latents"] = latents
        out[name] = data, description
    bases = {bad.base: bad.base() for bad in INVALID.values()}
    for name, bad in INVALID.items():
        error = name.split("-")[0]
        out[name] = (
            bad.build(bases[bad.base]),
            {
                "title": bad.title,
                "tests": list(bad.tests),
                "provenance": {"generator": "conformance.make_cases", "seed": Numbers("base").seed},
                "error": error,
                "exit_code": EXIT_CODES[error],
            },
        )
    return out


def as_text(description: dict[str, Any]) -> str:
    """The text of `case.json`."""
    return json.dumps(description, indent=1) + "\n"


def differences(folder: Path = FOLDER) -> list[str]:
    """Cases whose input or description on disk is not what the generator makes."""
    made = build()
    there = {f.name for f in folder.iterdir()} if folder.is_dir() else set()
    wrong = sorted(there ^ made.keys())
    for name in sorted(there & made.keys()):
        data, description = made[name]
        same = (folder / name / "input.pxi").read_bytes() == data
        text = (folder / name / "case.json").read_text(encoding="utf-8")
        if not (same and text == as_text(description)):
            wrong.append(name)
    return wrong


def write(folder: Path = FOLDER) -> None:
    """Replaces all cases.

    Raises:
        RuntimeError: The package itself does not do with an input what the case demands.
    """
    with mock.patch.dict(os.environ, PROXYIMG_NO_KERNEL="1"):
        kernel.library.cache_clear()
        _write(folder)
    kernel.library.cache_clear()


def _write(folder: Path) -> None:
    """Makes all cases, and then replaces those that differ."""
    made = build()
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=folder.parent, prefix="cases-") as new:
        _make(Path(new), made)
        for name in made:
            if not _alike(Path(new, name), folder / name):
                shutil.rmtree(folder / name, ignore_errors=True)
                Path(new, name).rename(folder / name)
    for case in folder.iterdir():
        if case.name not in made:
            shutil.rmtree(case)


def _alike(one: Path, other: Path) -> bool:
    """Whether two folders have the same files."""
    if not other.is_dir() or {f.name for f in one.iterdir()} != {f.name for f in other.iterdir()}:
        return False
    return all(f.read_bytes() == (other / f.name).read_bytes() for f in one.iterdir())


def _make(folder: Path, made: Mapping[str, tuple[bytes, Mapping[str, Any]]]) -> None:
    for name, (data, description) in made.items():
        target = folder / name
        target.mkdir(parents=True)
        (target / "input.pxi").write_bytes(data)
        (target / "case.json").write_text(as_text(description), encoding="utf-8")
        if "error" in description:
            _check_refusal(name, data, description["exit_code"])
        for render in description.get("renders", []):
            args = dict(render["args"])
            at = args.pop("time", None)
            pixels = from_bytes(data).render(t=at, **args, dtype=np.uint16, engine="numpy")
            (target / render["expected"]).write_bytes(encode_png(pixels))


def _check_refusal(name: str, data: bytes, code: int) -> None:
    try:
        from_bytes(data).render()
    except errors.PxiError as error:
        if error.exit_code == code:
            return
        raise RuntimeError(f"{name}: {error}") from error
    raise RuntimeError(f"{name}: the package accepts it")


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point; returns the exit code."""
    parser = argparse.ArgumentParser("conformance.make_cases", description="Make all cases anew.")
    parser.add_argument("--check", action="store_true", help="write nothing, compare with the disk")
    if not parser.parse_args(argv).check:
        write()
        return 0
    wrong = differences()
    for name in wrong:
        print(f"{name}: differs from what the generator makes", file=sys.stderr)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())

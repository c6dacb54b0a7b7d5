"""Makes all cases anew: ``python -m conformance.make_cases``; with --check only compares.

Inputs and descriptions are the same on every machine. Expected pixels come from the package's
plain numpy decoder, whose last bits may differ from machine to machine, and are not compared.
"""

from __future__ import annotations

import argparse
import contextlib
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

from proxyimg_codec import errors, from_bytes
from proxyimg_codec.codec import levels
from proxyimg_codec.codec.write import to_bytes
from proxyimg_codec.container import chunks, layr, motn, pose
from proxyimg_codec.io.raster import encode_png
from proxyimg_codec.native import kernel

from . import (
    bent,
    invalid,
    invalid_bombs,
    invalid_files,
    invalid_metadata,
    invalid_motion,
    invalid_posed,
    invalid_pyramids,
    invalid_values,
    metadata,
    moving,
    networks,
    nodes,
    posed,
    pyramid_views,
    pyramids,
    samplings,
    sizes,
    symbols,
    valid,
    views,
)
from .builders import Numbers, values
from .cases import EXIT_CODES, FOLDER, PROFILES
from .invalid import Invalid
from .registry import Valid
from .topics import statements

VALID: Mapping[str, Valid] = {
    name: case
    for module in (
        valid, networks, views, sizes, metadata, bent, posed, nodes, samplings, pyramids,
        pyramid_views, moving,
    )
    for name, case in module.CASES.items()
}  # fmt: skip
INVALID: Mapping[str, Invalid] = {
    name: case
    for module in (
        invalid, invalid_files, invalid_values, invalid_bombs, invalid_posed, invalid_pyramids,
        invalid_motion, invalid_metadata,
    )
    for name, case in module.CASES.items()
}  # fmt: skip

PEAK, RMS = 0.05, 0.01
"""Errors in 8-bit levels that are allowed: ten times what float32 sums in another order cost."""

Made = tuple[bytes, dict[str, Any]]
"""Input and description of a case."""


@functools.cache
def build() -> dict[str, Made]:
    """All cases by name.

    Raises:
        RuntimeError: The package itself does not do with an input what the case demands.
    """
    bases = {bad.base: bad.base() for bad in INVALID.values()}
    return {
        **{name: _valid(name, case) for name, case in VALID.items()},
        **{name: _invalid(name, bad, bad.build(bases[bad.base])) for name, bad in INVALID.items()},
    }


def _valid(name: str, case: Valid) -> Made:
    numbers = Numbers(name)
    made = case.build(numbers)
    data = made if isinstance(made, bytes) else to_bytes(made)
    profile, level = levels.profile_and_level(data)
    description = _described(case, numbers.seed)
    description |= {"profile": profile, "level": level, "renders": _renders(case.renders)}
    latents = symbols.digest(data)
    if latents:
        description["latents"] = latents
    return data, description


def _invalid(name: str, bad: Invalid, data: bytes) -> Made:
    error = name.split("-")[0]
    raised = _refusal(name, data)
    if raised.exit_code != EXIT_CODES[error] or not raised.rule:
        raise RuntimeError(f"{name}: {raised} [{raised.rule or 'no rule'}]")
    description = _described(bad, Numbers("base").seed, raised.rule)
    description |= {"profile": _profile(data, error), "error": error}
    description["exit_code"] = EXIT_CODES[error]
    if bad.optional:
        description |= {"optional": True, "renders": _renders([{}])}
    return data, description


def _described(case: Valid | Invalid, seed: int, *rules: str) -> dict[str, Any]:
    return {
        "title": case.title,
        "tests": statements([*case.tests, *rules]),
        "provenance": {"generator": "conformance.make_cases", "seed": seed},
    }


def _renders(wanted: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    return [
        {"args": args, "expected": f"expected-{i}.png", "peak": PEAK, "rms": RMS}
        for i, args in enumerate(wanted, 1)
    ]


def _refusal(name: str, data: bytes) -> errors.PxiError:
    """What the package says of a file that must be refused."""
    try:
        from_bytes(data).render()
    except errors.PxiError as error:
        return error
    raise RuntimeError(f"{name}: the package accepts it")


def _profile(data: bytes, error: str) -> str:
    """The lowest profile whose readers find the error in a file, and not another before."""
    if error == "unsupported":
        return PROFILES[0]
    found = []
    with contextlib.suppress(errors.PxiError):
        found = chunks.read_damaged(data)[0]
    if any(chunk.type == motn.TYPE for chunk in found):
        return PROFILES[2]
    return PROFILES[any(chunk.type == pose.TYPE or _node_sampling(chunk) for chunk in found)]


def _node_sampling(chunk: chunks.Chunk) -> bool:
    with contextlib.suppress(errors.PxiError):
        return chunk.type == layr.TYPE and values(chunk)["sampling"] > 0
    return False


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


def _make(folder: Path, made: Mapping[str, Made]) -> None:
    for name, (data, description) in made.items():
        target = folder / name
        target.mkdir(parents=True)
        (target / "input.pxi").write_bytes(data)
        (target / "case.json").write_text(as_text(description), encoding="utf-8")
        for render in description.get("renders", []):
            args = dict(render["args"])
            at = args.pop("time", None)
            # What is optional shows what the same file shows without its fault.
            shown = INVALID[name].base().data if "error" in description else data
            pixels = from_bytes(shown).render(t=at, **args, dtype=np.uint16, engine="numpy")
            (target / render["expected"]).write_bytes(encode_png(pixels))


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

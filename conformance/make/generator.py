"""Generator of the cases: makes them, writes them, and compares them with those on disk.

Inputs and descriptions are the same on every machine. Expected pixels come from the plain numpy
decoder of the package. Their last bits may differ between machines, therefore they are not
compared.
"""

from __future__ import annotations

import contextlib
import functools
import json
import os
import shutil
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
from proxyimg_codec.io.png import encode_png
from proxyimg_codec.model import Picture
from proxyimg_codec.native import kernel
from proxyimg_codec.render import thumbnail
from proxyimg_codec.render.pixels import selected
from proxyimg_codec.render.view import make_view

from .. import judge, pixels, symbols
from ..cases import EXIT_CODES, FOLDER, PROFILES
from .builders import Numbers, values
from .kinds import KIND_OF, REFUSED, VALID
from .refused.base import Refused
from .registry import Valid
from .topics import statements

PROVENANCE = "conformance.make_cases"
"""Former name of the generator, which is kept so that descriptions do not change."""

PEAK, RMS = 0.05, 0.01
"""Allowed errors in 8-bit levels: ten times those of float32 sums in another order."""

THUMBNAIL = round(255 / 10 ** (45 / 20), 2)
"""Allowed root mean square error of small views, in 8-bit levels: 45 dB [REN-18]."""

LAST_BITS = 0.01
"""Difference in 8-bit levels that pictures may have from machine to machine."""


Made = tuple[bytes, dict[str, Any]]
"""Input and description of a case."""


@functools.cache
def build() -> dict[str, Made]:
    """Makes all cases, by name.

    Raises:
        RuntimeError: The package itself does not do with an input what its case demands.
    """
    refused = {name: bad for cases in REFUSED.values() for name, bad in cases.items()}
    bases = {bad.base: bad.base() for bad in refused.values()}
    return {
        **{n: _valid(n, case) for cases in VALID.values() for n, case in cases.items()},
        **{n: _refused(n, bad, bad.build(bases[bad.base])) for n, bad in refused.items()},
    }


def _valid(name: str, case: Valid) -> Made:
    """Makes a valid case."""
    numbers = Numbers(name)
    made = case.build(numbers)
    data = made if isinstance(made, bytes) else to_bytes(made)
    profile, level = levels.profile_and_level(data)
    description = _described(case, numbers.seed)
    renders = _renders(case.renders, from_bytes(data).picture)
    description |= {"profile": profile, "level": level, "renders": renders}
    latents = symbols.digest(data)
    if latents:
        description["latents"] = latents
    return data, description


def _refused(name: str, bad: Refused, data: bytes) -> Made:
    """Makes a case that must be refused, from a base file that is broken to `data`."""
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


def _described(case: Valid | Refused, seed: int, *rules: str) -> dict[str, Any]:
    """Part of a description that all cases have."""
    return {
        "title": case.title,
        "tests": statements([*case.tests, *rules]),
        "provenance": {"generator": PROVENANCE, "seed": seed},
    }


def _renders(
    wanted: Sequence[Mapping[str, Any]], shown: Picture | None = None
) -> list[dict[str, Any]]:
    """Descriptions of renders, of a picture if that is known."""
    out = []
    for i, args in enumerate(wanted, 1):
        peak, rms = (255, THUMBNAIL) if shown and _thumbnail(shown, **args) else (PEAK, RMS)
        expected = f"expected-{i}.png"
        out.append({"args": args, "expected": expected, "peak": peak, "rms": rms})
    return out


def _thumbnail(
    shown: Picture, layers: Any = None, background: bool = True, time: Any = None, **view: Any
) -> bool:
    """Whether decoders may draw a picture from fewer levels [REN-18]."""
    chosen = selected(shown, layers, background)
    return thumbnail.raster(shown, chosen, make_view(shown.size, **view)) is not None


def _refusal(name: str, data: bytes) -> errors.PxiError:
    """Error that the package raises for a file that must be refused.

    Raises:
        RuntimeError: It accepts the file.
    """
    try:
        from_bytes(data).render()
    except errors.PxiError as error:
        return error
    raise RuntimeError(f"{name}: the package accepts it")


def _profile(data: bytes, error: str) -> str:
    """Lowest profile whose readers find the error in a file, and not another one before it."""
    if error == "unsupported":
        return PROFILES[0]
    found = []
    with contextlib.suppress(errors.PxiError):
        found = chunks.read_damaged(data)[0]
    if any(chunk.type == motn.TYPE for chunk in found):
        return PROFILES[2]
    return PROFILES[any(chunk.type == pose.TYPE or _node_sampling(chunk) for chunk in found)]


def _node_sampling(chunk: chunks.Chunk) -> bool:
    """Whether a chunk is a LAYR with node sampling."""
    with contextlib.suppress(errors.PxiError):
        return chunk.type == layr.TYPE and values(chunk)["sampling"] > 0
    return False


def as_text(description: dict[str, Any]) -> str:
    """Text of `case.json`."""
    return json.dumps(description, indent=1) + "\n"


def place(name: str) -> str:
    """Folder of a case within the folder of all cases."""
    return f"{KIND_OF[name]}/{name}"


def _present(folder: Path) -> set[str]:
    """Folders with files, within the folder of all cases."""
    found = (f.parent for f in folder.rglob("*") if f.is_file())
    return {parent.relative_to(folder).as_posix() for parent in found}


def differences(folder: Path = FOLDER) -> list[str]:
    """Folders of cases whose input or description on disk differs from what the generator makes."""
    made = {place(name): case for name, case in build().items()}
    there = _present(folder)
    wrong = sorted(there ^ made.keys())
    for at in sorted(there & made.keys()):
        data, description = made[at]
        same = (folder / at / "input.pxi").read_bytes() == data
        text = (folder / at / "case.json").read_text(encoding="utf-8")
        if not (same and text == as_text(description)):
            wrong.append(at)
    return wrong


def write(folder: Path = FOLDER) -> None:
    """Replaces all cases on disk.

    Raises:
        RuntimeError: The package itself does not do with an input what its case demands.
    """
    with mock.patch.dict(os.environ, PROXYIMG_NO_KERNEL="1"):
        kernel.library.cache_clear()
        _write(folder)
    kernel.library.cache_clear()


def _write(folder: Path) -> None:
    """Makes all cases, removes others from the disk, and replaces those that differ."""
    made = build()
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=folder.parent, prefix="cases-") as temporary:
        new = Path(temporary)
        _make(new, made)
        places = {place(name) for name in made}
        for other in _present(folder) - places:
            shutil.rmtree(folder / other, ignore_errors=True)
        for at in sorted(places):
            _keep(folder / at, new / at)
            shutil.rmtree(folder / at, ignore_errors=True)
            (folder / at).parent.mkdir(parents=True, exist_ok=True)
            (new / at).rename(folder / at)
    for kind in folder.iterdir():
        if not any(kind.iterdir()):
            kind.rmdir()


def _keep(old: Path, new: Path) -> None:
    """Takes pictures of a case as they were, if they differ in the last bits only."""
    for file in old.glob("*.png"):
        if (new / file.name).exists() and _same(file.read_bytes(), (new / file.name).read_bytes()):
            file.replace(new / file.name)


def _same(one: bytes, other: bytes) -> bool:
    """Whether two pictures are equal, but for differences as there are between machines."""
    first, second = pixels.read(one), pixels.read(other)
    return first.shape == second.shape and judge.difference(first, second)[0] <= LAST_BITS


def _make(folder: Path, made: Mapping[str, Made]) -> None:
    """Writes cases with their expected pictures into a folder."""
    for name, (data, description) in made.items():
        target = folder / place(name)
        target.mkdir(parents=True)
        (target / "input.pxi").write_bytes(data)
        (target / "case.json").write_text(as_text(description), encoding="utf-8")
        for render in description.get("renders", []):
            args = dict(render["args"])
            at = args.pop("time", None)
            # An optional case shows the same picture as the file without its fault.
            shown = REFUSED[KIND_OF[name]][name].base().data if "error" in description else data
            with mock.patch.object(thumbnail, "raster", return_value=None):
                drawn = from_bytes(shown).render(t=at, **args, dtype=np.uint16, engine="numpy")
            (target / render["expected"]).write_bytes(encode_png(drawn))

"""Edits that the page asks for: in the form of pxi-edit, and refused if they reach out.

So a file that the studio saves has the same bytes as one to which pxi-edit did the same.
"""

from __future__ import annotations

import contextlib
from collections.abc import Collection, Iterable, Mapping
from pathlib import Path
from typing import Any

from ..edit.script import OPERATIONS, Row
from ..errors import UsageError
from ..model import Picture

FORBIDDEN = ("generate",)
"""Operations that read what the user has not opened."""

REAL = ("number", "pair", "pairs", "matrix", "colours", "handles")
"""Kinds of parameters whose numbers are floating point."""

FILES = ("source", "mask", "guide")
"""Parameters that may name files."""


def applied(
    picture: Picture, edits: Iterable[Any], folder: Path, files: Collection[str]
) -> Picture:
    """Applies edits to a picture, all or none.

    Args:
        picture: The picture.
        edits: Operations as in an edit script.
        folder: Folder of the files that edits may name.
        files: Names of these files.

    Raises:
        PxiError: One of them failed, is unknown, or reaches for another file.
    """
    row = Row(picture)
    plain = [regular(edit) for edit in edits]
    for edit in plain:
        _refuse_others(edit, picture, files)
    with contextlib.chdir(folder):  # so that the history has names, not places
        for edit in plain:
            row.apply(edit)
    return row.picture


def regular(edit: Any) -> dict[str, Any]:
    """Edit as pxi-edit makes it of flags: parameters in their order, numbers as floating point.

    Raises:
        UsageError: It is no operation of the studio.
    """
    name = edit.get("op") if isinstance(edit, Mapping) else None
    if not isinstance(name, str) or name not in OPERATIONS or name in FORBIDDEN:
        allowed = ", ".join(k for k in OPERATIONS if k not in FORBIDDEN)
        raise UsageError(f"operation {name!r} is not known here; there are {allowed}")
    known = OPERATIONS[name].parameters
    given = {k: v for k, v in edit.items() if v is not None and v is not False}
    ordered = [k for k in known if k in given] + [k for k in given if k not in known and k != "op"]
    values = {k: given[k] for k in ordered}
    for key, value in values.items():
        if key in known and known[key].kind in REAL:
            values[key] = _real(value)
    return {"op": name, **values}


def _real(value: Any) -> Any:
    """Value whose whole numbers are floating point; what is no number stays as it is."""
    if isinstance(value, list):
        return [_real(v) for v in value]
    whole = isinstance(value, int) and not isinstance(value, bool) and abs(value) < 1 << 53
    return float(value) if whole else value


def _refuse_others(edit: Mapping[str, Any], picture: Picture, files: Collection[str]) -> None:
    """Refuses an edit that names a file which was not opened.

    Raises:
        UsageError: It does.
    """
    layers = [layer.name for layer in picture.layers]
    for key in FILES:
        value = edit.get(key)
        layered = edit["op"] == "texture" and (isinstance(value, int) or value in layers)
        if value is not None and not layered and value not in files:
            there = ", ".join(sorted(files)) or "none yet"
            raise UsageError(
                f"{edit['op']}: {key} {value!r} is no file that was added; there are: {there}"
            )

"""Items: what sections measure, one after the other."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..peers import pxi_version

Pixels = NDArray[np.uint8]

Row = dict[str, Any]
"""One line of a table, by the keys of its columns; ``method`` says what was measured."""

Earlier = Mapping[str, Sequence[Row]]
"""Rows of the items before, of the same section and picture, by the names of the items."""


@dataclass(frozen=True)
class Effort:
    """Amount of work of a run.

    Attributes:
        pictures: Most pictures of a folder.
        side: Side of crops in pixels.
        width: Width of SIREN's layers, from which the number of parameters of all follows.
        direct: Optimizer steps of our direct sampling.
        node: Optimizer steps of our node sampling.
        first: Least steps of rivals that are fitted until they converge.
        most: Most steps of these.
        effort: Effort of whole files, 1..9.
    """

    pictures: int = 24
    side: int = 512
    width: int = 128
    direct: int = 16000
    node: int = 2000
    first: int = 1000
    most: int = 4000
    effort: int = 5


FULL = Effort()
QUICK = Effort(pictures=2, side=256, width=64, effort=4)


@lru_cache(maxsize=1)
def code_version() -> str:
    """Versions of the package and of torch, with hashes of the code that measures."""
    here, hasher = Path(__file__).parent, hashlib.sha256()
    for folder in (here, here.parent / "rivals"):
        for path in sorted(folder.glob("*.py")):
            if path.stem not in ("report", "charts"):
                hasher.update(path.read_bytes())
    return f"{pxi_version()}, torch {version('torch')}, {hasher.hexdigest()[:10]}"


@dataclass(frozen=True)
class Item:
    """One measurement.

    Attributes:
        section: Name of the section.
        picture: Name of the picture.
        name: Name of the item, unique within section and picture; part of a file name.
        settings: Description of all that results depend on beside picture and code.
        pixels: uint8 [H, W, C] picture.
        measure: Function from the picture and earlier rows to rows; it can be pickled.
        code: Versions and hashes of the code, when the item was planned.
    """

    section: str
    picture: str
    name: str
    settings: str
    pixels: Pixels
    measure: Callable[[Pixels, Earlier], list[Row]]
    code: str = field(default_factory=code_version)

    @property
    def key(self) -> dict[str, str]:
        """Values that are the same for measurements of the same thing by the same code."""
        hasher = hashlib.sha256(repr(self.pixels.shape).encode() + self.pixels.tobytes())
        return {"digest": hasher.hexdigest()[:16], "settings": self.settings, "code": self.code}

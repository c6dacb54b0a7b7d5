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
from . import SECTIONS

Pixels = NDArray[np.uint8]

Row = dict[str, Any]
"""One line of a table, by the keys of its columns; ``method`` says what was measured."""

Earlier = Mapping[str, Sequence[Row]]
"""Rows of the items before, of the same section and picture, by the names of the items."""


@dataclass(frozen=True)
class Given:
    """Pictures and networks that the user has.

    Attributes:
        data: Folder with folders of pictures.
        photos: Folders of photographs to compress, instead of ``photo2k/``.
        weights: Files or folders of networks that judge pictures, by name.
    """

    data: Path
    photos: tuple[Path, ...] = ()
    weights: Mapping[str, Path] = field(default_factory=dict)


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
        paths: Optimizer steps of Bézier paths.
        photo: Side of crops of photographs to compress, in pixels; 0 = whole ones.
        checked: Optimizer steps of rivals that are compared with published figures.
    """

    pictures: int = 24
    side: int = 512
    width: int = 128
    direct: int = 16000
    node: int = 2000
    first: int = 1000
    most: int = 4000
    effort: int = 5
    paths: int = 3000
    photo: int = 0
    checked: int = 8000

    @property
    def few(self) -> int:
        """Most pictures of sections that measure many variants of one method."""
        return max(self.pictures // 4, 1)


FULL = Effort()
QUICK = Effort(
    pictures=2, side=256, width=64, direct=8000, node=600, most=2000, effort=4, paths=600,
    photo=512, checked=2000,
)  # fmt: skip


@lru_cache
def code_version(section: str) -> str:
    """Versions of the package and of torch, with a hash of the code that a section needs.

    What only writes reports, and other sections, may change without measuring again.
    """
    here, hasher = Path(__file__).parent, hashlib.sha256()
    apart = {*SECTIONS, "__init__", "charts", "report", "run", "store", "tables"} - {section}
    files = [path for path in here.glob("*.py") if path.stem not in apart]
    files += (here.parent / "rivals").glob("*.py")
    if section == "editing":
        files += (here.parents[1] / "edit").glob("*.py")
    for path in sorted(files):
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
        code: Versions and hash of the code, as they were when the item was planned.
    """

    section: str
    picture: str
    name: str
    settings: str
    pixels: Pixels
    measure: Callable[[Pixels, Earlier], list[Row]]
    code: str = ""

    def __post_init__(self) -> None:
        if not self.code:
            object.__setattr__(self, "code", code_version(self.section))

    @property
    def key(self) -> dict[str, str]:
        """Values that are the same for measurements of the same thing by the same code."""
        hasher = hashlib.sha256(repr(self.pixels.shape).encode() + self.pixels.tobytes())
        return {"digest": hasher.hexdigest()[:16], "settings": self.settings, "code": self.code}

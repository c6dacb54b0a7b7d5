"""Reader of folders whose pictures are layers of one picture."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from ...errors import InputError
from ...io.names import is_picture
from ...io.raster import read
from ...io.samples import rounded, to_float
from ...limits import DEFAULT_LIMITS, Limits
from ..shapes.mask_files import region_name, stack_order
from .nodes import Node, Patch, layered_picture
from .source import Colours, LayeredPicture, check_limit, printable


def read_folder(folder: Path, limits: Limits = DEFAULT_LIMITS) -> LayeredPicture:
    """Reads a folder of pictures of one size, which are layers of it.

    The natural order of names is back to front, with `back` or `background` first, as in folders of
    masks; a number in front is no part of a layer's name. A folder within is a group. What begins
    with a dot, and what is no picture, is passed over; links to folders are not followed.

    Args:
        folder: The folder.
        limits: Bounds on the canvas, the number of layers and their pixels.

    Raises:
        InputError: The folder cannot be read or holds no picture, or a picture is damaged, has
            another size than the first, or is not in 0..1; or all are clear.
        UnsupportedError: A picture has other colours than the first, or its type needs a package.
        LimitError: There are more layers or pixels than `limits` allow.
    """
    reader = _Reader(str(folder), limits)
    nodes = reader.nodes(folder, ())
    if not nodes:
        raise InputError(f"{folder}: holds no picture; put one a layer in it")
    # The size of the canvas is that of the first picture.
    first = next(_leaves(nodes)).draw(str(folder))
    assert first is not None, "a picture has pixels"
    height, width = first.pixels.shape[:2]
    check_limit(limits, "output_pixels", width * height, str(folder))
    found = layered_picture(nodes, (width, height), "refuse", _no_merge, limits, str(folder))
    notes = (*found.notes, *dict.fromkeys(reader.notes))
    return replace(found, blocks=dict(reader.colours.blocks or {}), notes=notes)


def _no_merge(below: object, scope: object) -> None:
    """Nothing in a folder blends."""


def _leaves(nodes: tuple[Node, ...]) -> Iterator[Node]:
    for node in nodes:
        yield from [node] if node.children is None else _leaves(node.children)


class _Reader:
    """Reader of the pictures of a folder.

    Attributes:
        name: Name of the folder in messages.
        limits: Bounds on the pictures.
        colours: Colours of those that were read.
        size: Width and height of the first.
        notes: Remarks on what was converted.
    """

    def __init__(self, name: str, limits: Limits) -> None:
        self.name, self.limits, self.colours = name, limits, Colours()
        self.size: tuple[int, int] | None = None
        self.notes: list[str] = []

    def nodes(self, folder: Path, groups: tuple[str, ...]) -> tuple[Node, ...]:
        """Pictures and groups of a folder, back to front; empty groups are left out.

        Raises:
            InputError: The folder cannot be read.
        """
        try:
            seen = [f for f in folder.iterdir() if not f.name.startswith(".")]
        except OSError as error:
            raise InputError(f"{folder}: cannot be read: {error.strerror}") from None
        found = []
        for file in sorted(seen, key=stack_order):
            name = printable(region_name(file))
            if file.is_dir() and not file.is_symlink():
                inner = self.nodes(file, (*groups, name or "group"))
                found += [Node(name, groups, children=inner)] if inner else []
            elif is_picture(file) and not file.is_dir():
                found.append(Node(name, groups, draw=partial(self._drawn, file)))
        return tuple(found)

    def _drawn(self, file: Path, where: str) -> Patch:
        """Reads a picture."""
        picture = read(file)
        self.notes += [f"{file.name}: {note}" for note in picture.notes]
        height, width = picture.pixels.shape[:2]
        self.size = self.size or (width, height)
        if (width, height) != self.size:
            raise InputError(
                f"{file}: is {width}x{height}, but the layers behind it are "
                f"{self.size[0]}x{self.size[1]}; make all pictures of one size"
            )
        pixels = self.colours.adopted(picture, str(file))
        if pixels.dtype.kind == "f":
            try:
                pixels = rounded(to_float(pixels)[0], np.uint16)
            except InputError as error:
                raise InputError(f"{file}: {error}") from None
        return Patch(pixels, 0, 0)

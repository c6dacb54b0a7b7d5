"""Warnings and notes of `validate`: oddities in a file that are not errors."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from ..container import layr, meta, motn, pose
from ..container.chunks import VERSION
from ..container.content import Container
from ..errors import PxiError
from ..geometry.boundary import Boundary
from ..io import xml
from ..io.color import cicp_problem
from ..model import Layer, Picture
from ..render.neighbours import present_outline

ERROR, WARNING, NOTE = "error", "warning", "note"

CODES = {
    "VAL-1": "a chunk that this program does not know",
    "VAL-2": "a history of another picture: the file was changed by a program that left it",
    "VAL-3": "an ICC profile that is none, or not of RGB",
    "VAL-4": "an EXIF block that is none",
    "VAL-5": "an XMP packet that is not XML, or has a DOCTYPE",
    "VAL-6": "settings or a script of a motion that are not a JSON object",
    "VAL-7": "a layer wholly outside the canvas",
    "VAL-8": "a hidden layer",
    "VAL-9": "triangles of a mesh turned over by the pose",
    "VAL-10": "a layer that should move but does not",
    "VAL-11": "a history that was not checked as a whole, because it is too long",
    "VAL-12": "a version of the format before the present one",
    "VAL-13": "a colour whose primaries or transfer are unspecified or unknown",
}
"""Codes of oddities and their meanings. VAL-12 is a note, all others are warnings."""

_NOTES = ("VAL-12",)


@dataclass(frozen=True)
class Issue:
    """Error, warning or note about a file.

    Attributes:
        code: Id of the broken statement of the specification, or one of `CODES`; empty if the file
            cannot be read.
        severity: ``error``, ``warning`` or ``note``.
        message: Description of the issue.
        chunk: Type of the chunk, and its number if there may be several; empty for the file itself.
        offset: Offset in the file, in bytes, or None.
        exit_code: For an error the exit code of its `PxiError` class; otherwise 0.
    """

    code: str
    severity: str
    message: str
    chunk: str = ""
    offset: int | None = None
    exit_code: int = 0


Place = Callable[[str, int], tuple[str, int | None]]
"""Function from the type of a chunk, and its number in that type, to its name and offset."""


def warning(code: str, detail: str, chunk: str = "", offset: int | None = None) -> Issue:
    """Creates a warning or note.

    Args:
        code: One of `CODES`.
        detail: What the issue is about, added to the meaning of the code.
        chunk: Name of the chunk; empty for the file itself.
        offset: Offset in the file, in bytes, or None.
    """
    severity = NOTE if code in _NOTES else WARNING
    return Issue(code, severity, f"{CODES[code]}: {detail}", chunk, offset)


def find(picture: Picture, c: Container, place: Place) -> Iterator[Issue]:
    """Finds the oddities of a valid file.

    Args:
        picture: The picture.
        c: Its container.
        place: Function that gives name and offset of a chunk.
    """
    for chunk in picture.extra:
        yield warning("VAL-1", f"it has {chunk.size} bytes", chunk.type, chunk.offset)
    yield from _metadata(picture, c, place)
    for i, layer in enumerate(picture.layers):
        yield from _layer(i, layer, present_outline(picture, layer), c, place)


def old(version: tuple[int, int]) -> Iterator[Issue]:
    """Yields a note if the version of a file, major and minor, is not the present one."""
    if version != VERSION:
        yield warning("VAL-12", ".".join(map(str, version)), offset=8)


def _metadata(picture: Picture, c: Container, place: Place) -> Iterator[Issue]:
    """Finds oddities in metadata blocks, settings and the motion script."""
    for name, code, fits in (
        ("icc", "VAL-3", _is_icc), ("exif", "VAL-4", _is_exif), ("xmp", "VAL-5", _is_xml),
    ):  # fmt: skip
        block = c.blocks.get(name)
        if block is not None and not fits(block):
            yield warning(code, f"it has {len(block)} bytes", *place(meta.BLOCKS[name], 0))
    problem = cicp_problem(picture.blocks["cicp"]) if c.cicp else None
    if problem is not None:
        yield warning("VAL-13", problem, *place(meta.CICP_TYPE, 0))
    settings = c.info["settings"] if c.info else ""
    script = picture.timeline.script if picture.timeline else ""
    for text, type_ in ((settings, meta.INFO_TYPE), (script, motn.TYPE)):
        if text and not _is_object(text):
            yield warning("VAL-6", f"they have {len(text)} characters", *place(type_, 0))


def _is_icc(block: bytes) -> bool:
    """Whether a block is an ICC profile for RGB with a sound header (ICC.1:2022, section 7.2)."""
    sized = len(block) >= 128 and int.from_bytes(block[:4]) == len(block)
    return sized and block[36:40] == b"acsp" and block[16:20] == b"RGB "


def _is_exif(block: bytes) -> bool:
    return block[:4] in (b"II*\0", b"MM\0*")


def _is_xml(block: bytes) -> bool:
    try:
        xml.parse(block, "XMP")
    except PxiError:
        return False
    return True


def _is_object(text: str) -> bool:
    try:
        return isinstance(json.loads(text), dict)
    except (ValueError, RecursionError):
        return False


def _layer(
    number: int, layer: Layer, outline: Boundary | None, c: Container, place: Place
) -> Iterator[Issue]:
    """Finds oddities of one layer."""
    home, what = place(layr.TYPE, number), f"{layer.name!r}"
    posed = [v["layer"] for v in c.poses]
    at_pose = place(pose.TYPE, posed.index(number)) if number in posed else home
    width, height = c.head["size"]
    if outline is not None:
        x0, y0, x1, y1 = outline.bounds()
        if x0 >= width or y0 >= height or x1 <= 0 or y1 <= 0:
            yield warning("VAL-7", what, *home)
    if layer.pose.hidden:
        yield warning("VAL-8", what, *at_pose)
    if layer.mesh is not None and layer.pose.displaced:
        refined = layer.mesh.refined
        a, b, c_ = np.moveaxis(layer.pose.present(refined)[refined.faces].astype(float), 1, 0)
        area = (b - a)[:, 0] * (c_ - a)[:, 1] - (b - a)[:, 1] * (c_ - a)[:, 0]
        turned = int(((area > 0) if layer.pose.mirrored else (area < 0)).sum())
        if turned:
            yield warning("VAL-9", f"{turned} of {len(area)} of {what}", *at_pose)
    if layer.track is not None:
        curves, shapes = layer.track.curves.any(1), layer.track.shapes.any((1, 2))
        if not (curves & shapes).any():
            yield warning("VAL-10", what, *place(motn.TYPE, 0))

"""Files that are made of a document for the user to take."""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from ..animate.sequence import frames, times
from ..codec.write import to_bytes
from ..edit.purge import purged
from ..errors import UsageError
from ..export import clip, openraster, photoshop, svg
from ..io import raster
from ..io.color import COLOUR, is_srgb, to_srgb
from ..io.files import write_atomically
from ..io.samples import rounded
from ..limits import Limits
from ..model import Picture
from ..render.pixels import render
from ..render.view import make_view
from .content import Content
from .jobs import Job
from .standalone import page_of

CLIPS = {"mp4": ".mp4", "webm": ".webm", "gif": ".gif", "webp-clip": ".webp", "apng": ".apng"}

STILLS = ("png", "jpg", "webp", "tif", "avif", "jxl")

SIDE_MAX = 1 << 15


def export(
    content: Content, asked: Mapping[str, Any], folder: Path, limits: Limits, jobs: int, job: Job
) -> str:
    """Makes a file of a document, or of the regions of a raster.

    Args:
        content: What is exported, as it is now.
        asked: ``kind``, and what suits it: see `README.md`.
        folder: Folder for the file.
        limits: Bounds on drawing.
        jobs: Threads to use.
        job: Job that is told of progress.

    Returns:
        Name of the file in the folder.

    Raises:
        PxiError: The kind or a value is wrong, or the file cannot be made.
    """
    kind = asked.get("kind")
    if kind == "masks":
        return _written(folder, f"{content.name}-masks.zip", _masks(content))
    if kind == "script":
        return _written(folder, f"{content.name}.json", _script(content))
    picture = content.edited.picture
    make: dict[str, Callable[[], bytes]] = {
        "pxi": lambda: _pxi(picture, asked),
        "svg": lambda: svg.build(picture),
        "ora": lambda: openraster.build(picture, limits=limits, progress=job.advance),
        "psd": lambda: photoshop.build(picture, limits=limits, progress=job.advance),
        "html": lambda: page_of(content.name, to_bytes(replace(picture, history=()))),
    }
    if isinstance(kind, str) and kind in make:
        return _written(folder, f"{content.name}.{kind}", make[kind]())
    if kind in STILLS:
        name = f"{content.name}.{kind}"
        _still(folder / name, picture, asked, limits, job)
        return name
    if isinstance(kind, str) and kind in CLIPS:
        name = content.name + CLIPS[kind]
        _clip(folder / name, picture, asked, jobs, job)
        return name
    known = ", ".join((*make, *STILLS, *CLIPS, "masks", "script"))
    raise UsageError(f"kind {kind!r} is unknown; there are {known}")


def _written(folder: Path, name: str, data: bytes) -> str:
    write_atomically(folder / name, data)
    return name


def _pxi(picture: Picture, asked: Mapping[str, Any]) -> bytes:
    if asked.get("purged"):
        return to_bytes(purged(picture))
    return to_bytes(replace(picture, history=()) if asked.get("baked") else picture)


def _whole(asked: Mapping[str, Any], key: str, low: int, high: int) -> int | None:
    value = asked.get(key)
    if value is None:
        return None
    if not isinstance(value, int) or isinstance(value, bool) or not low <= value <= high:
        raise UsageError(f"{key}: {value!r} is not a whole number in {low}..{high}")
    return value


def _size(picture: Picture, asked: Mapping[str, Any]) -> tuple[int, int]:
    width, height = (_whole(asked, key, 1, SIDE_MAX) for key in ("width", "height"))
    view = make_view(picture.size, width, height)
    return view.width, view.height


def _still(
    path: Path, picture: Picture, asked: Mapping[str, Any], limits: Limits, job: Job
) -> None:
    width, height = _size(picture, asked)
    job.report("rendering", 0, width * height)
    time = asked.get("time")
    if time is not None and not isinstance(time, (int, float)):
        raise UsageError(f"time: {time!r} is not a number of seconds")
    pixels = render(
        picture, width=width, height=height, t=time, limits=limits, progress=job.advance
    )
    blocks = {k: v for k, v in picture.blocks.items() if asked.get("metadata") or k in COLOUR}
    raster.write(path, pixels, blocks)


def _clip(path: Path, picture: Picture, asked: Mapping[str, Any], jobs: int, job: Job) -> None:
    fps, duration = asked.get("fps"), asked.get("duration")
    for key, value in (("fps", fps), ("duration", duration)):
        if value is not None and not isinstance(value, (int, float)):
            raise UsageError(f"{key}: {value!r} is not a number")
    at = times(picture, duration=duration, fps=fps)
    assert picture.timeline is not None, "`times` looks for it"
    size, srgb = _size(picture, asked), is_srgb(picture.blocks)
    job.report("rendering", 0, len(at))

    def shown() -> Any:
        for frame in frames(picture, at, jobs=jobs, width=size[0], height=size[1]):
            job.advance(1)
            yield frame if srgb else rounded(to_srgb(frame, picture.blocks), "uint8")

    clip.write_clip(
        str(path), shown(), fps=fps or picture.timeline.fps, size=size, alpha=not picture.opaque,
        loop=picture.timeline.loop, quality=_whole(asked, "quality", 0, 100),
        background=_colour(asked.get("background", "ffffff")),
    )  # fmt: skip


def _colour(text: Any) -> tuple[int, int, int]:
    try:
        red, green, blue = bytes.fromhex(str(text).removeprefix("#"))
    except ValueError:
        raise UsageError(f"background: {text!r} is not six hexadecimal digits") from None
    return red, green, blue


def _script(content: Content) -> bytes:
    document = content.edited
    kept = min(content.kept, document.at)
    edits = [edit for edit in document.edits[kept : document.at] if edit is not None]
    return json.dumps({"version": 1, "edits": edits}, indent=1).encode() + b"\n"


def _masks(content: Content) -> bytes:
    """ZIP file of the masks of the regions, as pxi-encode takes them in a folder."""
    import tempfile

    if content.pointing is None:
        raise UsageError("this picture was not made of a raster here, so it has no masks")
    out = io.BytesIO()
    with tempfile.TemporaryDirectory() as place, zipfile.ZipFile(out, "w") as archive:
        content.pointing.save_masks(Path(place))
        for file in sorted(Path(place).rglob("*.png")):
            archive.write(file, file.relative_to(place).as_posix())
    return out.getvalue()

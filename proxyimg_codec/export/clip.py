"""Writing of clips: a video, an animated picture, numbered PNG files or a sprite sheet.

`clip_target` lists the kinds. Video needs even sides: a last column or row is repeated where one is
odd. GIF counts time in 1/100 s and WebP in 1/1000 s; there each frame begins at the nearest tick,
so that errors do not add up.
"""

from __future__ import annotations

import contextlib
import itertools
import math
import os
import shutil
from collections.abc import Callable, Iterable, Iterator
from fractions import Fraction
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, UsageError
from ..io.files import temporary_name
from .clip_movies import MOVIES, movie_of
from .clip_pictures import Numbered, Sheet
from .clip_target import KINDS, SLOWEST, Target, target_of
from .ffmpeg import import_av, write_errors

__all__ = ["Target", "target_of", "write_clip"]

Frame = NDArray[np.uint8]

DEFAULT_QUALITY = 90


def write_clip(
    path: str,
    frames: Iterable[Frame],
    *,
    fps: float,
    size: tuple[int, int],
    alpha: bool,
    loop: bool = True,
    sheet: bool = False,
    quality: int | None = None,
    background: tuple[int, int, int] = (255, 255, 255),
) -> int:
    """Writes a clip; either all of it or nothing is written, whatever fails.

    The target is checked before the first frame is asked for. Frames are held one at a time, but a
    sprite sheet is held in memory as a whole, and GIF keeps its frames in a temporary file. Equal
    frames give equal bytes. A sequence of files replaces an older one as a whole: files of the
    older one with higher numbers are removed.

    Args:
        path: Name of the target, see `target_of`; an old file is replaced.
        frames: Frames uint8 [H, W, 3], or [H, W, 4] with straight alpha, in sRGB.
        fps: Frames a second, 0.01 to 1000; at most 50 for GIF, and 90 for WebP and APNG.
        size: Width W and height H of the frames in pixels.
        alpha: Whether the clip is transparent. If it is not, or if the target cannot be, frames
            with alpha are composited over `background`.
        loop: Whether the clip repeats for ever, where the file can say so (WebP, GIF, APNG, sprite
            sheet).
        sheet: Whether a ``.png`` is a sprite sheet.
        quality: 0 to 100 for MP4, WebM and WebP, where 100 is lossless WebP; by default 90.
        background: sRGB colour, 0 to 255.

    Returns:
        Number of bytes written.

    Raises:
        UsageError: The name, rate, size or quality does not suit the target, or there are no
            frames.
        InputError: The target cannot be written.
        UnsupportedError: PyAV is not installed, which all but PNG files need.
        ValueError: A frame is not of the given size, or not uint8.
    """
    target = target_of(path, sheet)
    rate = _rate_of(fps, target)
    if max(size) > KINDS[target.kind].longest_side or min(size) < 1:
        raise UsageError(f"{path}: a .{target.kind} cannot be {size[0]}x{size[1]} pixels")
    quality = DEFAULT_QUALITY if quality is None else quality
    if not 0 <= quality <= 100:
        raise UsageError(f"quality {quality} is not from 0 to 100")
    if target.kind in MOVIES:
        import_av()
    with _staged(target, path) as stage:
        ready = _ready(frames, size, alpha and target.alpha_bits > 0, background)
        _code(ready, lambda first: _coder_of(target, stage, first, rate, loop, quality), path)
        return sum(file.stat().st_size for file in stage.iterdir())


def _code(frames: Iterator[Frame], coder_of: Callable[[Frame], _Coder], path: str) -> None:
    """Writes frames with the coder that `coder_of` makes for the first of them."""
    first = next(frames, None)
    if first is None:
        raise UsageError(f"{path}: there are no frames to write")
    with _explained(path):
        coder = coder_of(first)
    with contextlib.closing(coder):
        for frame in itertools.chain([first], frames):
            with _explained(path):
                coder.add(frame)
        with _explained(path):
            coder.finish()


class _Coder(Protocol):
    """Interface of objects that write frames into files."""

    def add(self, frame: Frame) -> None:
        """Takes the next frame, uint8 [H, W, 3 or 4]; all frames have one shape."""

    def finish(self) -> None:
        """Completes the files after the last frame."""

    def close(self) -> None:
        """Closes the files; called after success and after failure."""


def _coder_of(
    target: Target, stage: Path, first: Frame, rate: Fraction, loop: bool, quality: int
) -> _Coder:
    """Coder for a kind of target, which writes into the folder `stage`."""
    if target.kind == "frames":
        return Numbered(target, stage)
    if target.kind == "sheet":
        return Sheet(target, stage, rate, loop)
    return movie_of(target.kind, stage / target.path.name, first, rate, loop, quality)


def _rate_of(fps: float, target: Target) -> Fraction:
    """Frame rate as the fraction that a number such as 29.97 or 30000 / 1001 stands for.

    Raises:
        UsageError: The target cannot have that rate.
    """
    fastest = KINDS[target.kind].fastest
    if not (math.isfinite(fps) and SLOWEST <= fps <= fastest):
        raise UsageError(
            f"{fps:g} frames a second: {target.path.name} can have {SLOWEST:g} to {fastest}"
        )
    return Fraction(fps).limit_denominator(1001)


def _ready(
    frames: Iterable[Frame], size: tuple[int, int], alpha: bool, background: tuple[int, int, int]
) -> Iterator[Frame]:
    """Converts frames to four channels if `alpha`, otherwise to three."""
    for frame in frames:
        if frame.dtype != np.uint8 or frame.shape not in ((*size[::-1], 3), (*size[::-1], 4)):
            raise ValueError(f"a frame is {frame.dtype} {frame.shape}, not of size {size}")
        transparent = frame.shape[2] > 3
        if transparent and not alpha:
            weight = frame[..., 3:].astype(np.uint16)
            mixed = frame[..., :3] * weight + np.array(background, np.uint16) * (255 - weight)
            frame = ((mixed + 127) // 255).astype(np.uint8)
        elif alpha and not transparent:
            frame = np.dstack([frame, np.full_like(frame[..., :1], 255)])
        yield np.ascontiguousarray(frame)


@contextlib.contextmanager
def _explained(path: str) -> Iterator[None]:
    """Turns failures of the system and of FFmpeg into an `InputError` that names the target."""
    try:
        yield
    except write_errors() as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise InputError(f"{path}: cannot be written: {reason}") from None


@contextlib.contextmanager
def _staged(target: Target, path: str) -> Iterator[Path]:
    """Temporary folder whose files replace the target on success, and are deleted on failure."""
    for file in [target.first] + [target.sidecar] * (target.kind == "sheet"):
        if file.exists() and not file.is_file():
            raise InputError(f"{file}: exists and is not a file")
    # A symbolic link is kept: the file that it points to is replaced.
    folder = Path(os.path.realpath(target.path)).parent
    made = target.kind == "frames" and not folder.exists()
    stage = folder / temporary_name()
    try:
        with _explained(path):
            if made:
                folder.mkdir()
            stage.mkdir(0o700)
        yield stage
        with _explained(path):
            _settle(stage, target)
    finally:
        shutil.rmtree(stage, ignore_errors=True)
        if made:
            # On failure the folder is empty, and is removed; otherwise it is kept.
            with contextlib.suppress(OSError):
                folder.rmdir()


def _settle(stage: Path, target: Target) -> None:
    """Moves the files from the stage to their places."""
    made = sorted(stage.iterdir())
    for file in made:
        with open(file, "rb") as stream:
            os.fsync(stream.fileno())
    for file in made:
        place = Path(os.path.realpath(target.path.with_name(file.name)))
        if place.exists():
            shutil.copymode(place, file)
        os.replace(file, place)
    if target.kind == "frames":
        # The rest of an older, longer clip would be played as part of this one.
        stale = map(target.numbered, itertools.count(len(made)))
        for old in itertools.takewhile(Path.is_file, stale):
            old.unlink()

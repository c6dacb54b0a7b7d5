"""Measurement of every picture by every codec at every quality, in separate processes."""

from __future__ import annotations

import hashlib
import math
import os
import platform
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, PxiError, UsageError
from ..io import raster
from . import workers
from .peers import EFFORT, EQUAL_TIME, Codec, codecs
from .rows import Row

Pixels = NDArray[np.uint8]

SUFFIXES = (".png", ".webp", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".ppm", ".jp2", ".npy")
"""Suffixes of the files of a folder that are read as pictures."""


@dataclass(frozen=True)
class Source:
    """A picture of the folder.

    Attributes:
        path: File of the picture.
        width: Width in pixels.
        height: Height in pixels.
        alpha: Whether some of it is transparent.
        digest: Hash of shape and pixels.
        masks: Label map, or folder of masks; None if there is none.
    """

    path: Path
    width: int
    height: int
    alpha: bool
    digest: str
    masks: Path | None = None


@dataclass(frozen=True)
class Task:
    """One measurement to make: a picture, encoded and decoded by a codec at a quality.

    With `perceptual`, SSIMULACRA 2 is measured as well.
    """

    source: Source
    codec: Codec
    version: str
    quality: float
    perceptual: bool = False


@dataclass(frozen=True)
class Failure:
    """Result of a task that failed, with the message of the error."""

    message: str


def find(folder: Path, chosen: str | None = None, masks: Path | None = None) -> list[Source]:
    """Finds the pictures of a folder, sorted by name.

    Args:
        folder: Folder of the pictures; folders inside it are not searched.
        chosen: Number of pictures to take from the first on, or their names without suffix,
            separated by commas; None = all.
        masks: Folder that has, for some pictures, a label map ``NAME.png`` or a folder of masks
            ``NAME``.

    Raises:
        InputError: A folder does not exist, has no pictures or two of the same name, or a picture
            is damaged.
        UsageError: A chosen picture does not exist.
    """
    files = files_of(folder)
    if masks is not None and not masks.is_dir():
        raise InputError(f"{masks}: is not a folder")
    names = [p.stem for p in files]
    if chosen is not None and chosen.isdecimal():
        if int(chosen) == 0:
            raise UsageError("--images 0: at least one picture is needed")
        files = files[: int(chosen)]
    elif chosen is not None:
        wanted = chosen.split(",")
        unknown = [n for n in wanted if n not in names]
        if unknown:
            raise UsageError(f"--images: {folder} has no picture {unknown[0]!r}")
        files = [p for p in files if p.stem in wanted]
    return [_source(path, masks) for path in files]


def files_of(folder: Path) -> list[Path]:
    """Picture files of a folder, sorted by name; folders inside it are not searched.

    Raises:
        InputError: The folder does not exist, has no pictures or two of the same name.
    """
    if not folder.is_dir():
        raise InputError(f"{folder}: is not a folder")
    seen = (p for p in folder.iterdir() if not p.name.startswith("."))
    files = sorted(p for p in seen if p.suffix.lower() in SUFFIXES and p.is_file())
    if not files:
        raise InputError(f"{folder}: holds no pictures ({', '.join(SUFFIXES)})")
    names = [p.stem for p in files]
    if len(set(names)) < len(names):
        twin = next(n for n in names if names.count(n) > 1)
        raise InputError(f"{folder}: two pictures are called {twin}; rename one")
    return files


def _source(path: Path, masks: Path | None) -> Source:
    pixels = load(path)
    height, width, channels = pixels.shape
    digest = hashlib.sha256(repr(pixels.shape).encode() + pixels.tobytes()).hexdigest()[:16]
    found = [] if masks is None else [masks / f"{path.stem}.png", masks / path.stem]
    found = [p for p in found if p.exists()]
    return Source(path, width, height, channels == 4, digest, found[0] if found else None)


def load(path: Path) -> Pixels:
    """Reads a picture as uint8 RGB [H, W, 3], or with straight alpha [H, W, 4] if not opaque."""
    pixels = raster.read(path).pixels
    if pixels.dtype.kind == "f":
        pixels = np.rint(np.clip(pixels, 0, 1) * 255).astype(np.uint8)
    elif pixels.dtype != np.uint8:
        pixels = np.rint(pixels / 257.0).astype(np.uint8)
    if pixels.ndim == 2:
        pixels = pixels[..., None]
    if pixels.shape[2] < 3:
        pixels = np.dstack([pixels[..., :1]] * 3 + [pixels[..., 1:]])
    if pixels.shape[2] == 4 and (pixels[..., 3] == 255).all():
        pixels = pixels[..., :3]
    return np.ascontiguousarray(pixels, np.uint8)


def plan(
    sources: Sequence[Source], codecs: Iterable[Codec], perceptual: bool = False
) -> list[Task]:
    """Lists all tasks, without those where a codec lacks alpha, or a picture the masks it needs."""
    table = [(codec, codec.version()) for codec in codecs]
    return [
        Task(source, codec, version, quality, perceptual)
        for source in sources
        for codec, version in table
        if (codec.alpha or not source.alpha) and (source.masks is not None or not codec.masks)
        for quality in codec.qualities
    ]


def run(tasks: Sequence[Task], jobs: int, finished: Callable[[Row | Failure], None]) -> None:
    """Runs the tasks in `jobs` worker processes; see `workers.run`."""
    workers.run(measure, tasks, jobs, finished)


def measure(task: Task) -> Row | Failure:
    """Runs a task; errors become a `Failure`. CPU seconds are those of the two calls alone."""
    source, codec = task.source, task.codec
    where = f"{source.path.name} by {codec.name} at quality {task.quality:g}"
    try:
        return _measure(source, codec, task)
    except PxiError as error:
        return Failure(f"{where}: {_line(error)}")
    except Exception as error:
        # Foreign codecs raise errors of any class; the other measurements must not be lost.
        return Failure(f"{where}: {type(error).__name__}: {_line(error)}")


def _line(error: Exception) -> str:
    return " ".join(str(error).splitlines())


def _measure(source: Source, codec: Codec, task: Task) -> Row:
    from .measure import ms_ssim, psnr, ssimulacra2

    pixels = _pixels(source.path)
    encode = codec.encode
    if codec.masks:
        from ..encoder.shapes.mask_files import load_masks

        encode = partial(encode, masks=load_masks(str(source.masks), source.width, source.height))
    _warm(codec)
    start = time.process_time()
    data = encode(pixels, task.quality)
    middle = time.process_time()
    decoded = codec.decode(data)
    end = time.process_time()
    if decoded.shape[:2] != pixels.shape[:2] or decoded.dtype != np.uint8:
        raise InputError(f"decoded to {decoded.dtype} {decoded.shape}, not uint8 {pixels.shape}")
    return Row(
        source.path.stem, source.digest, source.width, source.height,
        codec.name, codec.settings, task.version, machine(), task.quality,
        len(data), round(8 * len(data) / (source.width * source.height), 6),
        round(psnr(pixels, decoded), 5), round(ms_ssim(pixels, decoded), 7),
        round(ssimulacra2(pixels, decoded), 4) if task.perceptual else None,
        round(middle - start, 5), round(end - middle, 5),
    )  # fmt: skip


def as_slow(source: Source, effort: int | None) -> Codec:
    """Entry of AVIF 4:4:4 whose CPU time on a picture is nearest to that of our own codec."""
    table = codecs(EFFORT if effort is None else effort)

    def seconds(name: str) -> float:
        codec = table[name]
        quality = codec.qualities[len(codec.qualities) // 2]
        _warm(codec)
        start = time.process_time()
        codec.encode(_pixels(source.path), quality)
        return max(time.process_time() - start, 1e-3)

    aim = seconds("pxi")
    names = ["avif444", *(f"avif444-s{n}" for n in reversed(EQUAL_TIME))]
    best, least = names[0], math.inf
    for name in names:  # slower and slower
        apart = abs(math.log(seconds(name) / aim))
        if apart > least:
            break
        best, least = name, apart
    return table[best]


_pixels = lru_cache(maxsize=1)(load)

_warmed: set[str] = set()


def _warm(codec: Codec) -> None:
    """Runs a codec once before its first timed call, so that its imports and tables are loaded."""
    if codec.name not in _warmed:
        _warmed.add(codec.name)
        y, x = np.mgrid[0:32, 0:32].astype(np.uint8)
        ramp = np.dstack([8 * x, 8 * y, 4 * (x + y)])
        codec.decode(codec.encode(ramp, codec.qualities[len(codec.qualities) // 2]))


@lru_cache(maxsize=1)
def machine() -> str:
    """Name of the processor, and number of cores."""
    model = platform.processor() or platform.machine()
    info = Path("/proc/cpuinfo")
    if info.exists():
        names = [v for v in info.read_text().splitlines() if v.startswith("model name")]
        model = names[0].split(":")[1].strip() if names else model
    return f"{model}, {os.cpu_count()} cores"

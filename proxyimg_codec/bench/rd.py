"""Measurement of every picture by every codec at every quality, in separate processes."""

from __future__ import annotations

import hashlib
import multiprocessing
import os
import platform
import time
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from functools import lru_cache, partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, LimitError, PxiError, UsageError
from ..io import raster
from .peers import Codec
from .rows import Row

Pixels = NDArray[np.uint8]

SUFFIXES = (".png", ".webp", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".ppm", ".jp2", ".npy")
"""Suffixes of the files of a folder that are read as pictures."""

ONE_THREAD = dict.fromkeys(
    ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMEXPR_NUM_THREADS"), "1"
)


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
    """One measurement to make: a picture, encoded and decoded by a codec at a quality."""

    source: Source
    codec: Codec
    version: str
    quality: float


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
    for place in (folder, masks):
        if place is not None and not place.is_dir():
            raise InputError(f"{place}: is not a folder")
    seen = (p for p in folder.iterdir() if not p.name.startswith("."))
    files = sorted(p for p in seen if p.suffix.lower() in SUFFIXES and p.is_file())
    if not files:
        raise InputError(f"{folder}: holds no pictures ({', '.join(SUFFIXES)})")
    names = [p.stem for p in files]
    if len(set(names)) < len(names):
        twin = next(n for n in names if names.count(n) > 1)
        raise InputError(f"{folder}: two pictures are called {twin}; rename one")
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


def plan(sources: Sequence[Source], codecs: Iterable[Codec]) -> list[Task]:
    """Lists all tasks, without those where a codec lacks alpha, or a picture the masks it needs."""
    table = [(codec, codec.version()) for codec in codecs]
    return [
        Task(source, codec, version, quality)
        for source in sources
        for codec, version in table
        if (codec.alpha or not source.alpha) and (source.masks is not None or not codec.masks)
        for quality in codec.qualities
    ]


def run(tasks: Sequence[Task], jobs: int, finished: Callable[[Row | Failure], None]) -> None:
    """Runs the tasks in processes of one thread each, in any order.

    If `finished` raises or the user interrupts, all processes are stopped at once.

    Args:
        tasks: The tasks.
        jobs: Number of processes.
        finished: Called with each result.

    Raises:
        LimitError: A process was killed, most likely for want of memory.
    """
    before = {name: os.environ.get(name) for name in ONE_THREAD}
    os.environ.update(ONE_THREAD)
    try:
        context = multiprocessing.get_context("spawn")
        with ProcessPoolExecutor(min(jobs, len(tasks)), context, _start) as pool:
            try:
                for future in as_completed([pool.submit(measure, t) for t in tasks]):
                    finished(future.result())
            except BaseException:  # Ctrl-C too must leave no worker behind
                for process in multiprocessing.active_children():
                    process.terminate()
                pool.shutdown(cancel_futures=True)
                raise
    except BrokenProcessPool:
        raise LimitError("a worker process was killed, most likely for want of memory; "
                         "try fewer --jobs") from None  # fmt: skip
    finally:
        for name, value in before.items():
            os.environ.pop(name) if value is None else os.environ.update({name: value})


def _start() -> None:
    """Prepares a worker: Ctrl-C is left to the main process, and OpenCV uses one thread."""
    import signal

    import cv2

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    cv2.setNumThreads(1)


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
    from .measure import ms_ssim, psnr

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
        round(middle - start, 5), round(end - middle, 5),
    )  # fmt: skip


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

"""Helpers of all benchmarks: pictures, crops, child processes, and a header of the output."""

from __future__ import annotations

import platform
import resource
import subprocess
import sys
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from proxyimg_codec.bench.rd import machine
from proxyimg_codec.io import raster

Pixels = NDArray[Any]


def header(data: Path) -> str:
    """Line with the command, versions, the name of the data folder, and the machine."""
    parts = [f"$ python -m {Path(sys.argv[0]).parent.name}.{Path(sys.argv[0]).stem} "
             + " ".join(sys.argv[1:])]  # fmt: skip
    for name in ("proxyimg-codec", "numpy", "torch", "onnxruntime"):
        try:
            parts.append(f"{name} {version(name)}")
        except PackageNotFoundError:
            parts.append(f"{name} absent")
    parts += [f"Python {platform.python_version()}", f"data {data.resolve().name}", machine()]
    return "; ".join(parts)


def kodak(data: Path) -> list[Path]:
    """Paths of the 24 Kodak pictures, sorted; exits if there are not 24 in ``kodak/``."""
    files = sorted((data / "kodak").glob("kodim*.png"))
    if len(files) != 24:
        sys.exit(f"{data / 'kodak'}: expected kodim01.png .. kodim24.png")
    return files


def read_rgb(path: Path) -> Pixels:
    """Reads a picture file as RGB, uint8 or uint16 [H, W, 3]."""
    return np.ascontiguousarray(raster.read(path).pixels[..., :3])


def centre_crop(pixels: Pixels, size: int = 512) -> Pixels:
    """Central part [size, size, C] of a picture [H, W, C]."""
    y, x = ((n - size) // 2 for n in pixels.shape[:2])
    return np.ascontiguousarray(pixels[y : y + size, x : x + size])


def run_limited(code: str, threads: int | None = None) -> tuple[str, float, float]:
    """Runs Python code in another process.

    Args:
        code: The code.
        threads: Number of threads for numpy; None leaves it to numpy.

    Returns:
        Standard output, peak memory in GB, and CPU seconds.
    """
    import os

    env = dict(os.environ)
    if threads:
        env |= dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), str(threads))
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    script = (
        code + "\nimport resource; "
        "print('PEAK', resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6)"
    )
    done = subprocess.run([sys.executable, "-c", script], env=env, text=True, capture_output=True)
    if done.returncode:
        sys.exit(done.stderr)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    text, peak = done.stdout.rsplit("PEAK", 1)
    return text.strip(), float(peak), cpu

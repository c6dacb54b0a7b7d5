"""Judgement of a decoder: compares what it did with what a case demands."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import pixels
from .cases import EXIT_CODES, Case, Render


@dataclass(frozen=True)
class Ended:
    """End of a run of a decoder.

    Attributes:
        code: Exit code; None if the run was stopped.
        message: Last part of its output.
    """

    code: int | None
    message: str = ""


Decoder = Callable[[Path, Path, Sequence[str]], Ended]
"""Function from the input, the file for the picture, and flags."""

Digester = Callable[[Path], Ended]
"""Function from the input; its message is the SHA-256 of the latents, in hexadecimal."""


@dataclass(frozen=True)
class Result:
    """Result of one run of a decoder.

    Attributes:
        case: Name of the case.
        render: Number of the render in the case, from 0.
        problem: Empty if the decoder passed; otherwise ``timeout``, ``exit``, ``output``, ``size``,
            ``latents`` or ``pixels``, a colon and the details.
        peak: Largest error in 8-bit levels, or None if nothing was compared.
        rms: Root mean square error in 8-bit levels, or None if nothing was compared.
        seconds: Duration of the run.
    """

    case: str
    render: int
    problem: str
    peak: float | None
    rms: float | None
    seconds: float

    @property
    def passed(self) -> bool:
        """Whether the decoder passed."""
        return not self.problem


def judge(
    case: Case,
    number: int,
    decoder: Decoder,
    suffix: str = ".png",
    digester: Digester | None = None,
) -> Result:
    """Runs a decoder on one render of a case, or on an input that must be refused.

    Args:
        case: The case.
        number: Position in `case.renders`; 0 if the case has none. An optional case has one render,
            for decoders that do not refuse the file.
        decoder: The decoder to test.
        suffix: Suffix of its output: ``.png`` or ``.npy``.
        digester: Function that hashes latents; it is tested with the first render of a case.
    """
    render = case.renders[number] if case.renders else None
    with tempfile.TemporaryDirectory(prefix="pxi-conformance-") as folder:
        output = Path(folder) / f"out{suffix}"
        started = time.perf_counter()
        ended = decoder(case.input, output, render.flags if render else ())
        seconds = time.perf_counter() - started
        peak = rms = None
        refused = case.error if not (case.optional and ended.code == 0) else None
        problem = _ending(ended, EXIT_CODES[refused] if refused else 0)
        if not problem and refused and output.exists():
            problem = "output: a picture was written although the file was refused"
        if not problem and not refused and render is not None:
            problem, peak, rms = _compare(output, render)
    if case.latents and number == 0 and digester and not problem:
        problem = _hash(digester(case.input), case.latents)
    return Result(case.name, number, problem, peak, rms, seconds)


def _ending(ended: Ended, wanted: int) -> str:
    """Compares the end of a run with the exit code `wanted`; returns the problem, or nothing."""
    said = (ended.message.strip().splitlines() or ["no message"])[-1][:200]
    if ended.code is None:
        return f"timeout: {said}"
    if ended.code < 0:
        return f"exit: killed by signal {-ended.code} instead of code {wanted} ({said})"
    if ended.code != wanted:
        return f"exit: code {ended.code} instead of {wanted} ({said})"
    return ""


def _hash(ended: Ended, wanted: str) -> str:
    """Compares a hash of latents with `wanted`; returns the problem, or nothing."""
    found = ended.message.strip()
    if ended.code == 0 and found != wanted:
        return f"latents: the hash is {found[:64] or 'missing'} instead of {wanted}"
    return _ending(ended, 0)


def _compare(output: Path, render: Render) -> tuple[str, float | None, float | None]:
    """Compares the picture of a decoder with a render; returns problem, peak and RMS error."""
    expected = pixels.read(render.expected.read_bytes())
    try:
        got = pixels.read(output.read_bytes())
    except OSError:
        return "output: no picture was written", None, None
    except ValueError as error:
        return f"output: {error}", None, None
    if got.shape[:2] != expected.shape[:2]:
        size, wanted = (f"{s[1]}x{s[0]}" for s in (got.shape, expected.shape))
        return f"size: {size} instead of {wanted}", None, None
    if not np.isfinite(got).all():
        return "pixels: not all are finite numbers", None, None
    peak, rms = difference(got, expected)
    # The condition is negated so that NaN fails.
    if not (peak <= render.peak and rms <= render.rms):
        allowed = f"{render.peak:g} and {render.rms:g}"
        return f"pixels: peak {peak:.3f} and RMS {rms:.3f} exceed {allowed}", peak, rms
    return "", peak, rms


def difference(a: NDArray[Any], b: NDArray[Any]) -> tuple[float, float]:
    """Difference of two pictures, premultiplied.

    Args:
        a: [H, W, 3 or 4] finite samples; integers of the full range of their type, or floats in
            0..1.
        b: The other picture, of the same width and height.

    Returns:
        Peak and root mean square of the error, in 8-bit levels.
    """
    error = np.abs(_levels(a) - _levels(b))
    peak = float(error.max())
    # If all errors are equal, rounding may put the root mean square above the peak.
    rms = float(np.sqrt(np.mean(error**2)))
    assert rms <= peak * (1 + 1e-12), "the mean error exceeds the largest"
    return peak, min(rms, peak)


def _levels(picture: NDArray[Any]) -> NDArray[np.float64]:
    """Premultiplied picture float64 [H, W, 4] in 8-bit levels; without alpha it is opaque."""
    top = 1.0 if picture.dtype.kind == "f" else float(np.iinfo(picture.dtype).max)
    values = np.ones((*picture.shape[:2], 4))
    values[..., : picture.shape[2]] = picture / top
    values[..., :3] *= values[..., 3:]
    return values * 255

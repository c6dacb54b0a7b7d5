"""Section *compression*: photographs at fixed rates, by codecs and by coded representations."""

from __future__ import annotations

import time
from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from .items import Earlier, Effort, Given, Item, Pixels, Row
from .pictures import crops
from .tables import Column, Table, mean

if TYPE_CHECKING:
    from ..peers import Codec

RATES = (0.25, 0.5)
"""Rates in bits per pixel."""

CODECS = ("jpeg", "jp2", "webp", "avif444", "jxl")
"""Codecs of `pxi-bench rd` that take part, as far as their libraries are there."""

RIVALS = ("COIN", "2-D Gaussians")

OURS = ("pxi pyramid", "pxi implicit")

OVER = 1.05
"""Factor by which a mean may exceed the rate and still be compared."""

IMPLICIT, TRIES = (0.0, 100.0), 5
"""Qualities of the implicit coder between which one of the wanted size is looked for, and how many
are tried."""


def conclusions(rows: Sequence[Row]) -> list[str]:
    """Sentences on where ours stand, and on codecs that are missing."""
    said = []
    for rate in dict.fromkeys(r["rate"] for r in rows):
        groups = {n[1]: g for n, g in TABLE.grouped(rows).items() if n[0] == rate}
        most = OVER * float(rate)
        means = {m: mean(g, "psnr") or 0.0 for m, g in groups.items()
                 if (mean(g, "bpp") or 0.0) <= most}  # fmt: skip
        for ours in OURS:
            if ours in means:
                ahead = [m for m in means if means[m] > means[ours]]
                said.append(f"{ours} at {rate} bpp: behind {', '.join(ahead)}." if ahead else
                            f"{ours} at {rate} bpp: ahead of all.")  # fmt: skip
            elif ours in groups:
                said.append(f"{ours} cannot be as small as {rate} bpp here; not compared.")
    there = {r["method"] for r in rows}
    lost = [label for name, label in _labels().items() if label not in there]
    if rows and lost:
        said.append(f"Missing, because their libraries are not installed: {', '.join(lost)}.")
    return said


TABLE = Table(
    rows=("rate", "method"),
    columns=(
        Column("bpp", "bpp", "{:.3f}"),
        Column("psnr", "PSNR dB", "{:.2f}"),
        Column("ssim", "SSIM", "{:.4f}"),
        Column("ms_ssim", "MS-SSIM", "{:.4f}"),
        Column("encoding", "encode Mpx/s", "{:.4f}"),
        Column("decoding", "decode Mpx/s", "{:.3f}"),
    ),
    charted="psnr",
    conclusions=conclusions,
    notes=(
        "Each file has the highest quality that does not exceed the rate (the pyramid comes within "
        "a per cent); bpp says what became of it. Speeds are in CPU seconds of one thread. "
        "Encoding is one call with the quality known, but of the pyramid a search for the size.",
        "COIN has weights of 16 bits, Gaussians about 9 bytes each (places of 12 bits, factors and "
        "colours of 8; GaussianImage quantizes while it trains, and is a little better for it). "
        "Both are fitted for a bounded number of steps, not until they converge.",
        "The implicit coder is ours with direct sampling, codes of 4 bits and network in the file. "
        "The pyramid is a learned codec whose network is part of the format.",
        "The paper's own row (bpp, PSNR, SSIM and speeds, on DIV2K) could not be looked up for "
        "this table, so it is missing; `--photos DIR` measures on that set.",
    ),
)


def items(given: Given, effort: Effort) -> list[Item]:
    """Items of photographs of the named folders, or of ``photo2k/``.

    Raises:
        InputError: A folder is missing.
    """
    there = _present()
    methods = [*there, *RIVALS, *OURS]
    found = []
    for folder in given.photos or (given.data / "photo2k",):
        for name, pixels in crops(folder, effort.pictures, effort.photo or 1 << 30):
            for rate in RATES:
                for method in methods:
                    run = partial(_measure, method=method, rate=rate, effort=effort)
                    label = f"{method}, {rate:g}"
                    picture = f"{folder.name} {name}"
                    found.append(Item("compression", picture, label, repr(effort), pixels, run))
    return found


def _labels() -> dict[str, str]:
    from ..peers import codecs

    return {name: codecs()[name].label for name in CODECS}


def _present() -> list[str]:
    """Names of the codecs whose libraries are installed."""
    from ..peers import codecs

    found = []
    for name in CODECS:
        codec = codecs()[name]
        try:
            codec.encode(np.zeros((16, 16, 3), np.uint8), codec.qualities[-1])
        except Exception:  # foreign codecs raise errors of any class where a plug-in is missing
            continue
        found.append(name)
    return found


def _measure(
    pixels: Pixels, earlier: Earlier, *, method: str, rate: float, effort: Effort
) -> list[Row]:
    size = round(rate * pixels.shape[0] * pixels.shape[1] / 8)
    if method in RIVALS:
        from ..rivals import quantized

        code = quantized.coin if method == "COIN" else quantized.splats
        coded = code(pixels, size, effort.most // 2)
        return [_row(method, rate, pixels, coded.shown, coded.size,
                     coded.encoding, coded.decoding)]  # fmt: skip
    if method in OURS:
        return [_ours(pixels, size, method, rate, effort.effort)]
    from ..peers import codecs

    codec = codecs()[method]
    quality = rate if method == "jp2" else _quality(codec, pixels, size)
    started = time.process_time()
    data = codec.encode(pixels, quality)
    middle = time.process_time()
    shown = codec.decode(data)
    spent = middle - started, time.process_time() - middle
    return [_row(codec.label, rate, pixels, shown, len(data), *spent)]


def _quality(codec: Codec, pixels: Pixels, size: int) -> int:
    """Highest whole quality whose file has at most `size` bytes; else the lowest."""
    low, high = (int(q) for q in codec.limits)
    while low < high:
        middle = (low + high + 1) // 2
        if len(codec.encode(pixels, middle)) <= size:
            low = middle
        else:
            high = middle - 1
    return low


def _ours(pixels: Pixels, size: int, method: str, rate: float, effort: int) -> Row:
    from ...api import encode, from_bytes
    from .ours import of_size

    coded = partial(encode, texture="implicit", max_layers=1, jobs=1)
    low, high = IMPLICIT
    for _ in range(TRIES if method == "pxi implicit" else 0):
        middle = (low + high) / 2
        fits = len(coded(pixels, quality=middle, effort=1).to_bytes()) <= size
        low, high = (middle, high) if fits else (low, middle)
    started = time.process_time()
    if method == "pxi implicit":
        data = coded(pixels, quality=low, effort=effort).to_bytes()
    else:
        data = of_size(pixels, size, max_layers=1, effort=effort).to_bytes()
    middle = time.process_time()
    shown = from_bytes(data).render()
    spent = middle - started, time.process_time() - middle
    return _row(method, rate, pixels, shown, len(data), *spent)


def _row(
    method: str, rate: float, pixels: Pixels, shown: Pixels, size: int, encoding: float,
    decoding: float,
) -> Row:  # fmt: skip
    from ..measure import ms_ssim, psnr, ssim

    area = pixels.shape[0] * pixels.shape[1]
    return {
        "rate": f"{rate:g}", "method": method, "bpp": round(8 * size / area, 5),
        "psnr": round(psnr(pixels, shown), 4), "ssim": round(ssim(pixels, shown), 6),
        "ms_ssim": round(ms_ssim(pixels, shown), 6),
        "encoding": round(area / 1e6 / max(encoding, 1e-4), 5),
        "decoding": round(area / 1e6 / max(decoding, 1e-4), 4),
    }  # fmt: skip

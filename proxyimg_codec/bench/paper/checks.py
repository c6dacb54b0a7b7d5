"""Section *checks*: whether our short implementations of rivals reach their published figures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

from .. import rd
from ..summary import published
from .items import Earlier, Effort, Given, Item, Pixels, Row
from .tables import Column, Table, mean

TOLERANCE = 0.7
"""Differences in dB that are tolerated."""

TYPICAL = "kodim22"
"""Picture that is measured if it is but one: JPEG 2000 has its mean PSNR there at 0.16 bpp."""

WHOLE = 24
"""Pictures of the set that published figures are means of."""


@dataclass(frozen=True)
class Check:
    """Published figure of a rival.

    Attributes:
        name: Name of the rival in ``published.json``.
        point: Number of the point there.
        width: Width of a network, or number of Gaussians.
        layers: Layers of a network; 0 for Gaussians.
    """

    name: str
    point: int
    width: int
    layers: int = 0

    @property
    def psnr(self) -> float:
        """Published mean PSNR in dB."""
        curves = {result.name: result.published["PSNR"] for result in published()}
        return curves[self.name][self.point][1]


CHECKS = {
    "COIN, 5 layers of 30": Check("coin", 2, 30, 5),
    "GaussianImage, 800": Check("gaussianimage", 0, 800),
}


def conclusions(rows: Sequence[Row]) -> list[str]:
    """Sentences on whether each rival reaches its published figure."""
    said = []
    for (name,), group in TABLE.grouped(rows).items():
        away = (mean(group, "psnr") or 0.0) - CHECKS[name].psnr
        count = len({r["picture"] for r in group})
        verdict = "within" if abs(away) <= TOLERANCE else "above" if away > 0 else "below"
        few = "" if count == WHOLE else f" (of {count}, where the published figure is of {WHOLE})"
        said.append(f"{name}: {away:+.2f} dB against the published mean{few}, {verdict} ±0.7 dB.")
    return said


TABLE = Table(
    rows=("rival",),
    columns=(
        Column("psnr", "PSNR dB", "{:.2f}"),
        Column("published", "published", "{:.2f}"),
        Column("parameters", "parameters", "{:.0f}"),
        Column("steps", "steps", "{:.0f}"),
        Column("seconds", "CPU s", "{:.1f}"),
    ),
    charted="psnr",
    conclusions=conclusions,
    notes=(
        "Whole Kodak pictures. Sources: EmilienDupont/coin, results.json, at 0.16 bpp; Zhang et "
        "al. 2024 (GaussianImage), 800 Gaussians, read off the published figure.",
        "Authors publish means of the 24; a short run measures one picture, kodim22, on which JPEG "
        "2000 does as well as in the mean at such a rate (by 0.05 dB).",
        "COIN is SIREN with its own sizes, so its figure checks both. Ours are floating point; the "
        "published ones are after quantization, which costs little there.",
        "No figure to compare with is known here for a LIIF-like grid without encoder, a hash grid "
        "of so few parameters, or ten Bézier paths on open pictures.",
    ),
)


def items(given: Given, effort: Effort) -> list[Item]:
    """Items of whole pictures of ``kodak/``: all, or one if few are asked for.

    Raises:
        InputError: The folder is missing, or has no picture.
    """
    files = rd.files_of(given.data / "kodak")
    if effort.pictures < WHOLE:
        files = [p for p in files if p.stem == TYPICAL] or files[:1]
    return [
        Item("checks", path.stem, name, repr(effort), rd.load(path)[..., :3],
             partial(_measure, name=name, check=check, steps=effort.checked))
        for path in files
        for name, check in CHECKS.items()
    ]  # fmt: skip


def _measure(pixels: Pixels, earlier: Earlier, *, name: str, check: Check, steps: int) -> list[Row]:
    from ..rivals import fitting, gaussians, sines

    height, width = pixels.shape[:2]
    make: fitting.Maker = (
        partial(sines.Sines, check.width, check.layers, sines.SIREN_RATE) if check.layers
        else partial(gaussians.Gaussians, gaussians.EACH * check.width, width, height)
    )  # fmt: skip
    found = fitting.fit(make, pixels, steps)
    return [{
        "rival": name, "psnr": round(found.psnr, 4), "published": check.psnr, "steps": steps,
        "parameters": found.parameters, "seconds": round(found.seconds, 2),
    }]  # fmt: skip

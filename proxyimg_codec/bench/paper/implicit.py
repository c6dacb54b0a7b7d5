"""Section *implicit*: ours beside networks, grids and Gaussians with as many parameters."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING

from .items import Earlier, Effort, Given, Item, Pixels, Row
from .pictures import crops
from .tables import Column, Table, mean

if TYPE_CHECKING:
    from ..rivals.fitting import Fitted, Maker

COUNTED = {"SIREN, 3 layers": 3, "SIREN, 5 layers": 5}
"""Hidden layers of the networks whose numbers of parameters all others get."""

BAR = 3.0
"""Lead in dB over networks and Gaussians that direct sampling should have."""

BARRED = ("SIREN", "COIN", "2-D Gaussians")


def conclusions(rows: Sequence[Row]) -> list[str]:
    """Sentences on how far direct sampling is ahead of each rival with as many parameters."""
    said = []
    for (method, kind), group in TABLE.grouped(rows).items():
        if method.startswith("pxi"):
            continue
        five = method == "SIREN, 5 layers"
        lead = _lead(rows, group, five)
        if lead is None:
            continue
        bar = ""
        if method.startswith(BARRED):
            bar = f": {'at least' if lead >= BAR else 'less than'} {BAR:g} dB"
        said.append(f"pxi direct against {method}, {kind}: {lead:+.2f} dB{bar}.")
    own = mean(rows, "codes_at_8")
    if own is not None:
        said.append(f"pxi node: at the paper's own spacing o = 8 there are {own:.0f} codes in the "
                    "mean, not 263.")  # fmt: skip
    return said


def _lead(rows: Sequence[Row], group: Sequence[Row], five: bool) -> float | None:
    """Mean lead in dB of direct sampling over a rival, over the pictures that both have."""
    ours: dict[str, list[float]] = {}
    for row in rows:
        if row["method"] == "pxi direct":
            ours.setdefault(row["picture"], []).append(row["psnr"])
    # The larger of the two budgets comes second, and is that of five layers.
    leads = [ours[r["picture"]][five] - r["psnr"] for r in group
             if len(ours.get(r["picture"], ())) > five]  # fmt: skip
    return sum(leads) / len(leads) if leads else None


TABLE = Table(
    rows=("method", "fit"),
    columns=(
        Column("parameters", "parameters", "{:.0f}"),
        Column("psnr", "PSNR dB", "{:.2f}"),
        Column("ms_ssim", "MS-SSIM", "{:.4f}"),
        Column("steps", "steps", "{:.0f}"),
        Column("seconds", "CPU s", "{:.1f}"),
        Column("bytes", "bytes", "{:.0f}"),
        Column("converged", "converged", "{:.0%}"),
    ),
    charted="psnr",
    conclusions=conclusions,
    paper=(
        {"method": "ProxyImg (paper)", "fit": "", "parameters": 59955, "psnr": 36.99},
        {"method": "SIREN, 3 layers (paper)", "fit": "", "parameters": 50307},
        {"method": "SIREN, 5 layers (paper)", "fit": "", "parameters": 83331},
    ),
    notes=(
        "The paper's pictures are not published, nor is its hardware known here: its figures and "
        "ours are of different data. Of its SIRENs only the numbers of parameters are given.",
        "At SIREN's width of 128 the numbers of parameters are the paper's, 50,307 and 83,331. "
        "Smaller crops get narrower layers in proportion, so that parameters per pixel stay.",
        "Parameters are 32-bit numbers that are fitted; nothing is quantized but the pyramid, "
        "whose file has about one byte for each parameter of SIREN.",
        "Rivals are fitted by Adam on random pixels with cosine decay, twice: *long* doubles "
        "the steps until that gains less than 0.1 dB or a bound is reached (the last column says "
        "for how many pictures it converged), *equal time* gets as many CPU seconds as direct "
        "sampling took. Steps at equal time are measured, so they differ from run to run; with the "
        "same steps all else is the same.",
        "Grids are relatives of ours. The LIIF-like grid has no encoder: codes are fitted.",
        "The network of node sampling has 55,747 parameters whatever the budget; with 263 codes of "
        "16 features that makes the paper's 59,955, but they are not the codes of its own spacing "
        "o = 8. PSNR is of unrounded colours.",
    ),
)  # fmt: skip


def items(given: Given, effort: Effort) -> list[Item]:
    """Items of crops of ``kodak/``.

    Raises:
        InputError: The folder is missing.
    """
    return [
        item
        for name, pixels in crops(given.data / "kodak", effort.pictures, effort.side)
        for item in _of_picture(name, pixels, effort)
    ]


def _of_picture(name: str, pixels: Pixels, effort: Effort) -> list[Item]:
    from ..rivals import sines

    side, width = max(pixels.shape[:2]), effort.width
    found: list[tuple[str, Callable[[Pixels, Earlier], list[Row]]]] = []
    for label, hidden in COUNTED.items():
        count = sines.count(width, hidden + 1)
        ours = f"pxi direct, {hidden}"
        found.append((ours, partial(_direct, parameters=count, steps=effort.direct)))
        found.append(
            (f"pxi pyramid, {hidden}", partial(_pyramid, size=count, effort=effort.effort))
        )
        for rival in (label, *(_OTHERS if hidden == 3 else ())):
            run = partial(_rival, label=rival, parameters=count, width=width, finest=side // 2)
            for converged in (True, False):
                more = {"first": effort.first, "most": effort.most} if converged else {"ours": ours}
                found.append((f"{rival}, {'long' if converged else 'equal'}", partial(run, **more)))
    found.append(("pxi node", partial(_node, steps=effort.node)))
    return [Item("implicit", name, n, repr(effort), pixels, run) for n, run in found]


def row_of(method: str, fit: str, found: Fitted) -> Row:
    """Row of a fit."""
    return {
        "method": method, "fit": fit, "parameters": found.parameters, "psnr": round(found.psnr, 4),
        "ms_ssim": None if math.isnan(found.ms_ssim) else round(found.ms_ssim, 6),
        "steps": found.steps, "seconds": round(found.seconds, 2), "converged": found.converged,
    }  # fmt: skip


def _direct(pixels: Pixels, earlier: Earlier, *, parameters: int, steps: int) -> list[Row]:
    from . import ours

    found = ours.direct(pixels, ours.grid_of(pixels, parameters), steps)
    return [row_of("pxi direct", f"at most {parameters}", found)]


def _node(pixels: Pixels, earlier: Earlier, *, steps: int) -> list[Row]:
    from ...encoder.implicit.node_problem import NodeOptions
    from . import ours

    case = ours.Case("", pixels)
    options = NodeOptions(cell=case.cell_of_the_paper())
    found = ours.node(case.problem(options), steps)
    own = case.codes(NodeOptions().cell)
    return [row_of("pxi node", "about 263 codes", found) | {"codes_at_8": own}]


def _pyramid(pixels: Pixels, earlier: Earlier, *, size: int, effort: int) -> list[Row]:
    from ..measure import ms_ssim, psnr
    from .ours import of_size

    started = time.process_time()
    image = of_size(pixels, size, max_layers=1, effort=effort)
    seconds = time.process_time() - started
    shown = image.render()
    return [{
        "method": "pxi pyramid", "fit": f"about {size} bytes", "bytes": len(image.to_bytes()),
        "psnr": round(psnr(pixels, shown), 4), "ms_ssim": round(ms_ssim(pixels, shown), 6),
        "seconds": round(seconds, 2),
    }]  # fmt: skip


_OTHERS = ("COIN", "LIIF-like grid", "hash grid", "2-D Gaussians")


def maker(label: str, parameters: int, width: int, finest: int, size: Sequence[int]) -> Maker:
    """Maker of a rival.

    Args:
        label: Name of the rival in tables.
        parameters: Most parameters.
        width: Width of SIREN's layers; small networks of grids are half as wide.
        finest: Cells across the finest level of the hash grid.
        size: Height and width of the picture in pixels.
    """
    from ..rivals import gaussians, grids, sines

    if label in COUNTED:
        return partial(sines.siren, width, COUNTED[label])
    others: dict[str, Maker] = {
        "COIN": partial(sines.coin, parameters),
        "LIIF-like grid": partial(grids.LocalGrid, parameters, width // 2),
        "hash grid": partial(grids.HashGrid, parameters, width // 2, finest),
        "2-D Gaussians": partial(gaussians.Gaussians, parameters, size[1], size[0]),
    }
    return others[label]


def _rival(
    pixels: Pixels, earlier: Earlier, *, label: str, parameters: int, width: int, finest: int,
    first: int = 0, most: int = 0, ours: str = "",
) -> list[Row]:  # fmt: skip
    """Row of a rival: fitted until it converges, or for as long as the item `ours` took."""
    from ..rivals import fitting

    make = maker(label, parameters, width, finest, pixels.shape[:2])
    if ours:
        seconds = float(earlier[ours][0]["seconds"])
        return [row_of(label, "equal time", fitting.fit_for(make, pixels, seconds))]
    return [row_of(label, "long", fitting.fit_converged(make, pixels, first, most))]

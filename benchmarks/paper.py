"""The paper's literal texture method beside direct sampling, and its ablations.

    python -m benchmarks.paper DATA [--crops N | --names NAME ...] [--size N] [--steps N]
                                    [--ablations]

DATA is a folder with kodak/ (24 PNG). Crops are the centres of evenly chosen pictures, or of those
named, in layers of the built-in segmenter with Chamfer boundaries.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from benchmarks.common import centre_crop, header, kodak, read_rgb
from benchmarks.figures import FLOAT_GRID
from proxyimg_codec import encode
from proxyimg_codec.bench.paper import ours
from proxyimg_codec.bench.paper.ablations import ABLATIONS, METHOD
from proxyimg_codec.bench.paper.ours import Case
from proxyimg_codec.bench.rivals.fitting import Fitted
from proxyimg_codec.encoder.implicit.node_problem import NodeOptions
from proxyimg_codec.encoder.settings import PRESETS
from proxyimg_codec.io.psnr import psnr_8bit

PAPER_PARAMETERS, PAPER_PSNR = 59955, 36.99
"""Parameters and PSNR in dB that ProxyImg reports, on pictures of its own."""

PROBE = 300
"""Optimizer steps from which the speed of direct fitting is measured."""


def direct(case: Case, seconds: float) -> Fitted:
    """Fits direct sampling for about so many CPU seconds, with as many codes as the figures."""
    spent = ours.direct(case.pixels, FLOAT_GRID, PROBE).seconds
    return ours.direct(case.pixels, FLOAT_GRID, max(round(PROBE * seconds / spent), 1))


def said(fit: Fitted) -> str:
    """Text of a fit."""
    return f"{fit.psnr:6.2f} dB {fit.parameters:7d} parameters {fit.seconds:6.1f} CPU-s"


def table(cases: list[Case], steps: int) -> None:
    """Prints the figure of the paper, and those of node sampling and direct sampling."""
    print(f"\nProxyImg's own: {PAPER_PSNR:6.2f} dB {PAPER_PARAMETERS:7d} parameters, on other "
          "pictures, which are not published")  # fmt: skip
    rows: dict[str, list[Fitted]] = {}
    few = f"literal, about {ours.PAPER_CODES} codes"
    for case in cases:
        literal, enlarged = (
            ours.node(c.problem(NodeOptions(cell=c.cell_of_the_paper())), steps)
            for c in (case, case.enlarged())
        )
        found = {
            few: literal,
            f"{few}, enlarged crop": enlarged,
            "literal, o = 8": ours.node(case.problem(NodeOptions()), steps),
            "direct, as many parameters, as long": direct(case, literal.seconds),
        }
        for name, fit in found.items():
            rows.setdefault(name, []).append(fit)
            print(f"  {case.name} {name:42} {said(fit)}", flush=True)
    for name, fits in rows.items():
        print(f"  mean    {name:42} {np.mean([f.psnr for f in fits]):6.2f} dB")


def files(cases: list[Case]) -> None:
    """Prints figures of whole files, by the preset of the paper and by default."""
    print("\nwhole files, --preset paper (4-bit codes and network) and defaults")
    for case in cases:
        size = case.pixels.shape[0] * case.pixels.shape[1]
        for name, options in (("paper", PRESETS["paper"]), ("default", {})):
            started = time.process_time()
            image = encode(case.pixels, jobs=1, **options)
            seconds = time.process_time() - started
            count = len(image.to_bytes())
            value = psnr_8bit(case.pixels, image.render()) or 99.0
            print(f"  {case.name} {name:8} {value:6.2f} dB {count:6d} bytes "
                  f"{8 * count / size:.3f} bpp {seconds:6.1f} CPU-s", flush=True)  # fmt: skip


def ablations(cases: list[Case], steps: int) -> None:
    """Prints figures of each variant of the method, after equally many steps."""
    print("\nablations, o = 8")
    rows: dict[str, list[Fitted]] = {name: [] for name in ABLATIONS}
    for case in cases:
        for name, options in ABLATIONS.items():
            rows[name].append(ours.node(case.problem(options), steps))
            print(f"  {case.name} {name:26} {said(rows[name][-1])}", flush=True)
    whole = np.mean([f.psnr for f in rows[METHOD]])
    for name, fits in rows.items():
        value = np.mean([f.psnr for f in fits])
        parameters = np.mean([f.parameters for f in fits])
        print(f"  mean    {name:26} {value:6.2f} dB ({value - whole:+.2f}), "
              f"{parameters:.0f} parameters")  # fmt: skip


def run(
    data: Path,
    crops: int = 4,
    names: Sequence[str] | None = None,
    size: int = 256,
    steps: int = 2000,
    parts: bool = True,
) -> None:
    """Prints all figures.

    Args:
        data: Folder with ``kodak/``.
        crops: Number of pictures, chosen evenly.
        names: Names of pictures to use instead.
        size: Side of a crop in pixels.
        steps: Number of optimizer steps.
        parts: Whether to print the ablations too.
    """
    chosen = kodak(data)
    if names:
        chosen = [path for path in chosen if path.stem in names]
    else:
        chosen = chosen[:: 24 // crops][:crops]
    cases = [Case(path.stem, centre_crop(read_rgb(path), size)) for path in chosen]
    print(f"{size}x{size} centre crops of {', '.join(c.name for c in cases)}, {steps} steps")
    table(cases, steps)
    files(cases)
    if parts:
        ablations(cases, steps)


def main() -> None:
    """Runs the command line."""
    p = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    p.add_argument("data", type=Path, help="folder with kodak")
    p.add_argument("--crops", type=int, default=4, help="number of pictures; default 4")
    p.add_argument("--names", nargs="+", metavar="NAME", help="pictures instead, as kodim23")
    p.add_argument("--size", type=int, default=256, help="side of a crop; default 256")
    p.add_argument("--steps", type=int, default=2000, help="optimizer steps; default 2000")
    p.add_argument("--ablations", action="store_true", help="also the ablations")
    args = p.parse_args()
    print(header(args.data))
    run(args.data, args.crops, args.names, args.size, args.steps, args.ablations)


if __name__ == "__main__":
    main()

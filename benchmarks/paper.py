"""The paper's literal texture method beside direct sampling, and its ablations.

    python -m benchmarks.paper DATA [--crops N | --names NAME ...] [--size N] [--steps N]
                                    [--ablations]

DATA is a folder with kodak/ (24 PNG). Crops are the centres of evenly chosen pictures, or of those
named, in layers of the built-in segmenter with Chamfer boundaries.
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np

from benchmarks.common import Pixels, centre_crop, header, kodak, read_rgb
from benchmarks.figures import fit_float
from proxyimg_codec import encode
from proxyimg_codec.encoder.implicit import fit_node, node_problem
from proxyimg_codec.encoder.implicit.fit_problem import Problem, build
from proxyimg_codec.encoder.implicit.node_problem import NodeOptions, NodeProblem
from proxyimg_codec.encoder.settings import PRESETS, Settings
from proxyimg_codec.encoder.shapes.layers import Plan, plan_layers
from proxyimg_codec.encoder.shapes.meshes import with_meshes
from proxyimg_codec.io.psnr import psnr_8bit
from proxyimg_codec.io.samples import to_float
from proxyimg_codec.texture.network import NetShape

PAPER_CODES, PAPER_PARAMETERS, PAPER_PSNR = 263, 59955, 36.99
"""Codes, parameters and PSNR in dB that ProxyImg reports, on pictures of its own."""

SETTINGS = Settings(**PRESETS["paper"], jobs=1)

PROBE = 300
"""Optimizer steps from which the speed of direct fitting is measured."""

EVALUATED = 8192
"""Pixels evaluated at a time."""

ABLATIONS = {
    "edge only": NodeOptions(local="none"),
    "edge + single": NodeOptions(local="single"),
    "edge + multi (the method)": NodeOptions(),
    "multi only": NodeOptions(edge=False),
    "no feature encoding": NodeOptions(octaves=0),
    "inverse distance inside": NodeOptions(distance=True),
    "random code a node": NodeOptions(own_codes=True),
}
"""Variants of node sampling, by description; files cannot store the last two."""


class Fitted(NamedTuple):
    """Result of a fit in floating point.

    Attributes:
        psnr: PSNR in dB of colours that are not rounded; `direct` gives that of rounded ones.
        parameters: Number of parameters.
        seconds: CPU seconds.
    """

    psnr: float
    parameters: int
    seconds: float

    def __str__(self) -> str:
        return f"{self.psnr:6.2f} dB {self.parameters:7d} parameters {self.seconds:6.1f} CPU-s"


@dataclass(frozen=True, eq=False)
class Case:
    """Crop of a picture, with its layers.

    Attributes:
        name: Name of the picture.
        pixels: uint8 [S, S, 3] crop.
    """

    name: str
    pixels: Pixels

    @cached_property
    def plan(self) -> Plan:
        """Plan of the layers, with meshes."""
        picture = to_float(self.pixels)[0]
        return with_meshes(picture, plan_layers(picture, SETTINGS, None), SETTINGS)

    @cached_property
    def start(self) -> Problem:
        """Problem of direct sampling that problems of node sampling start from."""
        outlines = [layer.boundary for layer in self.plan.layers]
        return build(to_float(self.pixels)[0], outlines, NetShape(1, 0, 1, 1, 3), np.inf)

    def problem(self, options: NodeOptions) -> NodeProblem:
        """Makes the problem of node sampling."""
        size = (self.pixels.shape[1], self.pixels.shape[0])
        return node_problem.build(self.start, self.plan.layers, size, options)

    def codes(self, cell: float) -> int:
        """Number of codes of all planes with cells of a side in canvas pixels."""
        layers = zip(self.start.planes, self.plan.layers, strict=True)
        several, options = len(self.plan.layers) > 1, NodeOptions(cell=cell)
        return sum(
            math.prod(options.grid(plane, several and layer.boundary is None))
            for plane, layer in layers
        )

    def enlarged(self) -> Case:
        """Case of the crop at half its size, enlarged again, so that it has no fine detail."""
        size = self.pixels.shape[1::-1]
        small = cv2.resize(self.pixels, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
        return Case(self.name, cv2.resize(small, size, interpolation=cv2.INTER_CUBIC))


def fitted(problem: NodeProblem, steps: int) -> Fitted:
    """Fits a problem of node sampling in floating point."""
    started = time.process_time()
    trainer = fit_node.NodeTrainer(problem, "cpu")
    state = fit_node.fit_float(problem, trainer, steps, 0)
    seconds = time.process_time() - started
    still, total = np.zeros(1, np.float32), 0.0
    pixels = np.arange(problem.pixels, dtype=np.int32)
    for part in np.array_split(pixels, -(-len(pixels) // EVALUATED)):
        total += trainer.run(state, part[None], still, still) * len(part)
    value = -10 * np.log10(total / len(pixels))
    return Fitted(value, state.codes.size + state.weights.size, seconds)


def cell_of_the_paper(case: Case) -> float:
    """Side of cells, in canvas pixels, at which there are about as many codes as in the paper."""
    cells = [float(cell) for cell in np.geomspace(4, 64, 200)]
    return min(cells, key=lambda cell: abs(case.codes(cell) - PAPER_CODES))


def direct(case: Case, seconds: float) -> Fitted:
    """Fits direct sampling for about so many CPU seconds, with `benchmarks.figures.FLOAT_SHAPE`."""
    _, _, spent = fit_float(case.pixels, PROBE)
    return Fitted(*fit_float(case.pixels, max(round(PROBE * seconds / spent), 1)))


def table(cases: list[Case], steps: int) -> None:
    """Prints the figure of the paper, and those of node sampling and direct sampling."""
    print(f"\nProxyImg's own: {PAPER_PSNR:6.2f} dB {PAPER_PARAMETERS:7d} parameters, on other "
          "pictures, which are not published")  # fmt: skip
    rows: dict[str, list[Fitted]] = {}
    few = f"literal, about {PAPER_CODES} codes"
    for case in cases:
        literal, enlarged = (
            fitted(c.problem(NodeOptions(cell=cell_of_the_paper(c))), steps)
            for c in (case, case.enlarged())
        )
        found = {
            few: literal,
            f"{few}, enlarged crop": enlarged,
            "literal, o = 8": fitted(case.problem(NodeOptions()), steps),
            "direct, as many parameters, as long": direct(case, literal.seconds),
        }
        for name, fit in found.items():
            rows.setdefault(name, []).append(fit)
            print(f"  {case.name} {name:42} {fit}", flush=True)
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
            rows[name].append(fitted(case.problem(options), steps))
            print(f"  {case.name} {name:26} {rows[name][-1]}", flush=True)
    whole = np.mean([f.psnr for f in rows["edge + multi (the method)"]])
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

"""Our own representations, fitted in floating point: direct sampling, and the paper's at nodes."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import cv2
import numpy as np

from ...api import Image, encode
from ...encoder.implicit import fit, fit_node, node_problem
from ...encoder.implicit.fit_problem import Problem, build
from ...encoder.implicit.node_problem import NodeOptions, NodeProblem
from ...encoder.implicit.state import State, rows_of
from ...encoder.settings import PRESETS, Settings
from ...encoder.shapes.layers import Plan, plan_layers
from ...encoder.shapes.meshes import with_meshes
from ...errors import UsageError
from ...io.samples import to_float
from ...texture.network import Floats, NetShape, encode_features
from ..measure import ms_ssim, psnr
from ..rivals.fitting import Fitted
from .items import Pixels

SHAPE = NetShape(8, 6, 32, 2, 3)
"""Network of direct sampling."""

PAPER_CODES = 263
"""Codes that ProxyImg reports for its table."""

SETTINGS = Settings(**PRESETS["paper"], jobs=1)

EVALUATED = 8192
"""Pixels evaluated at a time."""


def direct(pixels: Pixels, grid: int, steps: int) -> Fitted:
    """Fits one layer by direct sampling in floating point, without quantization.

    Args:
        pixels: uint8 [H, W, 3] picture.
        grid: Codes along the longer side.
        steps: Number of optimizer steps.
    """
    problem = build(to_float(pixels)[0], [None], SHAPE, max(pixels.shape[:2]) / (grid - 1))
    started = time.process_time()
    trainer = fit.make_trainer(problem, "cpu", 1)
    state = fit.fit_float(problem, trainer, steps, 0)
    seconds = time.process_time() - started
    out = evaluate(problem, state).reshape(pixels.shape)
    shown = np.rint(np.clip(out, 0, 1) * 255).astype(np.uint8)
    count = state.codes.size + state.weights.size
    return Fitted(psnr(pixels, shown), ms_ssim(pixels, shown), count, steps, seconds)


def grid_of(pixels: Pixels, parameters: int) -> int:
    """Codes along the longer side with which direct sampling has at most so many parameters."""
    height, width = pixels.shape[:2]
    grid = 2
    while True:
        spacing = max(height, width) / grid
        columns, rows = (max(round(n / spacing) + 1, 2) for n in (width, height))
        if columns * rows * SHAPE.dim + SHAPE.parameters > parameters:
            return grid
        grid += 1


def evaluate(problem: Problem, state: State) -> Floats:
    """Computes the unquantized output float32 [pixels, 3] of a problem with one layer in numpy."""
    out = []
    for i in range(0, problem.pixels, 1 << 15):
        at = slice(i, i + (1 << 15))
        base, stride = problem.base[at], problem.stride[at]
        fx, fy = problem.fx[at, None], problem.fy[at, None]
        top = state.codes[base] * (1 - fx) + state.codes[base + 1] * fx
        below = state.codes[base + stride] * (1 - fx) + state.codes[base + stride + 1] * fx
        x = encode_features(top * (1 - fy) + below * fy, problem.shape.octaves)
        rows = rows_of(problem.shape, state.weights)
        for k, (weight, bias) in enumerate(rows):
            x = x @ weight.T + bias
            if k + 1 < len(rows):
                x = np.maximum(x, 0)
        out.append(x)
    return np.concatenate(out)


def of_size(pixels: Pixels, size: int, **settings: Any) -> Image:
    """Encodes a pyramid of at most `size` bytes, or the smallest one."""
    settings["jobs"] = 1
    try:
        return encode(pixels, target_size=size, **settings)
    except UsageError:
        return encode(pixels, quality=0, **settings)


@dataclass(frozen=True, eq=False)
class Case:
    """Crop of a picture, with its layers, for node sampling.

    Attributes:
        name: Name of the picture.
        pixels: uint8 [H, W, 3] crop.
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

    def cell_of_the_paper(self) -> float:
        """Side of cells, in canvas pixels, that gives about as many codes as in the paper."""
        cells = [float(cell) for cell in np.geomspace(4, 64, 200)]
        return min(cells, key=lambda cell: abs(self.codes(cell) - PAPER_CODES))

    def enlarged(self) -> Case:
        """Case of the crop at half its size, enlarged again, so that it has no fine detail."""
        size = self.pixels.shape[1::-1]
        small = cv2.resize(self.pixels, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
        grown = cv2.resize(small, size, interpolation=cv2.INTER_CUBIC)
        return Case(self.name, np.asarray(grown, np.uint8))


def node(problem: NodeProblem, steps: int) -> Fitted:
    """Fits node sampling in floating point; PSNR is that of colours that are not rounded."""
    started = time.process_time()
    trainer = fit_node.NodeTrainer(problem, "cpu")
    state = fit_node.fit_float(problem, trainer, steps, 0)
    seconds = time.process_time() - started
    still, total = np.zeros(1, np.float32), 0.0
    pixels = np.arange(problem.pixels, dtype=np.int32)
    for part in np.array_split(pixels, -(-len(pixels) // EVALUATED)):
        total += trainer.run(state, part[None], still, still) * len(part)
    value = float(-10 * np.log10(total / len(pixels)))
    return Fitted(value, math.nan, state.codes.size + state.weights.size, steps, seconds)

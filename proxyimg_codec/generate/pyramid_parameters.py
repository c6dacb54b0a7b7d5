"""Pyramid texture as parameters: latents, not rounded, through the codec's own synthesis."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from ..encoder.completion.membrane import continued_from
from ..encoder.pyramid.encode import CELL, EFFORTS, NUMBER, Raster, encode, levels_for
from ..encoder.pyramid.load import load
from ..encoder.shapes.coverage import coverage_of
from ..geometry.boundary import Boundary
from ..model import Layer
from ..texture.grid import Grid
from ..texture.network import Floats
from ..texture.planes import blocks
from ..texture.pyramid import PyramidTexture
from ..texture.sampling import TAPS, position, weights
from .parameters import Colours, Made, within
from .run import Run
from .scene import Scene

RATE = 5.0
"""Learning rate: how far, in levels of 8 bits, a step of the latents of one level moves samples."""

FINE = 0.75
"""Factor of the learning rate from one level to the next finer one."""

FADING = 0.003
"""Share of the latents, but those of the lowest planes, that fades in a step: what the guide does
not ask for costs bits."""

RIM = 3
"""Samples beyond the outline that get the colours continued, for the interpolating kernel."""

BEYOND = 0.1
"""Weight of errors there."""


class PyramidParameters:
    """Pyramid texture as parameters.

    Args:
        layer: The layer, with a pyramid texture.
        size: Columns and rows of the new raster, which is stretched over the layer's box.
        scene: The points where it is needed.
        canvas: Width and height of the canvas.
        run: Who is told how far the encoder is.
        device: Where it is computed.
    """

    def __init__(
        self, layer: Layer, size: tuple[int, int], scene: Scene, canvas: tuple[int, int], run: Run,
        device: torch.device,
    ) -> None:  # fmt: skip
        texture = layer.texture
        assert isinstance(texture, PyramidTexture)
        self._layer, self._texture, self._size, self._run = layer, texture, size, run
        self._canvas = canvas
        self._step = int(texture.planes.packed["step"])
        self._model = load(NUMBER).to(device)
        self._scale = torch.tensor([2.0 ** (self._step / 64)], device=device)
        self._index, self._weights = _kernel(scene, layer, size, device)
        levels = Grid(size, levels_for(size)).levels
        start = torch.from_numpy(self._old().transpose(2, 0, 1) * np.float32(255))[None].to(device)
        with torch.no_grad():
            found = self._model.analyse(start, self._scale, levels)
        self._latents = [y.clone().requires_grad_() for y in found]

    def _old(self) -> Floats:
        """Old texture at the samples of the new raster, float32 [rows, columns, 3]."""
        columns, rows = self._size
        x0, y0, width, height = self._layer.box
        across = x0 + (np.arange(columns) + 0.5) * (width / columns)
        down = y0 + (np.arange(rows) + 0.5) * (height / rows)
        x, y = (v.ravel() for v in np.meshgrid(across, down))
        found: Floats = self._texture.sample(x, y, self._layer.box)
        if found.shape[1] == 4:
            found[:, :3] /= np.maximum(found[:, 3:], np.float32(1e-3))
        return np.clip(found[:, :3], 0, 1).reshape(rows, columns, 3)

    def groups(self) -> list[dict[str, Any]]:
        """Latents, level by level; see `Parameters`."""
        found = []
        random = torch.Generator().manual_seed(0)
        with torch.no_grad():
            base = self._raster(self._latents)
            for k, own in enumerate(self._latents):
                trial = list(self._latents)
                signs = torch.randint(0, 2, own.shape, generator=random).to(own) * 2 - 1
                trial[k] = own + signs
                moved = float((self._raster(trial) - base).square().mean().sqrt()) * 255
                level = min(k + 1, len(self._latents) - 1)
                slow = FINE ** (len(self._latents) - 1 - level)
                rate = RATE * slow / max(moved, 1e-3)
                fading = FADING / rate if k + 1 < len(self._latents) else 0.0
                found.append({"params": [own], "lr": rate, "weight_decay": fading})
        return found

    def _raster(self, latents: list[Tensor]) -> Tensor:
        """Samples [rows, columns, 3] in about 0..1."""
        columns, rows = self._size
        found = self._model.synthesise(latents, self._scale, (rows, columns))
        return found[0].permute(1, 2, 0) / 255

    def colours(self, share: float) -> Colours:
        """Colours of the points of the scene; see `Parameters`."""
        samples, penalty = within(self._raster(self._latents).reshape(-1, 3))
        if self._weights is None:
            return Colours(samples.index_select(0, self._index[0]), penalty)
        total = torch.zeros((self._index.shape[1], 3), device=samples.device)
        for index, weight in zip(self._index, self._weights, strict=True):
            total = total + samples.index_select(0, index) * weight[:, None]
        return Colours(total.clamp(0, 1), penalty)

    def extra(self) -> dict[str, Any]:
        """Nothing; see `Parameters`."""
        return {}

    def restore(self, extra: dict[str, Any]) -> None:
        """Does nothing; see `Parameters`."""

    def finished(self, effort: int, seed: int) -> Made:
        """Planes of the samples that were seen, which continue beyond; see `Parameters`."""
        columns, rows = self._size
        with torch.no_grad():
            samples = within(self._raster(self._latents))[0].cpu().numpy() * np.float32(255)
        seen = np.zeros((rows, columns), bool)
        seen.reshape(-1)[self._index.cpu().numpy()] = True
        samples = np.where(seen[..., None], samples, continued_from(samples, seen))
        inside = _inside(self._layer.boundary, self._canvas, self._layer.box, self._size) | seen
        cells = blocks(_grown(inside, RIM), CELL)
        weight = np.where(inside, np.float32(1), np.float32(BEYOND))
        samples = np.clip(samples, 0, 255).astype(np.float32)
        whole = self._placed(samples, weight, None if cells.all() else cells)
        length = EFFORTS[effort - 1]
        work = max(whole.samples[..., 0].size * length.turns(whole.structural), 1)
        done = 0

        def tick(samples: int) -> None:
            nonlocal done
            done += samples
            self._run.report("texture", done * 100 // work, 100)

        self._model.to("cpu")
        planes, _ = encode(whole, self._step, length, seed, tick)
        old = self._texture
        if old.alpha is None:
            return Made(PyramidTexture(planes, None, (0, 0, columns, rows)), None)
        view = old if old.cuts is None else old.masked(old.cuts.everything)
        own = PyramidTexture(planes, old.alpha, old.part, view.cell, view.mask)
        return Made(own, None)

    def _placed(self, samples: Floats, weight: Floats, cells: NDArray[np.bool_] | None) -> Raster:
        """Raster to encode; with alpha, as large as that of the alpha is."""
        if self._texture.alpha is None:
            return Raster(samples, weight, cells)
        (columns, rows), (x, y, width, height) = self._texture.alpha.size, self._texture.part
        whole = np.full((rows, columns, 3), 128, np.float32)
        heavy, inside = np.zeros((rows, columns), np.float32), np.zeros((rows, columns), bool)
        at = slice(y, y + height), slice(x, x + width)
        whole[at], heavy[at], inside[at] = samples, weight, True
        support = blocks(inside, CELL)
        return Raster(whole, heavy, None if support.all() else support)


def size_for(layer: Layer, most: int) -> tuple[int, int]:
    """Columns and rows of the new raster of a layer.

    A raster with alpha keeps its size, so that the alpha stays. Others have a sample per canvas
    pixel, but at most `most` along the longer side.
    """
    texture = layer.texture
    assert isinstance(texture, PyramidTexture)
    if texture.alpha is not None:
        return texture.part[2:]
    scale = min(1.0, most / max(layer.box[2:]))
    return max(round(layer.box[2] * scale), 1), max(round(layer.box[3] * scale), 1)


def _kernel(
    scene: Scene, layer: Layer, size: tuple[int, int], device: torch.device
) -> tuple[Tensor, Tensor | None]:
    """Samples and weights of the decoder's interpolation.

    Returns:
        int64 [T, n] numbers of samples, and float32 [T, n] their weights; one sample without a
        weight for each point if all points lie on samples.
    """
    column, fx = position(scene.x, layer.box[0], layer.box[2], size[0])
    row, fy = position(scene.y, layer.box[1], layer.box[3], size[1])
    if not (fx.any() or fy.any()):
        return torch.from_numpy((row * size[0] + column)[None]).to(device), None
    across, down = weights(fx), weights(fy)
    index, shares = [], []
    for j in range(TAPS):
        y = np.clip(row + j - 1, 0, size[1] - 1)
        for i in range(TAPS):
            index.append(y * size[0] + np.clip(column + i - 1, 0, size[0] - 1))
            shares.append(across[i] * down[j])
    kernel = torch.from_numpy(np.stack(shares).astype(np.float32)).to(device)
    return torch.from_numpy(np.stack(index)).to(device), kernel


def _inside(
    boundary: Boundary | None, canvas: tuple[int, int], box: tuple[int, int, int, int],
    size: tuple[int, int],
) -> NDArray[np.bool_]:  # fmt: skip
    """Samples, bool [rows, columns], that lie in the boundary at rest."""
    width, height = canvas
    covered = coverage_of(boundary, width, height).reshape(height, width) > 0
    x = np.clip(box[0] + (np.arange(size[0]) * box[2]) // size[0], 0, width - 1)
    y = np.clip(box[1] + (np.arange(size[1]) * box[3]) // size[1], 0, height - 1)
    return np.asarray(covered[y[:, None], x])


def _grown(mask: NDArray[np.bool_], by: int) -> NDArray[np.bool_]:
    """Mask with all samples that lie at most `by` rows and columns away."""
    for axis in (0, 1):
        wide = np.pad(mask, [(by, by) if k == axis else (0, 0) for k in (0, 1)])
        n = mask.shape[axis]
        mask = np.logical_or.reduce([wide.take(range(k, k + n), axis) for k in range(2 * by + 1)])
    return mask

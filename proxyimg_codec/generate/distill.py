"""Distillation: a guide's gradients, through a scene, change the texture of a layer."""

from __future__ import annotations

import hashlib
import json
import logging
import math
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from ..codec.write import state
from ..errors import InputError, UsageError
from ..io import raster
from ..model import Layer, Picture
from ..texture.implicit import ImplicitTexture
from .crops import crops
from .find_guide import guide_for
from .guide import Batch, Guide, Wishes, device_of
from .implicit_parameters import ImplicitParameters
from .parameters import Made, Parameters
from .pyramid_parameters import PyramidParameters, size_for
from .run import SAVE_EVERY, Run
from .scene import Scene, scene_of
from .settings import Settings

BATCH = 4
"""Crops that are judged in a step."""

DETAIL, DETAIL_LEAST = 2, 512
"""Most pixels of a scene along a side: so many times those that the guide sees, or this many."""

WARM_UP = 0.03
"""Share of the steps in which the learning rate rises."""

KIND = "proxyimg distillation 1"
"""Mark of a file that holds the state of a distillation."""

STRUCTURE = 100.0
"""Weight of the squared change of slopes, times the weight that the settings give."""

LOG = logging.getLogger(__name__)


def generated(picture: Picture, layer: Layer, settings: Settings, run: Run) -> Made:
    """Makes a new texture for a layer.

    Args:
        picture: The picture.
        layer: A layer of it.
        settings: What the texture should be.
        run: Where it is computed, and who watches.

    Raises:
        UsageError: The layer, the guide or the prompt cannot be used.
        InputError: A model or a file to go on from is wrong.
        UnsupportedError: A package or device is not there.
        LimitError: There is not enough memory, or drawing takes too much work.
    """
    if layer.sampling:
        raise UsageError(
            f"generate: layer {layer.name!r} has its features at its nodes, which cannot "
            "learn from pixels; give it a texture of its own first"
        )
    if run.resume is not None and run.resume.is_dir():
        raise UsageError(f"generate: {run.resume} is a folder, not a file to go on from")
    guide = guide_for(Wishes(settings, run))
    side = settings.resolution or guide.side
    scene = scene_of(picture, layer, max(DETAIL * side, DETAIL_LEAST))
    device = device_of(run)
    scene = scene.to(device)
    parameters = parameters_of(picture, layer, scene, max(DETAIL * side, DETAIL_LEAST), run, device)
    work = Distillation(parameters, scene, guide, settings, run)
    work.go(_digest(picture, layer, settings))
    return parameters.finished(settings.effort, settings.seed)


def parameters_of(
    picture: Picture, layer: Layer, scene: Scene, most: int, run: Run, device: torch.device
) -> Parameters:
    """Parameters of the texture of a layer.

    Args:
        picture: The picture.
        layer: A layer of it, without node sampling.
        scene: Scene of the layer.
        most: Most samples of a new raster along a side.
        run: Who is told how far the encoder is.
        device: Where they are computed.
    """
    texture = layer.texture
    if isinstance(texture, ImplicitTexture):
        network = picture.network_of(layer)
        assert network is not None, "an implicit texture has a network"
        return ImplicitParameters(texture, network, layer.box, scene, device)
    return PyramidParameters(layer, size_for(layer, most), scene, picture.size, run, device)


class Distillation:
    """Optimization of a texture.

    Args:
        parameters: The texture.
        scene: Its scene.
        guide: The guide.
        settings: Its settings.
        run: Who watches.

    Attributes:
        step: Steps that are done.
        losses: Mean loss of each step of this run.
    """

    def __init__(
        self, parameters: Parameters, scene: Scene, guide: Guide, settings: Settings, run: Run
    ) -> None:
        self._parameters, self._scene, self._guide = parameters, scene, guide
        self._settings, self._run = settings, run
        self._side = settings.resolution or guide.side
        self._adam = torch.optim.AdamW(parameters.groups(), betas=(0.9, 0.99), weight_decay=0.0)
        self._rates = [group["lr"] for group in self._adam.param_groups]
        self._random = torch.Generator().manual_seed(settings.seed)
        self.step, self.losses = 0, list[float]()
        self._slopes = _slopes(self.image().detach()) if settings.keep_structure else None

    def image(self) -> Tensor:
        """Scene [3, h, w] with the present texture."""
        colours = self._parameters.colours(self.step / self._settings.steps).straight
        return self._scene.image(colours)

    def go(self, digest: str) -> None:
        """Does all steps that are left; an interruption ends them, and what was made stays.

        Args:
            digest: What the state belongs to, for the file to go on from.

        Raises:
            InputError: The file to go on from is of something else, or cannot be read or written.
        """
        steps, run = self._settings.steps, self._run
        if run.resume is not None and run.resume.exists():
            self._restore(run.resume, digest)
        try:
            while self.step < steps:
                self._advance()
                run.report("generate", self.step, steps)
                if run.previews is not None and self.step % run.every == 0:
                    self._show(run.previews)
                if run.resume is not None and self.step % SAVE_EVERY == 0:
                    self._keep(run.resume, digest)
        except KeyboardInterrupt:
            LOG.warning("interrupted after %d of %d steps; what was made stays", self.step, steps)
        if run.resume is not None:
            self._keep(run.resume, digest)
        if self._guide.retries:
            LOG.warning(
                "%d of %d steps were not finite in half precision, and were done in full",
                self._guide.retries, self.step,
            )  # fmt: skip

    def _advance(self) -> None:
        """Does one step."""
        settings, scene = self._settings, self._scene
        share = self.step / settings.steps
        for group, rate in zip(self._adam.param_groups, self._rates, strict=True):
            warm = min(1.0, (self.step + 1) / (WARM_UP * settings.steps + 1))
            group["lr"] = rate * warm * (0.5 + 0.5 * math.cos(math.pi * share))
        colours = self._parameters.colours(share)
        image = scene.image(colours.straight)
        views, shown = crops(image, scene, BATCH, self._side, self._random)
        low, high = settings.times
        times = low + (high - low) * torch.rand(BATCH, generator=self._random).to(image)
        judged = self._guide.judge(Batch(views.detach(), times, shown, self._random))
        gradient = judged.gradient
        if settings.clip is not None:
            norms = gradient.square().mean((1, 2, 3), keepdim=True).sqrt()
            gradient = gradient * (settings.clip / norms.clamp_min(settings.clip))
        loss = (gradient * views).sum() / BATCH + colours.penalty
        if self._slopes is not None:
            loss = loss + settings.keep_structure * STRUCTURE * self._bent(image)
        self._adam.zero_grad(set_to_none=True)
        loss.backward()  # type: ignore[no-untyped-call] # torch's
        self._adam.step()
        self.step += 1
        self.losses.append(float(judged.loss.mean()))

    def _bent(self, image: Tensor) -> Tensor:
        """Squared change of the slopes of the luminance, where the layer shows."""
        assert self._slopes is not None
        total = image.sum() * 0
        for axis, (new, old) in enumerate(zip(_slopes(image), self._slopes, strict=True)):
            n = self._scene.share.shape[axis] - 1
            weight = self._scene.share.narrow(axis, 0, n) * self._scene.share.narrow(axis, 1, n)
            total = total + (weight * (new - old) ** 2).sum()
        return total

    def _show(self, folder: Path) -> None:
        """Writes a preview."""
        with torch.no_grad():
            pixels = self.image().clamp(0, 1).cpu().numpy().transpose(1, 2, 0)
        folder.mkdir(parents=True, exist_ok=True)
        name = folder / f"step-{self.step:05d}.png"
        raster.write(str(name), np.rint(pixels * 255).astype(np.uint8))

    def _keep(self, path: Path, digest: str) -> None:
        """Writes the state to a file."""
        values = {
            "kind": KIND, "digest": digest, "step": self.step, "random": self._random.get_state(),
            "parameters": [p.detach() for g in self._adam.param_groups for p in g["params"]],
            "optimizer": self._adam.state_dict(), "extra": self._parameters.extra(),
        }  # fmt: skip
        unfinished = path.with_name(path.name + ".part")
        try:
            torch.save(values, unfinished)
            unfinished.replace(path)
        except (OSError, RuntimeError) as error:
            raise InputError(f"{path}: cannot be written: {error}") from None

    def _restore(self, path: Path, digest: str) -> None:
        """Takes the state from a file.

        Raises:
            InputError: It is no such file, or one of another picture or of other settings.
        """
        try:
            values: Any = torch.load(path, map_location="cpu", weights_only=True)
        except Exception:  # torch tells a file that it cannot read by errors of many kinds
            values = None
        if not isinstance(values, Mapping) or values.get("kind") != KIND:
            raise InputError(f"{path}: is no file to go on from")
        if values["digest"] != digest:
            raise InputError(
                f"{path}: belongs to another picture, layer or other settings; remove it or give "
                "those again"
            )
        own = [p for g in self._adam.param_groups for p in g["params"]]
        with torch.no_grad():
            for mine, kept in zip(own, values["parameters"], strict=True):
                mine.copy_(kept)
        self._adam.load_state_dict(values["optimizer"])
        self._random.set_state(values["random"])
        self._parameters.restore(values["extra"])
        self.step = int(values["step"])


def _slopes(image: Tensor) -> tuple[Tensor, Tensor]:
    """Differences of luminance (mean of the colours) of neighbours, down and across."""
    light = image.mean(0)
    return light[1:] - light[:-1], light[:, 1:] - light[:, :-1]


def _digest(picture: Picture, layer: Layer, settings: Settings) -> str:
    """Digest of everything that the state of a distillation depends on."""
    found = hashlib.sha256()
    for chunk in state(picture):
        found.update(chunk.type.encode() + len(chunk.payload).to_bytes(8, "little"))
        found.update(chunk.payload)
    found.update(json.dumps([layer.name, asdict(settings)]).encode())
    return found.hexdigest()

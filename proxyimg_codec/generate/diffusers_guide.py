"""Score distillation with latent diffusion models, from pipelines of the package diffusers.

Any pipeline with a VAE, a UNet, a scheduler and text encoders does: Stable Diffusion 1, 2 and XL.
Text encoders say once what the prompts mean, and are freed. In each step the VAE encodes pictures,
the UNet finds the noise in them, and the VAE's derivative takes the difference back to pixels, for
one picture after the other; so memory does not depend on how many there are.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn

from ..errors import InputError, UnsupportedError, UsageError
from .guide import INDEX, Batch, Judged, Wishes, device_of
from .precision import TYPES, Careful

GUIDANCE = 30.0
"""Guidance where the settings have none; latent models need more of it (Poole 2022: 100)."""

PARTS = ("vae", "unet", "scheduler", "text_encoder", "tokenizer")
"""Parts that a pipeline must have."""


@dataclass(frozen=True)
class Words:
    """Prompts as the UNet gets them.

    Attributes:
        states: [2, tokens, D] hidden states of what is not wanted and of what is.
        added: More conditions of the UNet, [2, ...] each; None for none.
    """

    states: Tensor
    added: Mapping[str, Tensor] | None = None


class LatentGuide:
    """Score distillation (Poole 2022, "DreamFusion", equation 3) in the latent space of a VAE.

    Args:
        vae: VAE of diffusers.
        unet: Conditional UNet of diffusers.
        scheduler: Scheduler of diffusers; only its noise is used.
        words: The prompts.
        guidance: Factor of the difference that the prompt makes.
        weighting: ``sds`` or ``uniform``.
        kind: Type of the weights.
        device: Where they are used.
        offload: Whether VAE and UNet wait in the memory of the CPU for each other.
    """

    def __init__(
        self, vae: Any, unet: Any, scheduler: Any, words: Words, guidance: float = GUIDANCE,
        weighting: str = "sds", kind: torch.dtype = torch.float32,
        device: torch.device | None = None, offload: bool = False,
    ) -> None:  # fmt: skip
        self._vae, self._unet, self._words = vae, unet, words
        self._guidance, self._weighting, self._offload = guidance, weighting, offload
        self._device = device or torch.device("cpu")
        # Some VAEs overflow in half precision, and say so.
        fragile = bool(getattr(vae.config, "force_upcast", False)) and kind == torch.float16
        modules = [unet] if fragile else [vae, unet]
        for module in (vae, unet):
            module.eval().requires_grad_(False)
            module.to("cpu" if offload else self._device)
        self._vae_kind = torch.float32 if fragile else None
        if fragile:
            vae.to(torch.float32)
        self._careful = Careful(modules, kind)
        self._shares = scheduler.alphas_cumprod.double()
        self._predicts = scheduler.config.prediction_type
        self._reduction = 2 ** (len(vae.config.block_out_channels) - 1)
        self._unit = self._reduction * 2 ** (len(unet.config.block_out_channels) - 1)

    @property
    def side(self) -> int:
        """Rows and columns of the pictures that the UNet was trained on."""
        return int(self._unet.config.sample_size * self._reduction)

    @property
    def retries(self) -> int:
        """Number of times that half precision was not enough."""
        return self._careful.count

    def judge(self, batch: Batch) -> Judged:
        """Gradient of score distillation, and mean squared error of the noise with the prompt.

        Raises:
            UsageError: The pictures have a size that the model cannot work with.
        """
        side = batch.images.shape[2]
        if side % self._unit:
            raise UsageError(f"generate: resolution {side} must be a multiple of {self._unit}")
        count = len(self._shares)
        steps = (batch.times.double() * count).long().clamp(0, count - 1)
        small, channels = side // self._reduction, self._vae.config.latent_channels
        kind = torch.float64 if batch.images.dtype == torch.float64 else torch.float32
        noise = torch.randn(
            (len(batch.images), channels, small, small), generator=batch.random, dtype=kind
        )

        def attempt(kind: torch.dtype) -> tuple[Tensor, Tensor]:
            return self._judged(batch.images.detach(), steps.cpu(), noise, kind)

        return Judged(*self._careful(attempt))

    def _judged(
        self, images: Tensor, steps: Tensor, noise: Tensor, kind: torch.dtype
    ) -> tuple[Tensor, Tensor]:
        """Gradients and losses, as `Judged` has them, by numbers of a type."""
        noise = noise.to(images)
        with self._present(self._vae), torch.no_grad():
            latents = [self._encoded(image[None], kind) for image in images]
        towards, losses = [], []
        with self._present(self._unet), torch.no_grad():
            for latent, e, step in zip(latents, noise, steps, strict=True):
                share = self._shares[step]
                a, s = float(share.sqrt()), float((1 - share).sqrt())
                noisy = a * latent + s * e[None]
                plain, wanted = self._noise(noisy, step, a, s, kind)
                found = plain + self._guidance * (wanted - plain)
                weight = s**2 if self._weighting == "sds" else 1.0
                towards.append(weight * (found - e))
                losses.append(((wanted - e) ** 2).mean())
        gradients = []
        with self._present(self._vae):
            for image, goal in zip(images, towards, strict=True):
                free = image[None].clone().requires_grad_()
                (found,) = torch.autograd.grad(self._encoded(free, kind), free, goal[None])
                gradients.append(found[0])
        return torch.stack(gradients), torch.stack(losses)

    def _encoded(self, image: Tensor, kind: torch.dtype) -> Tensor:
        """Latents [1, C, h, w] of a picture [1, 3, S, S] in 0..1: the mean that the VAE gives."""
        config = self._vae.config
        pixels = (2 * image - 1).to(self._vae_kind or kind)
        found: Tensor = self._vae.encode(pixels).latent_dist.mode().to(image)
        latents: Tensor = (found - (config.get("shift_factor") or 0)) * config.scaling_factor
        return latents

    def _noise(
        self, noisy: Tensor, step: Tensor, a: float, s: float, kind: torch.dtype
    ) -> tuple[Tensor, Tensor]:
        """Noise [C, h, w] that the UNet finds without and with the prompt."""
        to = {"device": noisy.device, "dtype": kind}
        more: dict[str, Any] = {}
        if self._words.added is not None:
            conditions = {k: v.to(**to) for k, v in self._words.added.items()}  # type: ignore[call-overload] # keywords
            more["added_cond_kwargs"] = conditions
        twice = noisy.expand(2, -1, -1, -1)
        out = self._unet(
            twice.to(kind), step.to(noisy.device),
            encoder_hidden_states=self._words.states.to(**to), **more,  # type: ignore[call-overload] # keywords
        ).sample.to(noisy)  # fmt: skip
        if self._predicts == "v_prediction":
            out = a * out + s * twice
        elif self._predicts == "sample":
            out = (twice - a * out) / s
        return out[0], out[1]

    @contextmanager
    def _present(self, module: nn.Module) -> Iterator[None]:
        """Brings a module to the device while it lasts, if modules wait elsewhere."""
        if self._offload:
            module.to(self._device)
        try:
            yield
        finally:
            if self._offload:
                module.to("cpu")


def pipeline_guide(path: Path, wishes: Wishes) -> LatentGuide:
    """Guide of a folder of a pipeline.

    Raises:
        InputError: The folder is damaged, or its pipeline lacks a part.
        UnsupportedError: diffusers or transformers is not installed, or the device is not there.
    """
    index = _index(path)
    settings, device = wishes.settings, device_of(wishes.run)
    kind = TYPES[settings.precision]
    try:
        from diffusers import DDPMScheduler, DiffusionPipeline
    except ImportError as error:
        raise UnsupportedError(
            f"a pipeline as guide needs {error.name or 'diffusers'}: "
            "pip install 'proxyimg-codec[generate]'"
        ) from None
    unused: dict[str, Any] = {k: None for k in ("safety_checker", "image_encoder") if k in index}
    try:
        with _silent():
            pipe = DiffusionPipeline.from_pretrained(
                path, dtype=kind, local_files_only=True, **unused
            )
        words = _words(pipe, settings.prompt, settings.negative)
        scheduler = DDPMScheduler.from_config(pipe.scheduler.config)
        vae, unet = pipe.vae, pipe.unet
    except (OSError, ValueError, RuntimeError, KeyError, TypeError, AttributeError) as error:
        said = str(error).strip().splitlines() or [type(error).__name__]
        raise InputError(f"{path}: cannot be used as a pipeline: {said[0]}") from None
    del pipe  # and the text encoders with it
    if unet.config.in_channels != vae.config.latent_channels:
        raise InputError(
            f"{path}: its UNet takes {unet.config.in_channels} planes and the VAE gives "
            f"{vae.config.latent_channels}; models that fill holes or enlarge cannot be used"
        )
    guidance = GUIDANCE if settings.guidance is None else settings.guidance
    return LatentGuide(
        vae, unet, scheduler, words, guidance, settings.weighting, kind, device, wishes.run.offload
    )


@contextmanager
def _silent() -> Iterator[None]:
    """Keeps the packages from drawing progress bars, and from giving advice, while it lasts."""
    from diffusers.utils import logging as first
    from transformers.utils import logging as second

    before = [(log, log.get_verbosity(), log.is_progress_bar_enabled()) for log in (first, second)]
    for log, _, _ in before:
        log.set_verbosity_error()
        log.disable_progress_bar()
    try:
        yield
    finally:
        for log, verbosity, bar in before:
            log.set_verbosity(verbosity)
            if bar:
                log.enable_progress_bar()


def _index(path: Path) -> Mapping[str, Any]:
    """Parts of a pipeline by name.

    Raises:
        InputError: The index cannot be read, or a part is missing.
    """
    try:
        index = json.loads((path / INDEX).read_text("utf-8"))
    except (OSError, ValueError):
        index = None
    if not isinstance(index, dict):
        raise InputError(f"{path}: its {INDEX} cannot be read")
    lacking = [name for name in PARTS if not (index.get(name) or [None])[0]]
    if lacking:
        kind = index.get("_class_name", "pipeline")
        raise InputError(f"{path}: this {kind} has no {', '.join(lacking)}, which a guide needs")
    return index


@torch.no_grad()
def _words(pipe: Any, prompt: str, negative: str) -> Words:
    """Prompts as text encoders of a pipeline understand them."""
    found = pipe.encode_prompt(
        prompt=prompt, device="cpu", num_images_per_prompt=1, do_classifier_free_guidance=True,
        negative_prompt=negative,
    )  # fmt: skip
    states = torch.cat([found[1], found[0]])
    if len(found) == 2:
        return Words(states)
    side = pipe.unet.config.sample_size * pipe.vae_scale_factor
    sizes = torch.tensor([[side, side, 0, 0, side, side]] * 2).to(states)
    return Words(states, {"text_embeds": torch.cat([found[3], found[2]]), "time_ids": sizes})

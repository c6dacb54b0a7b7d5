"""Registered model in torch: the weights of the decoder, and the analysis of the encoder."""

from __future__ import annotations

import functools
from importlib import resources

import numpy as np
import torch
from torch import Tensor

from ...texture import registered_model as registry
from .model import Model


@functools.lru_cache(maxsize=2)
def load(number: int) -> Model:
    """Loads the registered model of a number, with exactly the weights of the decoder.

    Its activations are not rounded to integers as those of the decoder are: refinement does not
    gain from that.

    Raises:
        UnsupportedError: There is no such model.
    """
    stored = registry.registered(number)
    width = len(stored.context[0].mix.values)
    model = Model(len(stored.synthesis[0].second.values), width)
    state: dict[str, Tensor] = {"to_colour": _tensor(stored.to_colour)}
    for k, (context, synthesis) in enumerate(zip(stored.context, stored.synthesis, strict=True)):
        own = {"gain": _tensor(synthesis.gain), "gain_by_step": _tensor(synthesis.gain_by_step)}
        own["synthesis_delta"] = _tensor(synthesis.delta)
        for name in ("first", "second", "third"):
            weights = _tensor(getattr(synthesis, name))
            own[f"synthesis.{name}.weight"] = weights.reshape(*weights.shape[:2], *_sides(weights))
            own[f"synthesis.{name}.bias"] = _tensor(getattr(synthesis, f"{name}_bias"))
        own["synthesis.by_step"] = _tensor(synthesis.first_by_step)
        for name in ("first", "second", "mix", "luma", "from_luma", "chroma"):
            weights = _tensor(getattr(context, name))
            own[f"{name}.weight"] = weights.reshape(*weights.shape[:2], *_sides(weights))
            own[f"{name}.bias"] = _tensor(getattr(context, f"{name}_bias"))
        own["first_by_step"] = _tensor(context.first_by_step) * 128
        causal = torch.zeros(width, 18, 3, 5)
        taps = _tensor(context.causal)
        for i, (dy, dx) in enumerate(registry.CAUSAL):
            causal[:, :, dy + 2, dx + 2] = taps[:, :, i]
        own["causal"] = causal
        state |= {f"levels.{k}.{name}": value for name, value in own.items()}
    name = f"{registry.registration(number).file}-analysis.npz"
    file = resources.files("proxyimg_codec.models").joinpath(name)
    with file.open("rb") as stream, np.load(stream) as analysis:
        state |= {k: torch.from_numpy(v.astype(np.float32)) for k, v in analysis.items()}
    model.load_state_dict(state)
    model.requires_grad_(False)
    model.set_mode(fast=native_bfloat16())
    model.to(memory_format=torch.channels_last)  # type: ignore[call-overload]  # not in torch's stubs
    return model


def native_bfloat16() -> bool:
    """Whether the processor multiplies in bfloat16; others take longer than in float32."""
    if not hasattr(torch.cpu, "get_capabilities"):  # older torch
        return False
    has = torch.cpu.get_capabilities()
    return bool(has.get("avx512_bf16") or has.get("amx_bf16"))


def _tensor(array: registry.Array) -> Tensor:
    return torch.from_numpy(array.floats.copy())


def _sides(weights: Tensor) -> tuple[int, ...]:
    """Kernel size of convolution weights; matrices are 1 x 1 kernels."""
    return tuple(weights.shape[2:]) or (1, 1)

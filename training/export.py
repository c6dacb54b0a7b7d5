"""Writes the registered model file and the analysis: python -m training.export STATE.pt OUT."""

from __future__ import annotations

import argparse
import hashlib
import math
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from proxyimg_codec.encoder.pyramid.convolutions import weight_step
from proxyimg_codec.encoder.pyramid.model import Model
from proxyimg_codec.texture.registered_model import CAUSAL, LEVEL_SETS, Array, pack


def fixed(values: Tensor | None, exponent: int) -> Array:
    """Rounds a tensor to an array of integers in units of 2**exponent."""
    assert values is not None
    scaled = np.rint(values.detach().double().numpy() * 2.0**-exponent)
    return Array(scaled.astype(np.int32), exponent)


def weights(values: Tensor) -> Array:
    """Rounds weights to 8-bit integers, in the unit that training simulates."""
    return fixed(values, round(math.log2(weight_step(values))))


def small(values: Tensor) -> Array:
    """Rounds weights to 8-bit integers, in the smallest power of two that fits."""
    most = max(float(values.detach().abs().max()), 1e-6)
    return fixed(values, math.ceil(math.log2(most / 127)))


def arrays_of(model: Model) -> dict[str, Array]:
    """Arrays of the registered model, by their names in the file."""
    out = {"to_colour": fixed(model.to_colour, -16)}
    for number in range(LEVEL_SETS):
        level = model.level(number + 1)
        taps = torch.stack([level.causal[:, :, dy + 2, dx + 2] for dy, dx in CAUSAL], 2)
        context = {
            "first": level.first, "second": level.second, "mix": level.mix, "luma": level.luma,
            "from_luma": level.from_luma, "chroma": level.chroma,
        }  # fmt: skip
        own = {"causal": weights(taps)}
        for name, conv in context.items():
            unit = weights(conv.weight)
            flat = unit.values if name in ("first", "second") else unit.values[:, :, 0, 0]
            own[name] = Array(flat, unit.exponent)
            own[f"{name}_bias"] = fixed(conv.bias, unit.exponent - 5)
        own["first_by_step"] = fixed(level.first_by_step / 128, own["first"].exponent - 5 - 8)
        out |= {f"context {number} {k}": v for k, v in own.items()}
        net = level.synthesis
        own = {
            "delta": small(level.synthesis_delta),
            "gain": fixed(level.gain, -12),
            "gain_by_step": fixed(level.gain_by_step, -12),
            "first": small(net.first.weight), "first_bias": fixed(net.first.bias, -16),
            "first_by_step": fixed(net.by_step, -16),
            "second": small(net.second.weight), "second_bias": fixed(net.second.bias, -16),
            "third": small(net.third.weight), "third_bias": fixed(net.third.bias, -16),
        }  # fmt: skip
        own["second"] = Array(own["second"].values[:, :, 0, 0], own["second"].exponent)
        out |= {f"synthesis {number} {k}": v for k, v in own.items()}
    return out


def main() -> None:
    """Runs the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("state", type=Path)
    parser.add_argument("out", type=Path, help="folder: pyramid-1.bin and pyramid-1-analysis.npz")
    args = parser.parse_args()
    model = Model()
    model.load_state_dict(torch.load(args.state)["average"])
    data = pack(arrays_of(model), *model.sizes)
    (args.out / "pyramid-1.bin").write_bytes(data)
    own = {k: v for k, v in model.state_dict().items() if "analysis" in k or k == "to_planes"}
    np.savez(args.out / "pyramid-1-analysis.npz",
             **{k: v.numpy().astype(np.float16) for k, v in own.items()})  # fmt: skip
    print(f"{len(data)} bytes, SHA-256 {hashlib.sha256(data).hexdigest()}")


if __name__ == "__main__":
    main()

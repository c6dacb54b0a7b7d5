"""Writes weights of the next model as integers: python -m training.export_wider STATE.pt OUT."""

from __future__ import annotations

import argparse
import hashlib
import struct
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import torch

from proxyimg_codec.encoder.pyramid.load import load as load_model
from proxyimg_codec.texture.registered_model import CAUSAL, WIDE, Array

from .export import fixed, small, weights
from .structures import Context, Layer, Synthesis, layers
from .wider import WiderLevel, WiderModel

MAGIC = b"PXIMODL2"

EXACT = 1 << 24
"""Bound of the sums of the context network, which are exact in float32."""


def arrays_of(model: WiderModel) -> Iterator[tuple[str, Array]]:
    """Yields names and arrays of a model in the order of the file.

    Raises:
        ValueError: A sum of the context network might reach 2**24.
    """
    yield "to_colour", fixed(model.to_colour, -16)
    for number, level in enumerate(model.levels):
        assert isinstance(level, WiderLevel)
        for name, array in context_of(level.context):
            yield f"context {number} {name}", array
        yield f"synthesis {number} delta", small(level.synthesis_delta)
        yield f"synthesis {number} gain", fixed(level.gain, -12)
        yield f"synthesis {number} gain_by_step", fixed(level.gain_by_step, -12)
        for name, array in synthesis_of(level.wider):
            yield f"synthesis {number} {name}", array


def context_of(net: Context) -> Iterator[tuple[str, Array]]:
    """Yields names and arrays of a context network; units are those of `registered_model`."""
    (past,) = net.causal
    s = net.structure
    taps = torch.stack([past[:, :, dy + s.rows, dx + s.reach] for dy, dx in CAUSAL], 2)
    for name, layer in named(net):
        unit = weights(layer.weight)
        values = unit.values if layer.weight.shape[2] > 1 else unit.values[:, :, 0, 0]
        bias = fixed(layer.bias, unit.exponent - 5)
        most = 255 * np.abs(values).reshape(len(values), -1).sum(1) + np.abs(bias.values)
        if most.max() >= EXACT:
            raise ValueError(f"sums of layer {name} might reach {most.max()}")
        yield name, Array(values, unit.exponent)
        yield f"{name}_bias", bias
        if name == "first":
            yield "first_by_step", fixed(net.first_by_step / 128, unit.exponent - 5 - 8)
        if name == "second":
            yield "causal", weights(taps)


def named(net: Context) -> Iterator[tuple[str, Layer]]:
    """Yields names and layers of a context network in the order in which they are used."""
    yield from (("first", net.first), ("second", net.second))
    for name, found in (("mix", net.mixes), ("out", net.out), ("back", net.back)):
        yield from ((f"{name}{i}", layer) for i, layer in enumerate(layers(found)))


def synthesis_of(net: Synthesis) -> Iterator[tuple[str, Array]]:
    """Yields names and arrays of the network of a synthesis."""
    for name, layer in (("first", net.first), ("second", net.second), ("third", net.third)):
        yield name, small(layer.weight)
        yield f"{name}_bias", fixed(layer.bias, -16)
    yield "first_by_step", fixed(net.by_step, -16)


def pack(model: WiderModel) -> bytes:
    """Packs a model: sizes of each level, then each array as its exponent and its values."""
    out = [MAGIC]
    for level in model.levels:
        assert isinstance(level, WiderLevel)
        s = level.context.structure
        out.append(struct.pack("<HHH", s.ahead or s.width, s.width, len(level.wider.by_step)))
    for name, (values, exponent) in arrays_of(model):
        kind = "<i4" if any(w in name for w in WIDE) else "<i1"
        assert (values == values.astype(kind)).all(), name
        out += [struct.pack("<b", exponent), values.astype(kind).tobytes()]
    return b"".join(out)


def main() -> None:
    """Runs the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("state", type=Path)
    parser.add_argument("out", type=Path, help="file of the weights")
    args = parser.parse_args()
    model = WiderModel(load_model(2))
    model.load_state_dict(torch.load(args.state)["average"])
    data = pack(model)
    args.out.write_bytes(data)
    print(f"{len(data)} bytes, SHA-256 {hashlib.sha256(data).hexdigest()}")


if __name__ == "__main__":
    main()

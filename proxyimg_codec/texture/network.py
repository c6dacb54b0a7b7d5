"""Decoder network: frequency encoding of features, and a small ReLU MLP with quantized weights."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..entropy import arrays
from ..errors import FormatError

Floats = NDArray[np.float32]

BLOCK, LARGE_BLOCK = 64, 4096
"""Points per matrix product, for small and for large networks. BLAS computes a small product
directly and on one thread. For large layers it pays to have it rearrange the data and use more
threads."""

SMALL = 1 << 18
"""Most multiplications per layer and `BLOCK` points of a small network."""


@dataclass(frozen=True)
class NetShape:
    """Sizes of a network.

    Attributes:
        dim: Number of features of a point, D.
        octaves: Octaves of the frequency encoding, L; 0 = features only.
        hidden: Width of the hidden layers.
        depth: Number of hidden layers.
        channels: Outputs, 3 (colour) or 4 (premultiplied colour and alpha).
    """

    dim: int
    octaves: int
    hidden: int
    depth: int
    channels: int

    @property
    def layers(self) -> list[tuple[int, int]]:
        """Numbers of inputs and outputs of each linear layer."""
        sizes = [self.dim * (2 * self.octaves + 1), *[self.hidden] * self.depth, self.channels]
        return list(pairwise(sizes))

    @property
    def rows(self) -> int:
        """Number of outputs of all layers together; each has a step and a bias."""
        return sum(o for _, o in self.layers)

    @property
    def parameters(self) -> int:
        """Number of weights and biases."""
        return sum(i * o + o for i, o in self.layers)


@dataclass(frozen=True, eq=False)
class Network:
    """Quantized decoder network.

    Attributes:
        shape: Sizes of the network.
        bits: Bits per weight, 2..8.
        weights: For each layer int8 [out, in] weights in units of the steps.
        steps: float16 [rows] quantization step of the weights of each output.
        biases: float16 [rows] bias of each output.
    """

    shape: NetShape
    bits: int
    weights: tuple[NDArray[np.int8], ...]
    steps: NDArray[np.float16]
    biases: NDArray[np.float16]

    @cached_property
    def layers(self) -> list[tuple[Floats, Floats]]:
        """Dequantized weights [out, in] and biases [out] of each layer, float32."""
        ends = np.cumsum([o for _, o in self.shape.layers])[:-1]
        steps = np.split(self.steps.astype(np.float32), ends)
        biases = np.split(self.biases.astype(np.float32), ends)
        return [
            (w.astype(np.float32) * s[:, None], b)
            for w, s, b in zip(self.weights, steps, biases, strict=True)
        ]

    @cached_property
    def packed(self) -> Mapping[str, Any]:
        """Fields of NETW: those that the network was read from, otherwise newly coded ones."""
        return pack(self)

    # Numbers may overflow, and a reader has to survive that [TEX-19].
    @np.errstate(over="ignore", invalid="ignore")
    def __call__(self, features: Floats) -> Floats:
        """Runs the network.

        The outputs of a point do not depend on the other points. As matrix products of different
        sizes round differently, all have the same number of points. (Some BLAS round differently
        even by the place within a product, as OpenBLAS does on machines with AVX2 only; then the
        last bit may differ.)

        Args:
            features: float32 [N, D].

        Returns:
            float32 [N, channels] outputs, not clamped.
        """
        n, d = features.shape
        small = all(i * o * BLOCK <= SMALL for i, o in self.shape.layers)
        block = BLOCK if small else LARGE_BLOCK
        padded = np.zeros((d, -(-n // block) * block), np.float32)
        padded[:, :n] = features.T
        x = encode_features(padded.T, self.shape.octaves).T
        x = x.reshape(len(x), -1, block).swapaxes(0, 1)  # [blocks, inputs, block]
        for i, (weight, bias) in enumerate(self.layers):
            x = weight @ x
            # Biases are repeated, because numpy broadcasts slowly along short rows.
            x += bias.repeat(block).reshape(-1, block)
            if i + 1 < len(self.layers):
                np.maximum(x, np.zeros(x.shape[1:], np.float32), out=x)
        return x.swapaxes(1, 2).reshape(-1, self.shape.channels)[:n]


def encode_features(features: Floats, octaves: int) -> Floats:
    """Frequency encoding of features (ProxyImg, frequency encoding of features).

    The result holds the features f, then for each octave k = 0..L-1 sin(2^k pi f) and
    cos(2^k pi f), each D wide. Octaves above the first follow from the double-angle formulas.

    Args:
        features: float32 [N, D]; fastest if points are contiguous in memory, as in a transposed
            array [D, N].
        octaves: Number of octaves L.

    Returns:
        float32 [N, D * (2 L + 1)], the transpose of a contiguous array.
    """
    f = features.T
    out = np.empty((2 * octaves + 1, *f.shape), np.float32)
    out[0] = f
    if octaves:
        # Features are reduced to |r| <= 1/2 before multiplying by pi, to be as exact as float32 is.
        turns = np.rint(f)
        half = turns / 2
        sign = 1 - 4 * np.abs(half - np.rint(half))  # -1 for odd turns
        angle = (f - turns) * np.float32(math.pi)
        np.multiply(np.sin(angle), sign, out=out[1])
        np.multiply(np.cos(angle), sign, out=out[2])
    for k in range(1, octaves):
        s, c = out[2 * k - 1], out[2 * k]
        twice = 2 * s
        np.multiply(twice, c, out=out[2 * k + 1])
        np.subtract(1, twice * s, out=out[2 * k + 2])
    return out.reshape(len(out) * len(f), len(features)).T


def pack(network: Network) -> dict[str, Any]:
    """Encodes a network as the fields of NETW."""
    s = network.shape
    parts = []
    for weight in network.weights:
        values = (weight.astype(np.int64) + (1 << (network.bits - 1)))[None]
        data = arrays.encode(values, network.bits, np.ones(weight.shape, bool))
        parts += [len(data).to_bytes(4, "little"), data]
    return {
        "dim": s.dim, "octaves": s.octaves, "hidden": s.hidden, "depth": s.depth,
        "channels": s.channels, "bits": network.bits,
        "steps": network.steps.astype("<f2").tobytes(),
        "biases": network.biases.astype("<f2").tobytes(),
        "weights": b"".join(parts),
    }  # fmt: skip


def unpack(fields: Mapping[str, Any], where: str = "chunk NETW") -> Network:
    """Decodes a network.

    Args:
        fields: Values of NETW.
        where: Name of the chunk in error messages.

    Raises:
        FormatError: A stream is corrupt or has a wrong length, a step is not positive, or a step or
            bias is not finite.
    """
    shape = NetShape(*(fields[k] for k in ("dim", "octaves", "hidden", "depth", "channels")))
    steps = read_halves(fields["steps"], shape.rows, where, "TEX-16", positive=True)
    biases = read_halves(fields["biases"], shape.rows, where, "TEX-16")
    data, at, weights = fields["weights"], 0, []
    for inputs, outputs in shape.layers:
        end = at + 4 + int.from_bytes(data[at : at + 4], "little")
        if end > len(data):
            raise FormatError("weights are truncated", where, rule="TEX-15")
        values = arrays.decode(
            data[at + 4 : end],
            (1, outputs, inputs),
            fields["bits"],
            np.ones((outputs, inputs), bool),
        )[0]
        weights.append((values.astype(np.int16) - (1 << (fields["bits"] - 1))).astype(np.int8))
        at = end
    if at != len(data):
        raise FormatError("bytes follow the weights", where, rule="TEX-15")
    network = Network(shape, fields["bits"], tuple(weights), steps, biases)
    network.__dict__["packed"] = fields
    return network


def read_halves(
    data: bytes, count: int, where: str, rule: str, positive: bool = False
) -> NDArray[np.float16]:
    """Reads and checks little-endian float16 values.

    Args:
        data: Bytes of the values.
        count: Number of values that there must be.
        where: Name of the chunk in error messages.
        rule: Id of the rule that wrong values break.
        positive: Whether the values must be positive.

    Returns:
        float16 [count].

    Raises:
        FormatError: `data` has a wrong length, or a value is not finite or not positive.
    """
    if len(data) != 2 * count:
        raise FormatError(
            f"expected {count} float16 values, found {len(data)} bytes", where, rule=rule
        )
    values = np.frombuffer(data, "<f2").astype(np.float16)
    if not np.isfinite(values).all() or (positive and (values <= 0).any()):
        raise FormatError("a float16 value is not finite or not positive", where, rule=rule)
    return values

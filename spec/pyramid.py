"""Generated parts of chapter 8: the registered models, tables, a worked example."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from importlib import resources
from unittest import mock

import numpy as np
from numpy.typing import NDArray

from proxyimg_codec.entropy import laplace
from proxyimg_codec.native import kernel
from proxyimg_codec.texture import planes, registered_model
from proxyimg_codec.texture.grid import Grid, by_channel
from proxyimg_codec.texture.latents import Decoder, Latents

from .dump import grid

Ints = NDArray[np.int64]

_LOW = np.array([[[-9, 4, 60], [2, 3, -1]], [[3, 1, 0], [0, 2, 0]], [[-2, 0, 0], [0, 0, 1]]])
_HIGH = {0: [[3, 0, -1], [0, 2, 0]], 1: [[0, -70, 0], [0, 0, 1]], 4: [[0, 0, 1], [0, 0, 0]]}
"""Latents of the worked example: the lowest planes, and level 1 by channel."""


def scales() -> Iterator[str]:
    """Yields lines of Python with the constants of the distributions."""
    last = laplace.DIRECT + 1
    yield from _listed("DECAY", [laplace.decay(k) for k in range(last + laplace._HEAVIER)])
    yield from _listed("REACHES", [laplace.reach_of(k) for k in range(last)])


def _listed(name: str, values: list[int], a_line: int = 8) -> Iterator[str]:
    """Yields the lines of a Python list."""
    yield f"{name} = ["
    for at in range(0, len(values), a_line):
        yield "    " + " ".join(f"{v}," for v in values[at : at + a_line])
    yield "]  # fmt: skip"


def _file(name: str) -> bytes:
    """Bytes of the file of a registered model."""
    return resources.files("proxyimg_codec.models").joinpath(f"{name}.bin").read_bytes()


def models() -> Iterator[str]:
    """Yields the rows of the table of registered models."""
    yield "| Number | File | Bytes | H | C | Planes |"
    yield "|---|---|---|---|---|---|"
    for number, entry in registered_model.REGISTERED.items():
        data = _file(entry.file)
        hidden, context = struct.unpack_from("<HH", data, len(registered_model.MAGIC))
        planes_ = "padded" if entry.padded else "not padded"
        yield f"| {number} | `{entry.file}.bin` | {len(data)} | {hidden} | {context} | {planes_} |"


def registered() -> Iterator[str]:
    """Yields lines of Python with the file of each model, its SHA-256, and whether it is padded."""
    entries = registered_model.REGISTERED
    names = {v.digest: f"NETWORKS_{k}" for k, v in reversed(entries.items())}
    for digest, name in names.items():
        yield f'{name} = "{digest}"'
    yield "REGISTERED = {"
    for number, entry in entries.items():
        yield f'    {number}: ("{entry.file}.bin", {names[entry.digest]}, {entry.padded}),'
    yield "}"


def layout() -> Iterator[str]:
    """Yields the rows of the table of arrays in a model file; exponents are those of the newest."""
    number = max(registered_model.REGISTERED)
    found = registered_model.registered(number)
    h, c = 10007, 10009  # unusual widths, so that they are recognized in the shapes
    letters = {h: "H", c: "C"}
    head = ", ".join(str(k) for k in range(1, registered_model.LEVEL_SETS))
    yield f"| Array | Type | Shape | e in model {number}: levels {head}, and above |"
    yield "|---|---|---|---|"
    for name, shape, kind in registered_model.layout(h, c):
        part, level, array = ["", "0", name] if " " not in name else name.split()
        if level != "0":
            continue
        exponents = [found.to_colour.exponent]
        if part:
            exponents = [getattr(v, array).exponent for v in getattr(found, part)]
        sizes = ", ".join(letters.get(n, str(n)) for n in shape)
        type_ = {"<i4": "int32", "<i1": "int8"}[kind]
        units = ", ".join(map(str, exponents))
        yield f"| {f'{part} `{array}`'.strip()} | {type_} | [{sizes}] | {units} |"


def _example() -> planes.Planes:
    """Planes of the worked example."""
    level = np.zeros((9, 2, 3), np.int32)
    for channel, values in _HIGH.items():
        level[channel] = values
    low = _LOW.astype(np.int32)
    return planes.encoded(Latents((level,), low), (5, 3), 256, cell=1, support=_cells())


def _cells() -> NDArray[np.bool_]:
    """Cells of the worked example that have latents."""
    return np.array([[True, True, True], [True, True, False]])


def example() -> Iterator[str]:
    """Yields the lines of the worked example: fields, latents, samples."""
    shown = _example()
    for key, value in shown.packed.items():
        yield f"{key:10} {value.hex(' ') if isinstance(value, bytes) else value}"
    levels, lowest = shown.latents
    for colour, plane in enumerate(lowest):
        yield f"lowest plane of colour {colour}"
        yield from grid(plane)
    coded = by_channel(Grid((5, 3), 1).bands(_cells(), 1, 1))
    for channel in _HIGH:
        yield f"level 1, channel {channel}"
        yield from grid(levels[0][channel], coded[channel])
    for k, name in enumerate(("red", "green", "blue")):
        yield f"{name}, in 8 bits"
        yield from grid(np.rint(shown.raster[..., k] * 255).astype(int))


def steps() -> Iterator[str]:
    """Yields the rows of the table of symbols of the worked example."""
    yield "| Set | Mean | Scale | s' | Part | Centre | Raw bits | Symbol | Latent |"
    yield "|---|---|---|---|---|---|---|---|---|"
    sets: list[tuple[Ints, Ints, Ints]] = []
    code = Decoder.code

    def recorded(self: Decoder, values: Ints, mean: Ints, scale: Ints) -> Ints:
        out = code(self, values, mean, scale)
        sets.append((mean, scale, out))
        return out

    fields = _example().packed
    with (
        mock.patch.object(Decoder, "code", recorded),
        mock.patch.object(kernel, "available", return_value=False),
    ):
        assert planes.unpack(fields).latents
    for number, rows in enumerate(sets):
        at = laplace.locate(*rows[:2])
        for m, s, y, row, centre, shift in zip(*rows, *at, strict=True):
            if row < 0:
                continue
            reach = int(laplace.tables().reach[row])
            off = int((y >> shift) - centre)
            coded = str(off + reach) if abs(off) <= reach else f"escape {off}"
            low = f"{y & ((1 << shift) - 1)} in {shift}" if shift else "none"
            cells = (number, m, s, row // 16, row % 16, centre, low, coded, y)
            yield f"| {' | '.join(map(str, cells))} |"

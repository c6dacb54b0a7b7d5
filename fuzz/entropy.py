"""Fuzz target of the entropy coder: streams decode alike with and without the kernel.

Corrupt streams must raise a `FormatError` in both cases. The first byte of an input chooses what is
coded, six bytes its shape, and two the end of the first of two streams; the streams follow.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from fuzz import run

with run.imports(__name__):
    from proxyimg_codec.entropy import arrays
    from proxyimg_codec.errors import FormatError
    from proxyimg_codec.geometry import deltas
    from proxyimg_codec.texture import planes
    from proxyimg_codec.texture.latents import Latents

HEAD = 9


def _shape(head: bytes) -> tuple[tuple[int, int, int], int, Any]:
    """Shape of an array, its bits a value, and bool [rows, columns] of the stored positions."""
    shape = (1 + head[1] % 4, 1 + head[2] % 24, 1 + head[3] % 24)
    stored = np.ones(shape[1:], bool)
    if head[5]:
        y, x = np.indices(shape[1:])
        stored = (x * head[5] + y * head[6]) % 7 < 4
    return shape, 1 + head[4] % 8, stored


def _array(head: bytes, first: bytes, second: bytes) -> Any:
    """Decodes a coded array."""
    shape, bits, stored = _shape(head)
    return arrays.decode(first + second, shape, bits, stored)


def _again(head: bytes, first: bytes, second: bytes) -> Any:
    """Encodes an array of arbitrary values, and decodes it."""
    shape, bits, stored = _shape(head)
    values = np.resize(np.frombuffer(first + second + b"\0", np.uint8), shape) & ((1 << bits) - 1)
    found = arrays.decode(arrays.encode(values, bits, stored), shape, bits, stored)
    assert (found == np.where(stored, values, 0)).all(), "another array comes back"
    return found


def _deltas(head: bytes, first: bytes, second: bytes) -> Any:
    """Decodes signed integers; other streams must not decode to the same."""
    found = deltas.decode(first, second, 1 + head[1] % 6, 1 + head[2], "", 1 + head[3] % 3)
    parts = found.reshape(len(found), 1 + head[3] % 3, -1)
    assert deltas.encode(parts) == (first, second), "other streams have the same meaning"
    return found


def _planes(head: bytes, first: bytes, second: bytes) -> Any:
    """Decodes the latents of planes."""
    levels, components = 1 + head[3] % 4, (1, 3)[head[3] >> 7]
    fields = {
        "model": 1, "size": [1 + head[1] % 40 + 110 * (head[3] >> 6 & 1), 1 + head[2] % 40],
        "components": components, "tile": 6 * (head[3] >> 5 & 1), "details": [],
        "step": 5 * (head[4] & 127), "levels": levels,
        "grey": levels if components == 1 else (head[4] >> 7) * levels // 2,
        "lowest": [head[5] & 63] * components, "shifts": [head[6] & 15, head[6] >> 4] * levels,
        "cell": 3, "support": b"", "escapes": second, "data": first,
    }  # fmt: skip
    found = planes.unpack(fields).latents
    return np.concatenate([v.ravel() for v in (found.lowest, *found.levels)])


KINDS = (_array, _again, _deltas, _planes)


def _tried(kind: Callable[[bytes, bytes, bytes], Any], *given: bytes) -> Any:
    """Calls `kind`; returns None if it raises a `FormatError`.

    It does not matter which broken rule is found first.
    """
    try:
        return kind(*given)
    except FormatError:
        return None


def one_input(data: bytes) -> None:
    """Decodes streams with the kernel and with numpy, and compares the results."""
    if len(data) < HEAD:
        return
    head, rest = data[:HEAD], data[HEAD:]
    at = int.from_bytes(head[7:], "little")
    kind = KINDS[head[0] % len(KINDS)]
    native = _tried(kind, head, rest[:at], rest[at:])
    with run.numpy_only():
        plain = _tried(kind, head, rest[:at], rest[at:])
    assert type(native) is type(plain), f"{native} with the kernel, {plain} without"
    assert np.array_equal(native, plain), "the kernel decodes something else"


def seeds() -> list[bytes]:
    """Valid streams of each kind."""
    rng = np.random.default_rng(1)
    out = [b"\1" + bytes(rng.integers(0, 256, 60, np.uint8))]

    def put(kind: int, shape: tuple[int, ...], first: bytes, second: bytes = b"") -> None:
        out.append(bytes([kind, *shape]) + len(first).to_bytes(2, "little") + first + second)

    for channels, rows, columns, bits, mask in (
        (1, 1, 1, 1, 0), (1, 9, 24, 1, 0), (3, 20, 17, 4, 2), (2, 6, 24, 8, 1), (1, 1, 24, 5, 0),
    ):  # fmt: skip
        head = (channels - 1, rows - 1, columns - 1, bits - 1, mask, mask)
        shape, _, stored = _shape(bytes([0, *head]))
        values = rng.integers(0, 1 << bits, shape) * (rng.random(shape) < 0.6)
        put(0, head, arrays.encode(values, bits, stored))
    for size in (3, 300, 1 << 20):
        values = rng.integers(-size, size, (2, 2, 20))
        put(2, (1, 19, 1, 0, 0, 0), *deltas.encode(values))
    for scale, shift in ((4, 8), (30, 15), (63, 1)):
        head = (15, 11, 129, 60, scale, shift * 17)
        shapes = [(9, 8, 8), (9, 4, 4)]
        levels = tuple(rng.integers(-9, 9, s, np.int32) * scale // 4 for s in shapes)
        latents = Latents(levels, rng.integers(-200, 200, (3, 4, 4), np.int32))
        made = planes.encoded(latents, (16, 12), 300, shifts=(shift - 8,) * 4).packed
        put(3, (*head[:4], made["lowest"][0], head[5]), made["data"], made["escapes"])
    shapes = [(9, 4, 66), (9, 2, 33)]
    levels = tuple(rng.integers(-3, 3, s, np.int32) for s in shapes)
    latents = Latents(levels, rng.integers(-90, 90, (3, 2, 33), np.int32))
    made = planes.encoded(latents, (130, 6), 300, shifts=(0,) * 4, tile=6, number=1).packed
    head = (19, 5, 0b11100001, 60, made["lowest"][0], 8 * 17)
    put(3, head, made["data"], made["escapes"])
    return out


if __name__ == "__main__":
    run.main("entropy", one_input, seeds(), files=False)

"""Fuzz target of edits: a picture after a sequence of edits is saved, read and drawn alike.

The first byte of an input chooses the picture; operations and their parameters are made from the
others.
"""

from __future__ import annotations

import contextlib
import struct
from functools import cache
from typing import Any

import numpy as np

from fuzz import run

with run.imports(__name__):
    from proxyimg_codec import from_bytes
    from proxyimg_codec.api import Image
    from proxyimg_codec.edit.operations import KINDS
    from proxyimg_codec.edit.script import OPERATIONS
    from proxyimg_codec.errors import PxiError

PICTURES = (
    "layers", "bent-turned", "posed", "alpha", "pyramid-cuts", "pyramid-cuts-several", "tree",
    "pyramid-alpha", "moves-layers", "undo", "node-bent", "shared", "colours", "pyramid-support",
)  # fmt: skip
"""Cases of the conformance suite to edit; names without a case are left out."""

STEPS = 6
"""Most edits in a sequence."""

SIDE = 20


class Source:
    """Source of values that are made from bytes; zeros follow when the bytes are used up."""

    def __init__(self, data: bytes) -> None:
        self._data, self._at = data, 0

    def __bool__(self) -> bool:
        return self._at < len(self._data)

    def take(self, count: int) -> bytes:
        """Next `count` bytes."""
        found = self._data[self._at : self._at + count]
        self._at += count
        return found.ljust(count, b"\0")

    def below(self, end: int) -> int:
        """Next integer in 0..end - 1."""
        return self.take(1)[0] % end

    def number(self) -> float:
        """Next number, usually one of a sensible size."""
        kind = self.below(8)
        if kind == 7:
            return float(struct.unpack("<d", self.take(8))[0])
        value = int(struct.unpack("<h", self.take(2))[0])
        return value / (1, 4, 64, 256, 4096, 1 << 14, 1 << 15)[kind]

    def value(self, kind: str, names: list[str]) -> Any:
        """Next value of a kind of parameter, sometimes of a wrong type."""
        unusual = self.below(32)
        if unusual == 31:
            return (None, [], {}, "", "\ud800", -1, 1 << 80, [["a"]])[self.below(8)]
        schema = KINDS[kind]
        if kind == "layers":
            return [self.value("layer", names) for _ in range(1 + self.below(3))]
        if kind in ("layer", "foreign", "place"):
            return (names[self.below(len(names))], self.below(8) - 4, "front", "back", "forward")[
                max(self.below(8) - 3, 0)
            ]
        if kind == "integer":
            return self.below(64) - 16
        if kind == "handles":
            return [[self.number() for _ in range(4)] for _ in range(1 + self.below(3))]
        if kind == "colour":
            return "#" + self.take(3).hex()
        if kind == "motion":
            preset = ("sway", "jelly", "bounce", "tremble")[self.below(4)]
            return {"version": 1, "preset": preset, "duration": self.number(), "fps": 6}
        if "enum" in schema:
            return schema["enum"][self.below(len(schema["enum"]))]
        if schema["type"] == "array":
            return [self.number() for _ in range(schema["minItems"])]
        if schema["type"] == "number":
            return self.number()
        return ("name", names[self.below(len(names))], "\u202e\n", "n" * 300)[self.below(4)]


@cache
def pictures() -> list[Image]:
    """Pictures to edit."""
    cases = run.ROOT / "conformance" / "cases"
    paths = (path for name in PICTURES for path in cases.glob(f"*/{name}/input.pxi"))
    return [from_bytes(path.read_bytes()) for path in paths]


def operation(source: Source, image: Image) -> dict[str, Any]:
    """Makes an edit of a picture."""
    names = [layer.name for layer in image.layers] + list(image.groups)
    name = list(OPERATIONS)[source.below(len(OPERATIONS))]
    out: dict[str, Any] = {"op": name}
    for key, parameter in OPERATIONS[name].parameters.items():
        if parameter.needed or source.below(2):
            out[key] = source.value(parameter.kind, names)
    if "source" in out:  # a layer, so that no file is read
        out["source"] = names[source.below(len(names))]
    return out


def drawn(image: Image) -> Any:
    """Draws an image at a small size; the error message if that fails."""
    try:
        return image.render(width=min(image.width, SIDE), height=min(image.height, SIDE))
    except PxiError as error:
        return str(error)


def one_input(data: bytes) -> None:
    """Edits a picture, saves and reads it, and undoes the edits."""
    source = Source(data)
    image = first = pictures()[source.below(len(pictures()))]
    done = 0
    while source and done < STEPS:
        with contextlib.suppress(PxiError):
            image = image.edited(operation(source, image))
            done += 1
    try:
        saved = image.to_bytes()
    except PxiError:
        return
    again = from_bytes(saved)
    assert again.to_bytes() == saved, "what is read is saved as something else"
    assert np.array_equal(drawn(again), drawn(image)), "what is read is drawn otherwise"
    edits = len(image.history) - len(first.history)
    if edits > 0:
        assert image.undone(edits).to_bytes() == first.to_bytes(), "edits cannot be taken back"


def seeds() -> list[bytes]:
    """Random sequences of bytes."""
    rng = np.random.default_rng(1)
    return [bytes(rng.integers(0, 256, n, np.uint8)) for n in range(8, 136, 2)]


if __name__ == "__main__":
    run.main("edit", one_input, seeds(), files=False)

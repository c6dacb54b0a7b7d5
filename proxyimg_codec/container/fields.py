"""Declared fields of structured chunks, packed as one canonical msgpack map.

Canonical: keys in the declared order, shortest encodings, no floats, no extension types. A reader
re-packs what it read and compares, so that every content has exactly one encoding. The byte tables
of the specification are printed from these declarations.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import msgpack

from ..errors import FormatError

_TYPES = {"bin": "bytes", "ints": "list", "strs": "list"}
"""Python types of the kinds that are not called as they are."""


@dataclass(frozen=True)
class Field:
    """One entry of a chunk's map.

    Attributes:
        key: Name in the map.
        kind: ``int``, ``str``, ``bin``, ``ints`` (an array of integers) or ``strs`` (of strings).
        meaning: One sentence for the specification.
        low: Smallest integer, or smallest number of bytes or characters.
        high: Largest, likewise.
        items: Exact number of items of an ``ints`` field whose items lie in low..high; 0 = any.
    """

    key: str
    kind: str
    meaning: str
    low: int = 0
    high: int = (1 << 31) - 1
    items: int = 0

    def problem(self, value: Any) -> str | None:
        """Why `value` does not fit, or None."""
        if type(value).__name__ != _TYPES.get(self.kind, self.kind):
            return f"is not of type {self.kind}"
        if self.kind == "strs":
            if any(type(v) is not str or not self.low <= len(v) <= self.high for v in value):
                return f"has an item that is not a string of {self.low}..{self.high} characters"
            return None
        if self.kind == "ints":
            if any(type(v) is not int or not self.low <= v <= self.high for v in value):
                return f"has an item that is not an integer in {self.low}..{self.high}"
            if self.items and len(value) != self.items:
                return f"has {len(value)} items instead of {self.items}"
            return None
        size = value if self.kind == "int" else len(value)
        if not self.low <= size <= self.high:
            what = "value" if self.kind == "int" else "length"
            return f"has {what} {size}, outside {self.low}..{self.high}"
        return None


def pack(fields: tuple[Field, ...], values: Mapping[str, Any]) -> bytes:
    """Packs `values`, which must be valid, in declared order."""
    for field in fields:
        problem = field.problem(values[field.key])
        if problem:
            raise ValueError(f"field {field.key!r} {problem}")
    packed: bytes = msgpack.packb({f.key: values[f.key] for f in fields}, use_bin_type=True)
    return packed


def unpack(fields: tuple[Field, ...], payload: bytes, where: str) -> dict[str, Any]:
    """The checked map of a payload.

    Raises:
        FormatError: Not msgpack, not canonical, a missing, unknown or out-of-range field.
    """
    try:
        values = msgpack.unpackb(
            payload, raw=False, strict_map_key=True, max_ext_len=0, max_map_len=64,
            max_array_len=1 << 20,
        )  # fmt: skip
    except (ValueError, TypeError, RecursionError, msgpack.UnpackException) as error:
        raise FormatError(f"payload is not valid msgpack ({type(error).__name__})", where) from None
    if not isinstance(values, dict) or list(values) != [f.key for f in fields]:
        raise FormatError(f"payload is not a map of {', '.join(f.key for f in fields)}", where)
    for field in fields:
        problem = field.problem(values[field.key])
        if problem:
            raise FormatError(f"field {field.key!r} {problem}", where)
    if msgpack.packb(values, use_bin_type=True) != payload:
        raise FormatError("payload is not in canonical form", where)
    return values

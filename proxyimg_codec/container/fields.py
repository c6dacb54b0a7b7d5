"""Declared fields of structured chunks, packed as one canonical msgpack array.

Canonical means: values in the declared order, shortest encodings, no floats, no extension types. A
reader packs again what it read and compares, so every content has exactly one encoding. Files up to
version 0.3 may hold maps from keys to values instead. The byte tables of the specification are
printed from these declarations.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import msgpack

from ..errors import FormatError

_TYPES = {"bin": "bytes", "ints": "list", "strs": "list"}
"""Names of the Python types of those kinds that are not named after their type."""


@dataclass(frozen=True)
class Field:
    """Declaration of one value of a chunk.

    Attributes:
        key: Name of the value; maps of earlier versions hold it.
        kind: ``int``, ``str``, ``bin``, ``ints`` (an array of integers) or ``strs`` (of strings).
        meaning: One sentence for the specification.
        low: Smallest integer, or smallest number of bytes (``bin``) or characters.
        high: Largest integer, or largest number of bytes or characters.
        items: Exact number of items of an ``ints`` field; 0 = any number. For ``ints`` and
            ``strs``, `low` and `high` bound each item.
    """

    key: str
    kind: str
    meaning: str
    low: int = 0
    high: int = (1 << 31) - 1
    items: int = 0

    def problem(self, value: Any) -> str | None:
        """Description of the way in which `value` breaks the declaration; None if it is valid."""
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


class Few:
    """Hook for msgpack that bounds the number of arrays, maps and items, which take much memory.

    Args:
        containers: Most arrays and maps together.
        items: Most items of all of them together.
        refusal: The exception that is raised if there are more.
    """

    def __init__(self, containers: int, items: int, refusal: Exception) -> None:
        self._containers, self._items, self._refusal = containers, items, refusal

    def __call__(self, found: Any) -> Any:
        """Counts an array or map, and returns it unchanged."""
        self._containers -= 1
        self._items -= len(found)
        if self._containers < 0 or self._items < 0:
            raise self._refusal
        return found


def pack(fields: tuple[Field, ...], values: Mapping[str, Any]) -> bytes:
    """Packs `values` in the declared order.

    Args:
        fields: The declarations.
        values: A value for each field, by key.

    Raises:
        ValueError: A value does not fit its declaration.
    """
    for field in fields:
        problem = field.problem(values[field.key])
        if problem:
            raise ValueError(f"field {field.key!r} {problem}")
    packed: bytes = msgpack.packb([values[f.key] for f in fields], use_bin_type=True)
    return packed


def unpack(
    fields: tuple[Field, ...], payload: bytes, where: str, *, old: bool = False
) -> dict[str, Any]:
    """Unpacks and checks the values of a payload.

    Args:
        fields: The declarations.
        payload: Payload of the chunk.
        where: Name of the chunk in error messages.
        old: Whether the payload may also be a map, as in files up to version 0.3.

    Returns:
        The values by key.

    Raises:
        FormatError: The payload is not msgpack or not canonical, or a field is missing, unknown or
            out of range.
    """
    try:
        few = Few(1 + len(fields), 1 << 20, ValueError())
        content = msgpack.unpackb(
            payload, raw=False, strict_map_key=True, max_ext_len=0, max_map_len=64,
            max_array_len=1 << 20, list_hook=few, object_hook=few,
        )  # fmt: skip
    except (ValueError, TypeError, RecursionError, msgpack.UnpackException) as error:
        raise FormatError(
            f"payload is not valid msgpack ({type(error).__name__})", where, rule="CON-14"
        ) from None
    values = _by_key(fields, content, where, old)
    for field in fields:
        problem = field.problem(values[field.key])
        if problem:
            raise FormatError(f"field {field.key!r} {problem}", where, rule="CHK-1")
    if msgpack.packb(content, use_bin_type=True) != payload:
        raise FormatError("payload is not in canonical form", where, rule="CON-15")
    return values


def _by_key(fields: tuple[Field, ...], content: Any, where: str, old: bool) -> dict[str, Any]:
    keys = [f.key for f in fields]
    if old and isinstance(content, dict) and list(content) == keys:
        return content
    if not isinstance(content, list):
        rule = "CON-17" if old and isinstance(content, dict) else "CON-14"
        expected = ", ".join(keys)
        raise FormatError(f"payload is not an array of {expected}", where, rule=rule)
    if len(content) != len(keys):
        counts = f"{len(content)} values instead of {len(keys)}"
        raise FormatError(f"payload has {counts}: {', '.join(keys)}", where, rule="CON-14")
    return dict(zip(keys, content, strict=True))

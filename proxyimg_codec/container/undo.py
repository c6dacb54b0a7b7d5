"""uNDO: earlier states of an edited picture, bound by a hash to the present state.

A state is a list of references to chunks. A chunk that it shares with the present state is not
stored again; every other chunk is stored once for all states.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import msgpack

from ..errors import FormatError, LimitError
from ..limits import DEFAULT_LIMITS, Budget
from . import meta
from .chunks import PREFIX, SIGNATURE, Chunk, write
from .fields import Few, Field, pack, unpack

TYPE = "uNDO"

FIELDS = (
    Field("state", "bin", "SHA-256 of all chunks but this one and TAIL.", 32, 32),
    Field("size", "int", "Bytes of the history.", 1),
    Field("zstd", "bin", "The history as one zstd frame."),
)

OLD_PREFIX = PREFIX.pack(SIGNATURE, 0, 2, 0)
"""File prefix that the hash in `state` also covers in old files."""

STEPS_MAX = 1 << 12
"""Most steps that a file keeps; older ones are dropped."""

SIZE_MAX, CHUNKS_MAX = DEFAULT_LIMITS.metadata_bytes - 64, DEFAULT_LIMITS.chunks
"""Most bytes and chunks of a history that readers accept; older steps are dropped."""


@dataclass(frozen=True)
class Step:
    """One edit.

    Attributes:
        operation: The edit operation as JSON.
        chunks: State before the edit: all chunks of its file but uNDO and TAIL.
    """

    operation: str
    chunks: tuple[Chunk, ...]


def encode(present: Sequence[Chunk], steps: Sequence[Step], beside: int = 0) -> Chunk:
    """Returns the uNDO chunk for the present state and the steps that led to it.

    The oldest steps are left out if the history would exceed what readers accept.

    Args:
        present: All other chunks of the file but TAIL.
        steps: The steps, oldest first.
        beside: Number of bytes that metadata and script in `present` decompress to.
    """
    number: dict[tuple[str, bytes], int] = {}
    for i, chunk in enumerate(present):
        number.setdefault((chunk.type, chunk.payload), i)
    kept: list[list[Any]] = []
    states: list[list[Any]] = []
    size = references = 0
    for step in reversed(steps[-STEPS_MAX:]):
        keys = [(chunk.type, chunk.payload) for chunk in step.chunks]
        fresh = [key for key in dict.fromkeys(keys) if key not in number]
        size += 4 * len(step.operation) + 6 * len(keys) + sum(len(p) + 16 for _, p in fresh) + 16
        references += len(keys)
        if references > DEFAULT_LIMITS.references:
            break
        if size > SIZE_MAX - beside or len(present) + len(kept) + len(fresh) > CHUNKS_MAX:
            break
        for key in fresh:
            number[key] = len(present) + len(kept)
            kept.append(list(key))
        states.insert(0, [step.operation, [number[key] for key in keys]])
    history = msgpack.packb([kept, states], use_bin_type=True)
    values = {"state": digest(present), "size": len(history), "zstd": meta.compressed(history)}
    return Chunk(TYPE, pack(FIELDS, values))


def decode(own: Chunk, present: Sequence[Chunk], where: str, budget: Budget) -> tuple[Step, ...]:
    """Decodes the steps of a uNDO chunk.

    Args:
        own: The uNDO chunk.
        present: All other chunks of the file but TAIL.
        where: Name of the chunk in error messages.
        budget: Running budget of the file.

    Returns:
        The steps, oldest first; none if the history belongs to another state than `present`.

    Raises:
        FormatError: The history is corrupt.
        LimitError: The history exceeds `budget`.
    """
    values = unpack(FIELDS, own.payload, where, old=own.old)
    if values["state"] != digest(present, own.old):
        return ()
    history = meta.decompressed(values["size"], values["zstd"], where, budget, "CHK-20")
    try:
        arrays = 3 + budget.limits.chunks + 2 * STEPS_MAX
        refusal = LimitError("the history holds too many arrays or items", rule="SEC-2")
        few = Few(arrays, budget.limits.references + 3 * arrays, refusal)
        content = msgpack.unpackb(
            history, raw=False, strict_map_key=True, max_ext_len=0, max_map_len=2,
            max_array_len=1 << 20, list_hook=few, object_hook=few,
        )  # fmt: skip
        keys = list(content) if own.old else []
        kept, steps = dict.values(content) if own.old else content
        if keys != ["chunks", "steps"][: len(keys)] or len(steps) > STEPS_MAX:
            raise ValueError
        budget.check("chunks", len(present) + len(kept))
        budget.check("references", sum(len(references) for _, references in steps))
        pool = [*present, *(_chunk(type_, payload, own.version) for type_, payload in kept)]
        result = tuple(_step(operation, references, pool) for operation, references in steps)
        if msgpack.packb(content, use_bin_type=True) != history:
            raise ValueError
    except (
        ValueError, TypeError, KeyError, IndexError, RecursionError, msgpack.UnpackException,
    ) as error:  # fmt: skip
        raise FormatError(
            f"the history is corrupt ({type(error).__name__})", where, rule="CHK-20"
        ) from None
    return result


def digest(chunks: Sequence[Chunk], old: bool = False) -> bytes:
    """SHA-256 of a state, which binds a history to it; `old` is for files up to version 0.3."""
    prefix = OLD_PREFIX if old else b""
    return hashlib.sha256(prefix + write(chunks)[PREFIX.size :]).digest()


def _chunk(type_: Any, payload: Any, version: tuple[int, int]) -> Chunk:
    named = isinstance(type_, str) and len(type_) == 4 and type_.isascii() and type_.isalpha()
    if not named or not isinstance(payload, bytes):
        raise ValueError
    return Chunk(type_, payload, None, version)


def _step(operation: Any, references: Any, pool: Sequence[Chunk]) -> Step:
    if not isinstance(operation, str) or not isinstance(references, list):
        raise ValueError
    if any(type(r) is not int or not 0 <= r < len(pool) for r in references):
        raise ValueError
    return Step(operation, tuple(pool[r] for r in references))

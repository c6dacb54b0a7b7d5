"""Registry of numbers and names, as tables for the chapters and as JSON."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from typing import Any

from proxyimg_codec import errors
from proxyimg_codec.codec import levels
from proxyimg_codec.container import (
    chunks,
    head,
    layr,
    mesh,
    meta,
    motn,
    netw,
    plan,
    pose,
    texr,
    tree,
    undo,
)
from proxyimg_codec.container.fields import Field
from proxyimg_codec.limits import DEFAULT_LIMITS
from proxyimg_codec.texture import registered_model
from proxyimg_codec.validation.warnings import CODES

CHUNKS = {
    head.TYPE: "canvas",
    layr.TYPE: "name and shape of a layer",
    mesh.TYPE: "proxy nodes of a layer",
    pose.TYPE: "what edits did to a layer",
    netw.TYPE: "decoder network",
    plan.TYPE: "planes of a raster",
    texr.TYPE: "texture of a layer",
    meta.BLOCKS["icc"]: "ICC profile",
    meta.BLOCKS["exif"]: "EXIF",
    meta.BLOCKS["xmp"]: "XMP",
    meta.CICP_TYPE: "primaries and transfer",
    meta.INFO_TYPE: "how the file was made",
    tree.TYPE: "groups of layers",
    motn.TYPE: "motion",
    undo.TYPE: "history",
    "TAIL": "end of the file",
}
"""Purpose of each chunk of the format, in the order of a file."""

CLASSES: dict[str, type[errors.PxiError]] = {
    "invalid": errors.FormatError,
    "unsupported": errors.UnsupportedError,
    "limit": errors.LimitError,
}
"""Classes of errors by name."""

SAMPLINGS = {
    0: "direct",
    1: "local and global features",
    2: "local features",
    3: "global features",
}

CODERS = {texr.SHARED: "shared", texr.IMPLICIT: "implicit", texr.PYRAMID: "pyramid"}


def _numbers() -> dict[str, dict[int, str]]:
    """Fields whose numbers later versions may add to, with the meanings of the numbers."""
    models = {
        number: f"{entry.file}.bin, {'padded' if entry.padded else 'not padded'}"
        for number, entry in registered_model.REGISTERED.items()
    }
    return {"coder of TEXR": CODERS, "sampling of LAYR": SAMPLINGS, "model of PLAN": models}


def chunks_table() -> Iterator[str]:
    """Yields the rows of the table of chunk types."""
    yield "| Type | Holds | A reader that does not know it | A program that changes the file |"
    yield "|---|---|---|---|"
    for type_, meaning in CHUNKS.items():
        chunk = chunks.Chunk(type_, b"")
        reads = "refuses the file" if chunk.critical else "ignores it"
        copies = "keeps it" if chunk.safe_to_copy else "leaves it out"
        yield f"| {type_} | {meaning} | {reads} | {'-' if chunk.critical else copies} |"


def numbers_table() -> Iterator[str]:
    """Yields the rows of the table of numbers."""
    yield "| Field | Number | Meaning |"
    yield "|---|---|---|"
    for field, known in _numbers().items():
        key, _, type_ = field.partition(" ")
        for number, meaning in known.items():
            yield f"| `{key}` {type_} | {number} | {meaning} |"


def levels_table() -> Iterator[str]:
    """Yields the rows of the table of levels."""
    yield "| Limit | " + " | ".join(f"Level {k}" for k, _ in enumerate(levels.LEVELS, 1)) + " |"
    yield "|---|" + "---|" * len(levels.LEVELS)
    for name in levels.COUNTED:
        bounds = (getattr(limits, name) for limits in levels.LEVELS)
        yield f"| `{name}` | " + " | ".join(f"2^{v.bit_length() - 1}" for v in bounds) + " |"


def as_json(fields: Mapping[str, Sequence[Field]], ids: Sequence[str]) -> str:
    """Text of `registry.json`.

    Args:
        fields: Fields of each chunk and coder, by the name that the chapters use.
        ids: Ids of all statements.
    """
    content: dict[str, Any] = {
        "version": ".".join(map(str, chunks.VERSION)),
        "versions": [".".join(map(str, v)) for v in chunks.READABLE],
        "media_type": "image/vnd.pxi",
        "extension": ".pxi",
        "signature": chunks.SIGNATURE.hex(),
        "chunks": {
            type_: {
                "holds": meaning,
                "critical": chunks.Chunk(type_, b"").critical,
                "safe_to_copy": chunks.Chunk(type_, b"").safe_to_copy,
            }
            for type_, meaning in CHUNKS.items()
        },
        "fields": {name: [asdict(f) for f in declared] for name, declared in fields.items()},
        "numbers": {
            field: {str(k): v for k, v in known.items()} for field, known in _numbers().items()
        },
        "models": {str(k): v.digest for k, v in registered_model.REGISTERED.items()},
        "limits": asdict(DEFAULT_LIMITS),
        "profiles": list(levels.PROFILES),
        "levels": [{n: getattr(v, n) for n in levels.COUNTED} for v in levels.LEVELS],
        "errors": {name: error.exit_code for name, error in CLASSES.items()},
        "doubts": CODES,
        "statements": list(ids),
    }
    return json.dumps(content, indent=1, ensure_ascii=False) + "\n"

"""The order of chunks and what they must agree on: bytes <-> `Container`, without numpy."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from ..errors import FormatError, UnsupportedError
from ..limits import DEFAULT_LIMITS, Limits
from . import head, layr, meta, netw, texr
from .chunks import Chunk, read, write
from .fields import Field, pack, unpack

Values = Mapping[str, Any]

_STRUCTURE = (layr.TYPE, netw.TYPE, texr.TYPE)
_BLOCK_NAMES = {type_: name for name, type_ in meta.BLOCKS.items()}


@dataclass(frozen=True)
class Container:
    """A parsed file: the checked maps of its chunks, in file order.

    Attributes:
        head: Fields of HEAD.
        layers: Fields of each LAYR, back to front.
        networks: Fields of each NETW.
        textures: Fields of each TEXR, one a layer.
        blocks: Metadata blocks by name: ``icc``, ``exif``, ``xmp``.
        info: Fields of iNFO, or None.
        extra: Unknown ancillary chunks.
        sizes: Bytes of all chunks of a type, framing included, by type.
    """

    head: Values
    layers: tuple[Values, ...]
    networks: tuple[Values, ...]
    textures: tuple[Values, ...]
    blocks: Mapping[str, bytes] = field(default_factory=dict)
    info: Values | None = None
    extra: tuple[Chunk, ...] = ()
    sizes: Mapping[str, int] = field(default_factory=dict)


def parse(data: bytes, limits: Limits = DEFAULT_LIMITS) -> Container:
    """Reads and checks a whole file, short of decoding its entropy-coded streams.

    Raises:
        FormatError: The file breaks the format.
        UnsupportedError: It needs a newer reader.
        LimitError: It exceeds `limits`.
    """
    chunks = read(data, limits)
    if chunks[0].type != head.TYPE:
        raise FormatError(
            "the first chunk is not HEAD", f"chunk {chunks[0].type}", chunks[0].offset
        )
    header = _unpack(head.FIELDS, chunks[0])
    parts: dict[str, list[Values]] = {t: [] for t in _STRUCTURE}
    fields = {layr.TYPE: layr.FIELDS, netw.TYPE: netw.FIELDS, texr.TYPE: texr.FIELDS}
    blocks: dict[str, bytes] = {}
    info: Values | None = None
    extra: list[Chunk] = []
    stage = 0
    sizes: dict[str, int] = {}
    for chunk in chunks:
        sizes[chunk.type] = sizes.get(chunk.type, 0) + chunk.size
    for chunk in chunks[1:-1]:
        where = f"chunk {chunk.type}"
        if chunk.type in _STRUCTURE:
            if _STRUCTURE.index(chunk.type) < stage or blocks or info:
                raise FormatError("out of order", where, chunk.offset)
            stage = _STRUCTURE.index(chunk.type)
            parts[chunk.type].append(_unpack(fields[chunk.type], chunk))
        elif chunk.type in _BLOCK_NAMES:
            name = _BLOCK_NAMES[chunk.type]
            if name in blocks:
                raise FormatError("appears twice", where, chunk.offset)
            blocks[name] = meta.decompress(chunk.payload, where, limits)
        elif chunk.type == meta.INFO_TYPE:
            if info is not None:
                raise FormatError("appears twice", where, chunk.offset)
            info = _unpack(meta.INFO_FIELDS, chunk)
        elif chunk.type in (head.TYPE, "TAIL"):
            raise FormatError("appears twice", where, chunk.offset)
        elif chunk.critical:
            raise UnsupportedError(f"{where} is not known to this program; update proxyimg-codec")
        else:
            extra.append(chunk)
    if chunks[-1].payload:
        raise FormatError("must be empty", "chunk TAIL", chunks[-1].offset)
    container = Container(
        header, tuple(parts[layr.TYPE]), tuple(parts[netw.TYPE]), tuple(parts[texr.TYPE]),
        blocks, info, tuple(extra), sizes,
    )  # fmt: skip
    check(container, limits)
    return container


def _unpack(fields: tuple[Field, ...], chunk: Chunk) -> Values:
    return unpack(fields, chunk.payload, f"chunk {chunk.type} at byte {chunk.offset}")


def check(c: Container, limits: Limits) -> None:
    """Checks what chunks must agree on, and the budget that all of them share.

    Raises:
        FormatError: They contradict each other.
        UnsupportedError: They need a newer reader.
        LimitError: They exceed `limits`.
    """
    for name in ("layers", "networks"):
        limits.check(name, c.head[name])
    limits.check("side", max(c.head["size"]))
    counts = {"layers": len(c.layers), "networks": len(c.networks)}
    for name, count in counts.items():
        if count != c.head[name]:
            raise FormatError(f"HEAD announces {c.head[name]} {name}, the file has {count}")
    if len(c.textures) != len(c.layers):
        raise FormatError(f"{len(c.layers)} layers, but {len(c.textures)} textures")
    if c.head["depth"] not in (8, 16):
        raise FormatError("depth is neither 8 nor 16", "chunk HEAD")
    if c.head["opaque"] and (c.head["channels"] != 3 or c.layers[0]["segments"]):
        raise FormatError("an opaque file needs 3 channels and a first layer without boundary")
    if len({layer["name"] for layer in c.layers}) < len(c.layers):
        raise FormatError("two layers have the same name", "chunk LAYR")
    if c.info and len(c.info["areas"]) not in (0, len(c.layers)):
        raise FormatError("the number of areas is not that of the layers", "chunk iNFO")
    limits.check("segments", sum(sum(layer["segments"]) for layer in c.layers))
    parameters = 0
    for net in c.networks:
        if net["channels"] != c.head["channels"]:
            raise FormatError("channels differ from HEAD", "chunk NETW")
        width = net["hidden"]
        encoded = net["dim"] * (2 * net["octaves"] + 1)
        parameters += (encoded + 1) * width + (net["depth"] - 1) * (width + 1) * width
        parameters += (width + 1) * net["channels"]
    limits.check("parameters", parameters)
    codes = 0
    for layer, texture in zip(c.layers, c.textures, strict=True):
        if min(layer["box"][2:]) < 1:
            raise FormatError("the box is empty", "chunk LAYR")
        if layer["sampling"] != 0:
            raise UnsupportedError(f"chunk LAYR: sampling {layer['sampling']} is not known")
        if texture["coder"] != texr.IMPLICIT:
            raise UnsupportedError(f"chunk TEXR: texture coder {texture['coder']} is not known")
        if texture["network"] >= len(c.networks):
            raise FormatError(f"network {texture['network']} does not exist", "chunk TEXR")
        columns, rows = texture["grid"]
        limits.check("wavefronts", columns + 2 * rows)
        codes += columns * rows * int(c.networks[texture["network"]]["dim"])
    limits.check("codes", codes)


def serialize(c: Container) -> bytes:
    """The file of a container, in canonical order: HEAD, LAYR, NETW, TEXR, metadata, TAIL."""
    chunks = [Chunk(head.TYPE, pack(head.FIELDS, c.head))]
    chunks += [Chunk(layr.TYPE, pack(layr.FIELDS, v)) for v in c.layers]
    chunks += [Chunk(netw.TYPE, pack(netw.FIELDS, v)) for v in c.networks]
    chunks += [Chunk(texr.TYPE, pack(texr.FIELDS, v)) for v in c.textures]
    for name, block in c.blocks.items():
        chunks.append(Chunk(meta.BLOCKS[name], meta.compress(block)))
    if c.info is not None:
        chunks.append(Chunk(meta.INFO_TYPE, pack(meta.INFO_FIELDS, c.info)))
    return write([*chunks, *c.extra, Chunk("TAIL", b"")])

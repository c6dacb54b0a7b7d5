"""The order of chunks: bytes <-> `Container`, without numpy."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from ..errors import FormatError, UnsupportedError
from ..limits import DEFAULT_LIMITS, Limits
from . import check, head, layr, mesh, meta, motn, netw, plan, pose, texr, tree, undo
from .chunks import Chunk, read, write
from .fields import Field, pack, unpack

Values = Mapping[str, Any]

_STRUCTURE = (layr.TYPE, mesh.TYPE, pose.TYPE, netw.TYPE, plan.TYPE, texr.TYPE)
_SINGLE = (meta.INFO_TYPE, tree.TYPE, motn.TYPE, undo.TYPE)
_BLOCK_NAMES = {type_: name for name, type_ in meta.BLOCKS.items()}
_FIELDS = {
    **{m.TYPE: m.FIELDS for m in (head, layr, mesh, pose, netw, plan, tree, motn, undo)},
    **dict.fromkeys(_BLOCK_NAMES, meta.FIELDS),
    meta.INFO_TYPE: meta.INFO_FIELDS,
}


@dataclass(frozen=True)
class Container:
    """A parsed file: the checked values of its chunks by key, in file order.

    Attributes:
        head: Fields of HEAD.
        layers: Fields of each LAYR, back to front.
        networks: Fields of each NETW.
        textures: Fields of each TEXR, one a layer.
        planes: Fields of each PLAN.
        meshes: Fields of each MESH.
        poses: Fields of each POSE.
        tree: Fields of tREE, or None.
        motion: Fields of mOTN, or None.
        history: Steps of uNDO that led to this state.
        blocks: Metadata blocks by name: ``icc``, ``exif``, ``xmp``.
        info: Fields of iNFO, or None.
        extra: Unknown ancillary chunks.
        sizes: Bytes of all chunks of a type, framing included, by type.
    """

    head: Values
    layers: tuple[Values, ...]
    networks: tuple[Values, ...]
    textures: tuple[Values, ...]
    planes: tuple[Values, ...] = ()
    meshes: tuple[Values, ...] = ()
    poses: tuple[Values, ...] = ()
    tree: Values | None = None
    motion: Values | None = None
    history: tuple[undo.Step, ...] = ()
    blocks: Mapping[str, bytes] = field(default_factory=dict)
    info: Values | None = None
    extra: tuple[Chunk, ...] = ()
    sizes: Mapping[str, int] = field(default_factory=dict)

    def texture_of(self, layer: int) -> Values:
        """Fields of the texture that a layer shows: its own, or the one it shares."""
        own = self.textures[layer]
        return self.textures[own["texture"]] if own["coder"] == texr.SHARED else own


def parse(data: bytes, limits: Limits = DEFAULT_LIMITS) -> Container:
    """Reads and checks a whole file, short of decoding its entropy-coded streams.

    Raises:
        FormatError: The file breaks the format.
        UnsupportedError: It needs a newer reader.
        LimitError: It exceeds `limits`.
    """
    limits = limits.budget()
    return assemble(read(data, limits), limits)


def assemble(
    chunks: Sequence[Chunk], limits: Limits, values_of: Callable[[Chunk], Values] | None = None
) -> Container:
    """The container of all chunks of a file.

    Args:
        chunks: The last is TAIL.
        limits: Bounds them all together.
        values_of: Gives the values of a structured chunk; `values` by default.

    Raises:
        FormatError, UnsupportedError, LimitError: As `parse`.
    """
    values_of, limits = values_of or values, limits.budget()
    if chunks[0].type != head.TYPE:
        raise FormatError(
            "the first chunk is not HEAD",
            f"chunk {chunks[0].type}",
            chunks[0].offset,
            rule="CON-11",
        )
    header = values_of(chunks[0])
    parts: dict[str, list[Values]] = {t: [] for t in _STRUCTURE}
    blocks: dict[str, bytes] = {}
    single: dict[str, Values] = {}
    history: tuple[undo.Step, ...] = ()
    extra: list[Chunk] = []
    stage = 0
    sizes: dict[str, int] = {}
    for chunk in chunks:
        sizes[chunk.type] = sizes.get(chunk.type, 0) + chunk.size
    for chunk in chunks[1:-1]:
        where = f"chunk {chunk.type}"
        if chunk.type in _STRUCTURE:
            if _STRUCTURE.index(chunk.type) < stage or blocks or single:
                raise FormatError("out of order", where, chunk.offset, rule="CON-11")
            stage = _STRUCTURE.index(chunk.type)
            parts[chunk.type].append(values_of(chunk))
        elif chunk.type in _BLOCK_NAMES:
            name = _BLOCK_NAMES[chunk.type]
            if name in blocks:
                raise FormatError("appears twice", where, chunk.offset, rule="CON-11")
            blocks[name] = meta.decompress(chunk, where, limits)
        elif chunk.type in _SINGLE:
            if chunk.type in single:
                raise FormatError("appears twice", where, chunk.offset, rule="CON-11")
            single[chunk.type] = values_of(chunk)
            if chunk.type == undo.TYPE:
                present = [c for c in chunks if c.type not in (undo.TYPE, "TAIL")]
                history = _renewed(undo.decode(chunk, present, where, limits))
        elif chunk.type in (head.TYPE, "TAIL"):
            raise FormatError("appears twice", where, chunk.offset, rule="CON-11")
        elif chunk.critical:
            raise UnsupportedError(
                f"{where} is not known to this program; update proxyimg-codec", rule="CON-9"
            )
        else:
            extra.append(chunk)
    if chunks[-1].payload:
        raise FormatError("must be empty", "chunk TAIL", chunks[-1].offset, rule="CON-11")
    container = Container(
        header, tuple(parts[layr.TYPE]), tuple(parts[netw.TYPE]), tuple(parts[texr.TYPE]),
        tuple(parts[plan.TYPE]), tuple(parts[mesh.TYPE]), tuple(parts[pose.TYPE]),
        single.get(tree.TYPE), single.get(motn.TYPE), history, blocks,
        single.get(meta.INFO_TYPE), tuple(extra), sizes,
    )  # fmt: skip
    check.check(container, limits)
    return container


def fields_of(chunk: Chunk) -> tuple[Field, ...]:
    """The declared fields of a chunk; none if it is not a structured one.

    Raises:
        UnsupportedError: A texture coder that is not known.
    """
    return texr.fields_of(chunk.payload) if chunk.type == texr.TYPE else _FIELDS.get(chunk.type, ())


def values(chunk: Chunk) -> Values:
    """The values of a structured chunk, each checked by itself.

    Raises:
        FormatError: They are not as declared.
        UnsupportedError: A texture coder that is not known.
    """
    where = f"chunk {chunk.type}" + ("" if chunk.offset is None else f" at byte {chunk.offset}")
    return unpack(fields_of(chunk), chunk.payload, where, old=chunk.old)


def _renewed(steps: tuple[undo.Step, ...]) -> tuple[undo.Step, ...]:
    """A history whose chunks are as `present` writes them, so that states can share them.

    Those that are not right stay as they are: going back to such a state says what is wrong.
    """

    def renewed(chunk: Chunk) -> Chunk:
        payload = chunk.payload
        with contextlib.suppress(FormatError, UnsupportedError):
            if chunk.old and (fields := fields_of(chunk)):
                payload = pack(fields, unpack(fields, payload, "", old=True))
        return Chunk(chunk.type, payload)

    once = {id(chunk): chunk for step in steps for chunk in step.chunks}
    new = {key: renewed(chunk) for key, chunk in once.items()}
    return tuple(undo.Step(s.operation, tuple(new[id(c)] for c in s.chunks)) for s in steps)


def serialize(c: Container) -> bytes:
    """The file of a container, in canonical order."""
    chunks = present(c)
    if c.history:
        chunks.append(undo.encode(chunks, c.history, check.decompressed(c)))
    return write([*chunks, Chunk("TAIL", b"")])


def present(c: Container) -> list[Chunk]:
    """All chunks but uNDO and TAIL: HEAD, LAYR, MESH, POSE, NETW, PLAN, TEXR, metadata, others."""
    chunks = [Chunk(head.TYPE, pack(head.FIELDS, c.head))]
    for module, values in (
        (layr, c.layers), (mesh, c.meshes), (pose, c.poses), (netw, c.networks),
        (plan, c.planes),
    ):  # fmt: skip
        chunks += [Chunk(module.TYPE, pack(module.FIELDS, v)) for v in values]
    for v in c.textures:
        chunks.append(Chunk(texr.TYPE, pack(texr.CODERS[v["coder"]], v)))
    for name, block in c.blocks.items():
        chunks.append(Chunk(meta.BLOCKS[name], meta.compress(block)))
    if c.info is not None:
        chunks.append(Chunk(meta.INFO_TYPE, pack(meta.INFO_FIELDS, c.info)))
    if c.tree is not None:
        chunks.append(Chunk(tree.TYPE, pack(tree.FIELDS, c.tree)))
    if c.motion is not None:
        chunks.append(Chunk(motn.TYPE, pack(motn.FIELDS, c.motion)))
    return [*chunks, *c.extra]

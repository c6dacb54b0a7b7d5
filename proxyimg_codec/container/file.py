"""The order of chunks: bytes <-> `Container`, without numpy."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Mapping, Sequence

from ..errors import FormatError, UnsupportedError
from ..limits import DEFAULT_LIMITS, Budget, Limits
from . import check, head, layr, mesh, meta, motn, netw, plan, pose, texr, tree, undo
from .chunks import Chunk, read, write
from .content import Container, Values
from .fields import Field, pack, unpack

_STRUCTURE = (layr.TYPE, mesh.TYPE, pose.TYPE, netw.TYPE, plan.TYPE, texr.TYPE)
_SINGLE = (meta.INFO_TYPE, tree.TYPE, motn.TYPE, undo.TYPE)
_BLOCK_NAMES = {type_: name for name, type_ in meta.BLOCKS.items()}
_FIELDS = {
    **{m.TYPE: m.FIELDS for m in (head, layr, mesh, pose, netw, plan, tree, motn, undo)},
    **dict.fromkeys(_BLOCK_NAMES, meta.FIELDS),
    meta.INFO_TYPE: meta.INFO_FIELDS,
}


def parse(data: bytes, limits: Limits = DEFAULT_LIMITS) -> Container:
    """Reads and checks a whole file, short of decoding its entropy-coded streams.

    Raises:
        FormatError: The file breaks the format.
        UnsupportedError: It needs a newer reader.
        LimitError: It exceeds `limits`.
    """
    return parse_within(data, Budget(limits))


def parse_within(data: bytes, budget: Budget) -> Container:
    """As `parse`, of a budget that decoding goes on to spend.

    Raises:
        FormatError, UnsupportedError, LimitError: As `parse`.
    """
    return assemble(read(data, budget), budget)


def assemble(
    chunks: Sequence[Chunk], budget: Budget, values_of: Callable[[Chunk], Values] | None = None
) -> Container:
    """The container of all chunks of a file.

    Args:
        chunks: The last is TAIL.
        budget: Bounds them all together.
        values_of: Gives the values of a structured chunk; `values` by default.

    Raises:
        FormatError, UnsupportedError, LimitError: As `parse`.
    """
    first, last = chunks[0], chunks[-1]
    if first.type != head.TYPE:
        raise FormatError(
            "the first chunk is not HEAD", f"chunk {first.type}", first.offset, rule="CON-11"
        )
    parts = _Parts(chunks, budget, values_of or values)
    for chunk in chunks[1:-1]:
        parts.add(chunk)
    if last.payload:
        raise FormatError("must be empty", "chunk TAIL", last.offset, rule="CON-11")
    container = parts.container()
    check.check(container, budget)
    return container


class _Parts:
    """The chunks of a file sorted by what they are, in the order in which they come."""

    def __init__(
        self, chunks: Sequence[Chunk], budget: Budget, values_of: Callable[[Chunk], Values]
    ) -> None:
        self._chunks, self._budget, self._values_of = chunks, budget, values_of
        self._header = values_of(chunks[0])
        self._structure: dict[str, list[Values]] = {t: [] for t in _STRUCTURE}
        self._blocks: dict[str, bytes] = {}
        self._single: dict[str, Values] = {}
        self._history: tuple[undo.Step, ...] = ()
        self._extra: list[Chunk] = []
        self._stage = 0

    def add(self, chunk: Chunk) -> None:
        """Takes the next chunk after HEAD.

        Raises:
            FormatError: It may not stand here, or is wrong in itself.
            UnsupportedError: It is critical and not known.
            LimitError: It exceeds the budget.
        """
        where = f"chunk {chunk.type}"
        if chunk.type in _STRUCTURE:
            stage = _STRUCTURE.index(chunk.type)
            if stage < self._stage or self._blocks or self._single:
                raise FormatError("out of order", where, chunk.offset, rule="CON-11")
            self._stage = stage
            self._structure[chunk.type].append(self._values_of(chunk))
        elif chunk.type in _BLOCK_NAMES:
            self._once(chunk, self._blocks, _BLOCK_NAMES[chunk.type])
            block = meta.decompress(chunk, where, self._budget)
            self._blocks[_BLOCK_NAMES[chunk.type]] = block
        elif chunk.type in _SINGLE:
            self._once(chunk, self._single, chunk.type)
            self._single[chunk.type] = self._values_of(chunk)
            if chunk.type == undo.TYPE:
                present = [c for c in self._chunks if c.type not in (undo.TYPE, "TAIL")]
                self._history = _renewed(undo.decode(chunk, present, where, self._budget))
        elif chunk.type in (head.TYPE, "TAIL"):
            raise FormatError("appears twice", where, chunk.offset, rule="CON-11")
        elif chunk.critical:
            raise UnsupportedError(
                f"{where} is not known to this program; update proxyimg-codec", rule="CON-9"
            )
        else:
            self._extra.append(chunk)

    @staticmethod
    def _once(chunk: Chunk, seen: Mapping[str, object], name: str) -> None:
        if name in seen:
            raise FormatError("appears twice", f"chunk {chunk.type}", chunk.offset, rule="CON-11")

    def container(self) -> Container:
        """All that was taken."""
        sizes: dict[str, int] = {}
        for chunk in self._chunks:
            sizes[chunk.type] = sizes.get(chunk.type, 0) + chunk.size
        structure, single = self._structure, self._single
        return Container(
            head=self._header,
            layers=tuple(structure[layr.TYPE]),
            networks=tuple(structure[netw.TYPE]),
            textures=tuple(structure[texr.TYPE]),
            planes=tuple(structure[plan.TYPE]),
            meshes=tuple(structure[mesh.TYPE]),
            poses=tuple(structure[pose.TYPE]),
            tree=single.get(tree.TYPE),
            motion=single.get(motn.TYPE),
            history=self._history,
            blocks=self._blocks,
            info=single.get(meta.INFO_TYPE),
            extra=tuple(self._extra),
            sizes=sizes,
        )


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
    # Where these stood in the file that they are from is no part of the picture.
    return [*chunks, *(Chunk(v.type, v.payload) for v in c.extra)]

"""Order of the chunks in a file: between bytes and `Container`, without numpy."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Mapping, Sequence

from ..errors import FormatError, UnsupportedError
from ..limits import DEFAULT_LIMITS, Budget, Limits
from . import check, head, layr, mesh, meta, motn, netw, plan, pose, texr, tree, undo
from .chunks import Chunk, read, write
from .content import Container, Values
from .fields import Field, pack, unpack

_STRUCTURE = (layr.TYPE, mesh.TYPE, pose.TYPE, netw.TYPE, texr.TYPE, plan.TYPE)
_EARLIER = (*_STRUCTURE[:-2], plan.TYPE, texr.TYPE)
"""Order before `plan.TILED_FROM`."""

_SINGLE = (meta.CICP_TYPE, meta.INFO_TYPE, tree.TYPE, motn.TYPE, undo.TYPE)
_BLOCK_NAMES = {type_: name for name, type_ in meta.BLOCKS.items()}
_FIELDS: dict[str, tuple[Field, ...]] = {
    **{m.TYPE: m.FIELDS for m in (head, layr, mesh, pose, netw, plan, tree, motn, undo)},
    **dict.fromkeys(_BLOCK_NAMES, meta.FIELDS),
    meta.CICP_TYPE: meta.CICP_FIELDS,
    meta.INFO_TYPE: meta.INFO_FIELDS,
}


def parse(data: bytes, limits: Limits = DEFAULT_LIMITS) -> Container:
    """Reads and checks a whole file, but does not decode its entropy-coded streams.

    Args:
        data: The file.
        limits: Bounds on what the file may cost.

    Raises:
        FormatError: The file breaks the format.
        UnsupportedError: The file needs a newer reader.
        LimitError: The file exceeds `limits`.
    """
    return parse_within(data, Budget(limits))


def parse_within(data: bytes, budget: Budget) -> Container:
    """Does the same as `parse`, but spends a running budget that decoding goes on to use.

    Raises:
        FormatError, UnsupportedError, LimitError: As `parse`.
    """
    return assemble(read(data, budget), budget)


def assemble(
    chunks: Sequence[Chunk], budget: Budget, values_of: Callable[[Chunk], Values] | None = None
) -> Container:
    """Checks all chunks of a file together, and returns them as a container.

    Args:
        chunks: All chunks in file order; the last one is TAIL.
        budget: Running budget of the file.
        values_of: Function from a structured chunk to its values; `values` by default.

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
    """Collector that takes the chunks of a file in order and sorts them by type."""

    def __init__(
        self, chunks: Sequence[Chunk], budget: Budget, values_of: Callable[[Chunk], Values]
    ) -> None:
        self._chunks, self._budget, self._values_of = chunks, budget, values_of
        self._header = values_of(chunks[0])
        self._order = _STRUCTURE if chunks[0].version >= plan.TILED_FROM else _EARLIER
        self._structure: dict[str, list[Values]] = {t: [] for t in _STRUCTURE}
        self._blocks: dict[str, bytes] = {}
        self._single: dict[str, Values] = {}
        self._history: tuple[undo.Step, ...] = ()
        self._extra: list[Chunk] = []
        self._stage = 0

    def add(self, chunk: Chunk) -> None:
        """Takes the next chunk after HEAD.

        Raises:
            FormatError: The chunk may not stand in this place, or its content is wrong.
            UnsupportedError: The chunk is critical, and its type is not known.
            LimitError: The chunk exceeds the budget.
        """
        where = f"chunk {chunk.type}"
        if chunk.type in _STRUCTURE:
            stage = self._order.index(chunk.type)
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
        """Container of all chunks taken so far."""
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
            cicp=single.get(meta.CICP_TYPE),
            info=single.get(meta.INFO_TYPE),
            extra=tuple(self._extra),
            sizes=sizes,
        )


def fields_of(chunk: Chunk) -> tuple[Field, ...]:
    """Declared fields of a chunk; an empty tuple if the chunk is not a structured one.

    Raises:
        UnsupportedError: The texture coder is not known.
    """
    if chunk.type == texr.TYPE:
        return texr.fields_of(chunk.payload, chunk.version)
    if chunk.type == plan.TYPE:
        return plan.fields_of(chunk.version)
    return _FIELDS.get(chunk.type, ())


def values(chunk: Chunk) -> Values:
    """Unpacks the values of a structured chunk, and checks each by itself.

    Values that the version of the chunk does not have are as if they were not used.

    Raises:
        FormatError: A value is not as declared.
        UnsupportedError: The texture coder is not known.
    """
    where = f"chunk {chunk.type}" + ("" if chunk.offset is None else f" at byte {chunk.offset}")
    found = unpack(fields_of(chunk), chunk.payload, where, old=chunk.old)
    if chunk.type == plan.TYPE:
        return plan.ABSENT | found
    return texr.ABSENT | found if found.get("coder") == texr.PYRAMID else found


def _renewed(steps: tuple[undo.Step, ...]) -> tuple[undo.Step, ...]:
    """Returns a history with its chunks written in the present version.

    So states can share chunks with those that `present` writes. An invalid chunk stays as it is:
    the error is raised when someone goes back to such a state.
    """

    def renewed(chunk: Chunk) -> Chunk:
        payload = chunk.payload
        with contextlib.suppress(FormatError, UnsupportedError):
            if chunk.old or chunk.type in (texr.TYPE, plan.TYPE):
                payload = _packed(chunk.type, values(chunk)) if fields_of(chunk) else payload
        return Chunk(chunk.type, payload)

    once = {id(chunk): chunk for step in steps for chunk in step.chunks}
    new = {key: renewed(chunk) for key, chunk in once.items()}
    return tuple(
        undo.Step(s.operation, _in_order(tuple(new[id(c)] for c in s.chunks))) for s in steps
    )


def _in_order(chunks: tuple[Chunk, ...]) -> tuple[Chunk, ...]:
    """Chunks of a state with PLAN behind TEXR, as in the present version."""
    last = max((k for k, c in enumerate(chunks) if c.type == texr.TYPE), default=len(chunks))
    early = [c for c in chunks[:last] if c.type == plan.TYPE]
    rest = [c for c in chunks[: last + 1] if c.type != plan.TYPE]
    return (*rest, *early, *chunks[last + 1 :])


def _packed(type_: str, own: Values) -> bytes:
    """Payload of a structured chunk in the present version."""
    return pack(texr.CODERS[own["coder"]] if type_ == texr.TYPE else _FIELDS[type_], own)


def serialize(c: Container) -> bytes:
    """Returns the file of a container, with its chunks in canonical order."""
    chunks = present(c)
    if c.history:
        chunks.append(undo.encode(chunks, c.history, check.decompressed(c)))
    return write([*chunks, Chunk("TAIL", b"")])


def present(c: Container) -> list[Chunk]:
    """Packs all chunks but uNDO and TAIL.

    Their order is HEAD, LAYR, MESH, POSE, NETW, TEXR, PLAN, metadata, cICp, iNFO, tREE, mOTN,
    others.
    """
    chunks = [Chunk(head.TYPE, pack(head.FIELDS, c.head))]
    for module, values in (
        (layr, c.layers), (mesh, c.meshes), (pose, c.poses), (netw, c.networks),
    ):  # fmt: skip
        chunks += [Chunk(module.TYPE, pack(module.FIELDS, v)) for v in values]
    for v in c.textures:
        chunks.append(Chunk(texr.TYPE, _packed(texr.TYPE, v)))
    chunks += [Chunk(plan.TYPE, pack(plan.FIELDS, v)) for v in c.planes]
    for name, block in c.blocks.items():
        chunks.append(Chunk(meta.BLOCKS[name], meta.compress(block)))
    if c.cicp is not None:
        chunks.append(Chunk(meta.CICP_TYPE, pack(meta.CICP_FIELDS, c.cicp)))
    if c.info is not None:
        chunks.append(Chunk(meta.INFO_TYPE, pack(meta.INFO_FIELDS, c.info)))
    if c.tree is not None:
        chunks.append(Chunk(tree.TYPE, pack(tree.FIELDS, c.tree)))
    if c.motion is not None:
        chunks.append(Chunk(motn.TYPE, pack(motn.FIELDS, c.motion)))
    # Where these stood in the file that they are from is no part of the picture.
    return [*chunks, *(Chunk(v.type, v.payload) for v in c.extra)]

"""Files that are cut off or damaged, read as far as they go.

The planes of pyramid textures come before what shows them, coarsest level first: of a file that did
not arrive as a whole there is a blurred picture.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import msgpack

from ..container import file as container
from ..container import head, layr, plan, texr, undo
from ..container.chunks import Chunk, read_damaged
from ..container.content import Container
from ..container.fields import pack
from ..errors import FormatError
from ..geometry import boundary
from ..limits import Budget, Limits
from ..texture import planes

_END = Chunk("TAIL", b"")


def parse(data: bytes, limits: Limits) -> tuple[Container, tuple[str, ...]]:
    """What can be used of a file, and what is wrong with it.

    Levels of planes that cannot be decoded are 0. Without the textures of its layers, the picture
    is the first raster as it is.

    Raises:
        FormatError: Too little of it is left.
        UnsupportedError: It needs a newer reader.
        LimitError: It exceeds `limits`.
    """
    notes: list[str] = []
    wrong: dict[int, bool] = {}
    try:
        content = container.parse(data, limits)
    except FormatError as error:
        notes.append(str(error))
        chunks, wrong = _usable(*read_damaged(data, Budget(limits)), notes)
        budget = Budget(limits)
        budget.spend("file_bytes", len(data))
        content = container.assemble([*chunks, _END], budget)
    sound = []
    for number, fields in enumerate(content.planes):
        read = planes.unpack(fields, f"chunk PLAN {number}")
        whole, count = planes.salvaged(read)
        sound.append(whole.packed)
        if whole is not read or number in wrong:
            doubt = "" if wrong.get(number) else "; what they show may be wrong"
            used = f"{count} of {fields['levels']}"
            notes.append(f"{read.where}: levels used, coarsest first: {used}{doubt}")
    if notes:
        content = replace(content, planes=tuple(sound), history=())
    return content, tuple(notes)


def _usable(
    chunks: Sequence[Chunk], wrong: dict[int, bool], notes: list[str]
) -> tuple[list[Chunk], dict[int, bool]]:
    """Chunks that make a file together, but TAIL, and which PLAN among them are not right.

    Raises:
        FormatError: They make none.
    """
    kept: list[Chunk] = []
    doubtful: dict[int, bool] = {}
    for k, chunk in enumerate(chunks):
        where = f"chunk {chunk.type}"
        if chunk.type == plan.TYPE:
            if k in wrong:
                doubtful[sum(c.type == plan.TYPE for c in kept)] = wrong[k]
                chunk = replace(chunk, payload=_closed(chunk.payload, where))
            kept.append(chunk)
        elif k not in wrong:
            kept += [chunk] if chunk.type not in (undo.TYPE, _END.type) else []
        elif chunk.critical and not wrong[k]:
            raise FormatError(
                "CRC mismatch, and nothing can be done without it", where, rule="CON-6"
            )
        else:
            notes.append(f"{where} is left out")
    if not kept or kept[0].type != head.TYPE:
        raise FormatError("too little of the file is there: not even the chunk HEAD", rule="CON-11")
    header = container.values(kept[0])
    textures = sum(c.type == texr.TYPE for c in kept)
    if textures < header["layers"]:
        kept = _one_layer(kept)
        notes.append(f"of {header['layers']} textures {textures} are there: no layers are made")
    return kept, doubtful


def _closed(payload: bytes, where: str) -> bytes:
    """A payload whose last value, bytes, ends where the payload does.

    Raises:
        FormatError: It does not reach as far.
    """
    reader = msgpack.Unpacker(max_buffer_size=0)
    reader.feed(payload)
    try:
        in_map = payload[0] < 0x90
        count = 2 * reader.read_map_header() if in_map else reader.read_array_header()
        for _ in range(count - 1):
            reader.skip()
        at = reader.tell()
        data = payload[at + {0xC4: 2, 0xC5: 3, 0xC6: 5}[payload[at]] :]
    except (ValueError, IndexError, KeyError, msgpack.UnpackException):
        raise FormatError("too little of it is there", where) from None
    return payload[:at] + bytes(msgpack.packb(data, use_bin_type=True))


def _one_layer(chunks: Sequence[Chunk]) -> list[Chunk]:
    """HEAD, LAYR, PLAN and TEXR of a picture that shows the first raster on all of the canvas.

    Raises:
        FormatError: There is none, or it does not have the size of an opaque canvas.
    """
    header = container.values(chunks[0])
    found = {c.type: c for c in reversed(chunks)}
    size = header["size"]
    raster = container.values(found[plan.TYPE]) if plan.TYPE in found else {}
    if not header["opaque"] or raster.get("size") != size:
        raise FormatError(
            "cut off before the textures of its layers, and no raster stands for them"
        )
    box = [0, 0, *size]
    layer = {"name": "back", "box": box, "sampling": 0, **boundary.encode(None)}
    view = {"coder": texr.PYRAMID, "planes": 0, "alpha": 0, "part": box}
    view |= {"cell": 0, "mask": b"", "cuts": []}
    return [
        Chunk(head.TYPE, pack(head.FIELDS, {**header, "layers": 1, "networks": 0})),
        Chunk(layr.TYPE, pack(layr.FIELDS, layer)),
        Chunk(plan.TYPE, pack(plan.FIELDS, raster)),
        Chunk(texr.TYPE, pack(texr.PYRAMID_FIELDS, view)),
    ]

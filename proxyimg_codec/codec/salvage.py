"""Reading of truncated or damaged files, as far as possible.

The planes of pyramid textures stand before the textures that show them, coarsest level first. So a
file of which only the beginning has arrived gives a blurred picture.
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
    """Reads the usable parts of a file that may be truncated or damaged.

    Levels of planes that cannot be decoded become 0. If textures of layers are missing, the picture
    becomes one layer that shows the first raster. The history of a damaged file is dropped.

    Args:
        data: Bytes of the file.
        limits: Bounds on what decoding the file may cost.

    Returns:
        The content, and descriptions of the damage; none for a file that is whole.

    Raises:
        FormatError: Too little of the file is left.
        UnsupportedError: The file needs a newer reader.
        LimitError: The file exceeds `limits`.
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
    """Selects chunks that make a valid file together.

    Args:
        chunks: The chunks of the damaged file.
        wrong: Bad chunks by index: True if truncated, False if the CRC is wrong.
        notes: List to which descriptions of the damage are added.

    Returns:
        The chunks of the file without TAIL, and the bad PLAN chunks among them: by the number of
        the PLAN, True if it is truncated.

    Raises:
        FormatError: The chunks are not enough for a file.
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
    """Shortens the last value of a truncated payload, bytes, to the bytes that are there.

    Raises:
        FormatError: The payload ends before its last value.
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
    """Makes HEAD, LAYR, PLAN and TEXR of a picture that shows the first raster on the whole canvas.

    Raises:
        FormatError: There is no raster, it has another size than the canvas, or the picture is not
            opaque.
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
    view |= {"cell": 0, "mask": b"", "cuts": [], **texr.ABSENT}
    return [
        Chunk(head.TYPE, pack(head.FIELDS, {**header, "layers": 1, "networks": 0})),
        Chunk(layr.TYPE, pack(layr.FIELDS, layer)),
        Chunk(plan.TYPE, pack(plan.FIELDS, raster)),
        Chunk(texr.TYPE, pack(texr.PYRAMID_FIELDS, view)),
    ]

"""Reading of truncated or damaged files, as far as possible.

The planes of pyramid textures stand behind all that is small, coarsest level first. So a file of
which only the beginning has arrived gives a blurred picture with its layers. Before version 0.12
planes stood before the textures that show them: then it has only one layer.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import msgpack

from ..container import file as container
from ..container import head, layr, mesh, netw, plan, pose, texr, undo
from ..container.chunks import Chunk, read_damaged
from ..container.content import Container, Values
from ..container.fields import pack
from ..errors import FormatError
from ..geometry import boundary
from ..geometry import pose as poses
from ..limits import Budget, Limits
from ..texture import planes

_END = Chunk("TAIL", b"")


def parse(data: bytes, limits: Limits) -> tuple[Container, tuple[str, ...]]:
    """Reads the usable parts of a file that may be truncated or damaged.

    Latents that cannot be decoded become 0. Layers whose planes are missing are hidden, and what
    lies behind layers is filled if its planes are. If textures of layers are missing, the picture
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
        whole, count = planes.salvaged(read, wrong.get(number, False))
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
            number = sum(c.type == plan.TYPE for c in kept)
            if k in wrong:
                if number and wrong[k] and not _decodes(chunk, where):
                    notes.append(f"chunk PLAN {number} is left out: too little of it is there")
                    continue
                chunk = _closed(chunk, where)
                doubtful[number] = wrong[k]
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
    elif kept[0].version >= plan.TILED_FROM:
        kept, doubtful = _without_missing(kept, doubtful, notes)
    return kept, doubtful


def _without_missing(
    chunks: Sequence[Chunk], doubtful: dict[int, bool], notes: list[str]
) -> tuple[list[Chunk], dict[int, bool]]:
    """Makes textures do without planes that are missing, and drops planes that then are not used.

    Args:
        chunks: Chunks of a file without TAIL, with all TEXR.
        doubtful: Bad PLAN chunks, by number.
        notes: List to which descriptions of the damage are added.

    Returns:
        The same as `_usable`.

    Raises:
        FormatError: Nothing is there of what the back layer shows.
    """
    count = sum(c.type == plan.TYPE for c in chunks)
    textures = [container.values(c) for c in chunks if c.type == texr.TYPE]
    hidden, found = set(), []
    for number, own in enumerate(textures):
        shown = textures[own["texture"]] if own["coder"] == texr.SHARED else own
        if shown["coder"] == texr.PYRAMID and shown["planes"] >= count:
            hidden.add(number)
        found.append(_without(own, count) if own["coder"] == texr.PYRAMID else own)
    header = container.values(chunks[0])
    if hidden and (count == 0 or (header["opaque"] and 0 in hidden)):
        raise FormatError("cut off before the planes of its layers")
    used = sorted({k for v in found if v["coder"] == texr.PYRAMID for k in texr.planes_of(v)})
    if found == textures and len(used) == count:
        return list(chunks), doubtful
    names = [container.values(c)["name"] for c in chunks if c.type == layr.TYPE]
    notes += [f"layer {names[k]!r} is hidden: its planes are not there" for k in sorted(hidden)]
    numbers = {old: new for new, old in enumerate(used)}
    planned = [c for c in chunks if c.type == plan.TYPE]
    views = [
        Chunk(texr.TYPE, pack(texr.CODERS[v["coder"]], _renumbered(v, numbers))) for v in found
    ]
    kinds = (head.TYPE, layr.TYPE, mesh.TYPE), (netw.TYPE,)
    before, networks = ([c for c in chunks if c.type in kind] for kind in kinds)
    rest = [c for c in chunks if c.type not in (*kinds[0], *kinds[1], *_REMADE)]
    kept = [*before, *_hiding(chunks, hidden), *networks, *views, *(planned[k] for k in used)]
    return [*kept, *rest], {numbers[k]: v for k, v in doubtful.items() if k in numbers}


_REMADE = (pose.TYPE, texr.TYPE, plan.TYPE)


def _without(texture: Values, count: int) -> Values:
    """Values of a pyramid texture that names none but the first `count` planes."""
    own = {**texture, **{k: 0 for k in texr.PLANES if texture[k] > count}}
    if not own["behind"]:
        own["matte"] = 0
    if not own["behind"] or not own["alpha"]:
        own["behind_alpha"] = 0
    if own["planes"] < count:
        return own
    nothing = {"planes": 0, "alpha": 0, "part": [0, 0, 1, 1], "cell": 0, "mask": b"", "cuts": []}
    return {**own, **nothing, **texr.ABSENT}


def _renumbered(texture: Values, numbers: Mapping[int, int]) -> Values:
    """Values of a texture whose planes have new numbers."""
    if texture["coder"] != texr.PYRAMID:
        return texture
    others = {k: 1 + numbers[texture[k] - 1] for k in texr.PLANES if texture[k]}
    return {**texture, "planes": numbers[texture["planes"]], **others}


def _hiding(chunks: Sequence[Chunk], hidden: set[int]) -> list[Chunk]:
    """POSE chunks of a file, and of layers that are to be hidden."""
    posed = {v["layer"]: v for v in (container.values(c) for c in chunks if c.type == pose.TYPE)}
    rest = poses.encode(poses.REST, None)
    for number in hidden:
        posed[number] = {**posed.get(number, {**rest, "layer": number}), "hidden": 1}
    return [Chunk(pose.TYPE, pack(pose.FIELDS, posed[k])) for k in sorted(posed)]


def _decodes(chunk: Chunk, where: str) -> bool:
    """Whether at least the lowest planes of a PLAN can be decoded."""
    try:
        found = container.values(_closed(chunk, where))
        planes.salvaged(planes.unpack(found, where), True)
    except FormatError:
        return False
    return True


def _closed(chunk: Chunk, where: str) -> Chunk:
    """Shortens the last value of a truncated PLAN, bytes, to the bytes that are there.

    Raises:
        FormatError: The payload ends before its last value.
    """
    payload = chunk.payload
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
    packed = bytes(msgpack.packb(data, use_bin_type=True))
    return replace(chunk, payload=payload[:at] + packed)


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
        Chunk(texr.TYPE, pack(texr.PYRAMID_FIELDS, view)),
        Chunk(plan.TYPE, pack(plan.FIELDS, raster)),
    ]

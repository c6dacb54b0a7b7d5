"""Valid cases of metadata, private chunks, and files that are valid in another format too."""

from __future__ import annotations

import io
import zipfile
from dataclasses import replace
from typing import Any

import msgpack

from proxyimg_codec.codec.write import to_bytes
from proxyimg_codec.container import meta, motn, tree, undo
from proxyimg_codec.container.chunks import PREFIX, Chunk, read, write
from proxyimg_codec.container.fields import pack
from proxyimg_codec.geometry.pose import Pose
from proxyimg_codec.model import Layers, Picture

from ..builders import Numbers, changed, layer, layered, network, picture, texture, with_maps
from ..frames import checksum, frame, metadata, one_block
from ..refused.motion import Moving
from ..registry import WHOLE, Valids
from .meshes import TURN

CASES = Valids()
_case = CASES.case


def _plain(n: Numbers) -> bytes:
    """Bytes of a small file, higher than it is wide."""
    return to_bytes(picture((8, 12), [layer("back", (0, 0, 8, 12), texture(n))], network(n)))


def with_chunks(data: bytes, *chunks: Chunk) -> bytes:
    """File with other chunks before TAIL."""
    parts = read(data)
    return write([*parts[:-1], *chunks, parts[-1]])


def info(encoder: str = "", settings: str = "", areas: tuple[int, ...] = ()) -> Chunk:
    """Chunk iNFO."""
    values = {"encoder": encoder, "settings": settings, "areas": list(areas)}
    return Chunk(meta.INFO_TYPE, pack(meta.INFO_FIELDS, values))


def colour(primaries: int, transfer: int) -> Chunk:
    """Chunk cICp."""
    values = {"primaries": primaries, "transfer": transfer}
    return Chunk(meta.CICP_TYPE, pack(meta.CICP_FIELDS, values))


def history(data: bytes, content: bytes, **new: Any) -> Chunk:
    """Chunk uNDO that is bound to the chunks of a file, perhaps with other values."""
    present = read(data)[:-1]
    state = undo.digest(present, present[0].old)
    values = {"state": state, "size": len(content), "zstd": frame(content), **new}
    return Chunk(undo.TYPE, pack(undo.FIELDS, values))


_CMYK = bytes(16) + b"CMYK" + bytes(112)
_TURNED = b"MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x06\0\0\0\0\0\0"
"""EXIF block with orientation 6."""


@_case("A profile of another colour space, and an orientation: neither changes a sample",
       "MET-2", "MET-4", "MET-6")  # fmt: skip
def _metadata_orientation(n: Numbers) -> bytes:
    return with_chunks(_plain(n), metadata("icc", _CMYK), metadata("exif", _TURNED))


@_case("Blocks that hold no profile, no EXIF and no UTF-8, in frames that are right",
       "MET-5", "MET-7")  # fmt: skip
def _metadata_damaged(n: Numbers) -> bytes:
    blocks = {"icc": b"\0", "exif": b"II*\0\xff\xff\xff\xff", "xmp": b"\xff\xfe<x"}
    return with_chunks(_plain(n), *(metadata(k, v) for k, v in blocks.items()))


@_case("A colour of BT.2100 with PQ beside a profile: neither changes a sample",
       "CHK-1", "MET-19", "MET-20")  # fmt: skip
def _colour(n: Numbers) -> bytes:
    return with_chunks(_plain(n), colour(9, 16), metadata("icc", bytes(132)))


@_case("A colour whose numbers are unspecified and reserved", "CHK-1", "MET-19")
def _colour_unknown(n: Numbers) -> bytes:
    return with_chunks(_plain(n), colour(2, 255))


@_case("Frames of several blocks, with a window, without a size, and with a checksum", "CHK-16")
def _metadata_frames(n: Numbers) -> bytes:
    content = b"<x:xmpmeta>" + b" " * 300_000 + b"</x:xmpmeta>"
    runs = frame(content[:11], (32, 300_000), content[-12:], checksum=checksum(content))
    return with_chunks(
        _plain(n),
        metadata("xmp", content, runs),
        metadata("exif", _TURNED, frame(_TURNED, window=0x28)),
    )


@_case("Metadata of every kind, and motion, in the opposite order, between unknown chunks",
       "CON-11", "CON-12", "CHK-17", "CHK-18", "MET-8", "MET-13")  # fmt: skip
def _metadata_all(n: Numbers) -> bytes:
    data = Moving().data
    moves = [c for c in read(data) if c.type == motn.TYPE]
    still = write([c for c in read(data) if c.type != motn.TYPE])
    groups = Chunk(tree.TYPE, pack(tree.FIELDS, {"groups": ["all"], "parents": [5, 0, 5, 0, 0]}))
    past = history(still, b"", state=bytes(32), size=9, zstd=b"not looked at")
    kinds = [metadata("xmp", b"<x/>"), metadata("exif", _TURNED), metadata("icc", bytes(132))]
    chunks = [past, *moves, groups, info("x", "{}", (9, 8, 7, 6)), colour(12, 13), *kinds]
    return with_chunks(still, *(c for chunk in chunks for c in (chunk, Chunk("prIv", b"\0"))))


@_case("Settings of 5,000 nested arrays, an encoder of control characters, no areas",
       "CHK-17", "SEC-1", "SEC-13")  # fmt: skip
def _info_deep(n: Numbers) -> bytes:
    return with_chunks(_plain(n), info("a\0\x1b[2J\u202e\n", "[" * 5000))


@_case("Names of layers that are paths, control characters, or alike but for normalization",
       "CHK-5", "SEC-13", renders=[WHOLE, {"layers": ["\u00e9"]}])  # fmt: skip
def _names(n: Numbers) -> Picture:
    image = layered(n)
    names = "../../\0\u202e/etc/passwd", "\u00e9", "e\u0301"
    layers = [replace(v, name=name) for v, name in zip(image.layers, names, strict=True)]
    return replace(image, layers=type(image.layers)(layers))


@_case("A layer whose name has 255 characters of four bytes each", "CHK-1", "CON-16",
       renders=[WHOLE, {"layers": ["\U0001f98a" * 255]}])  # fmt: skip
def _name_long(n: Numbers) -> Picture:
    image = layered(n)
    layers = [image.layers[0], replace(image.layers[1], name="\U0001f98a" * 255), image.layers[2]]
    return replace(image, layers=type(image.layers)(layers))


@_case("Ancillary chunks of a later version, safe and unsafe to copy, and many empty ones",
       "chunks: ancillary")  # fmt: skip
def _ancillary_public(n: Numbers) -> bytes:
    parts = read(to_bytes(layered(n)))
    later = Chunk("nEWs", b"\xc1" * 999), Chunk("nEWS", msgpack.packb({"a": [None, 1.5]}))
    return write([parts[0], *later, *parts[1:-1], *[Chunk("emTy", b"")] * 300, parts[-1]])


@_case("A tree 1,200 groups deep", "CHK-19", "SEC-5", "MET-11")
def _tree_deep(n: Numbers) -> bytes:
    count = 1200
    groups = [f"{k:x}" for k in range(count)]
    values = {"groups": groups, "parents": [*range(2, count + 2), 0]}
    return with_chunks(_plain(n), Chunk(tree.TYPE, pack(tree.FIELDS, values)))


@_case("A history with chunks and texts of its own, one of them deeply nested",
       "CHK-20", "MET-13", "MET-14", "MET-15", "MET-16")  # fmt: skip
def _undo_chunks(n: Numbers) -> bytes:
    data = _plain(n)
    head = changed(read(data)[0], {"size": [9, 9]})
    steps = [["[" * 5000, [4, 1, 2, 3]], ["{}", [0, 1, 2, 3]]]
    return with_chunks(data, history(data, msgpack.packb([[["HEAD", head.payload]], steps])))


@_case("A history of version 0.2: a map, and bound to the prefix too", "MET-18", "CON-4")
def _undo_0_2(n: Numbers) -> bytes:
    data = with_maps(_plain(n), (0, 2))
    past = history(data, msgpack.packb({"chunks": [], "steps": [["{}", [0, 1, 2, 3]]]}))
    return write([*read(data)[:-1], past, read(data)[-1]], (0, 2))


@_case("A script of a motion that is nested 5,000 deep", "MOT-10", "SEC-1",
       renders=[WHOLE, {"time": 0.4}], name="moves-script-deep")  # fmt: skip
def _script_deep(n: Numbers) -> bytes:
    return scripted(frame(b'{"version":1,"a":', (91, 5000), (93, 5000), b"}"), 10_018)


def scripted(zstd: bytes, size: int) -> bytes:
    """Base file of refused motions, with a script."""
    chunks = [
        changed(c, {"size": size, "script": zstd}) if c.type == motn.TYPE else c
        for c in Moving().chunks
    ]
    return write(chunks)


@_case("A file that is a ZIP archive too, in a private chunk", "CON-9", "CON-12", "REG-3",
       name="polyglot-zip")  # fmt: skip
def _zip(n: Numbers) -> bytes:
    data = to_bytes(layered(n))
    tail = len(write([Chunk("TAIL", b"")])) - PREFIX.size
    archive = io.BytesIO()
    with zipfile.ZipFile(archive, "w") as files:
        entry = zipfile.ZipInfo("a.txt")
        entry.create_system = 3
        files.writestr(entry, "not a picture")
        # The archive ends in a comment, which includes what follows the archive in the file.
        files.comment = bytes(4 + tail)
    packed = archive.getvalue()[: -(4 + tail)]
    return with_chunks(data, Chunk("ziPa", packed))


@_case("A file that is a page and a script too, in private chunks", "CON-9", "CON-12", "REG-3",
       "SEC-1", name="polyglot-html")  # fmt: skip
def _html(n: Numbers) -> bytes:
    parts = read(to_bytes(layered(n)))
    page = b"<html><script>alert(1)</script><img src=x onerror=alert(1)>\n#!/bin/sh\nexit 1\n"
    return write([parts[0], Chunk("htMl", page), *parts[1:-1], Chunk("jsSc", page), parts[-1]])


@_case("Unknown ancillary chunks in every place", "chunks: ancillary")
def _ancillary(n: Numbers) -> bytes:
    out = []
    for i, chunk in enumerate(read(to_bytes(layered(n)))):
        out += [Chunk(("teSt", "prIv", "zzZZ")[i % 3], bytes(range(i)))] if i else []
        out.append(chunk)
    return write(out)


@_case("ICC, EXIF, XMP and a note of the encoder", "chunks: metadata")
def _metadata(n: Numbers) -> bytes:
    image = picture((8, 8), [layer("back", (0, 0, 8, 8), texture(n))], network(n))
    info = {"encoder": "conformance", "settings": '{"a": 1}', "areas": [64]}
    chunks = read(to_bytes(replace(image, info=info)))
    blocks = {"icc": bytes(132), "exif": b"II*\0\x08\0\0\0\0\0\0\0", "xmp": b"<x:xmpmeta/>"}
    added = (metadata(k, v, one_block(v)) for k, v in blocks.items())
    return write([*chunks[:-2], *added, *chunks[-2:]])


@_case("A tree of groups: a layer is drawn where its pose says, whatever its parents' poses",
       "CHK-18", "CHK-19", "MET-11", "MET-12")  # fmt: skip
def _tree(n: Numbers) -> bytes:
    image = layered(n)
    moved = replace(image.layers[1], pose=Pose(**TURN))
    image = replace(image, layers=Layers([image.layers[0], moved, image.layers[2]]))
    values = {"groups": ["all", "some"], "parents": [0, 5, 2, 0, 4]}
    return with_chunks(to_bytes(image), Chunk(tree.TYPE, pack(tree.FIELDS, values)))


@_case("A history of one edit does not change the picture", "CHK-20", "MET-13", "MET-15")
def _undo(n: Numbers) -> bytes:
    data = to_bytes(layered(n))
    # The history has no chunks of its own, and one step "{}" that refers to all chunks of the file.
    count = len(read(data)) - 1
    content = b"\x92\x90\x91\x92\xa2{}" + bytes([0x90 + count, *range(count)])
    return with_chunks(data, history(data, content, zstd=one_block(content)))


@_case("A history of another picture is ignored, whatever it holds", "CHK-20", "MET-14")
def _undo_stale(n: Numbers) -> bytes:
    data = to_bytes(layered(n))
    return with_chunks(data, history(data, b"", state=bytes(32), size=7, zstd=b"rubbish"))

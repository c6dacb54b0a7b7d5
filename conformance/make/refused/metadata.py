"""Refused files with broken metadata, which a decoder that ignores metadata may read [CON-9]."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import msgpack

from proxyimg_codec.container import meta, tree
from proxyimg_codec.container.chunks import Chunk, write

from ..builders import Numbers, layer, network, picture, texture
from ..frames import MAGIC, checksum, frame, metadata
from ..valid.metadata import colour, history, info, scripted, with_chunks
from .base import Base, Row, refused
from .motion import Moving


class Plain(Base):
    """Valid file of two layers."""

    def build(self, n: Numbers) -> Any:
        """Makes the picture of the file."""
        box = 0, 0, 8, 12
        layers = [layer("back", box, texture(n)), layer("front", (2, 2, 3, 3), texture(n))]
        return picture((8, 12), layers, network(n))


CONTENT = b"II*\0\x08\0\0\0\0\0\0\0"


def _block(zstd: bytes, size: int = len(CONTENT), kind: str = "exif") -> Callable[[Base], bytes]:
    """Builder of a file with a metadata block."""
    return lambda b: with_chunks(b.data, metadata(kind, b"", zstd, size=size))


def _array(type_: str, *values: Any) -> Callable[[Base], bytes]:
    """Builder of a file with a chunk that holds an array, valid or not."""
    return lambda b: with_chunks(b.data, Chunk(type_, msgpack.packb(values)))


def _tree(groups: list[str], parents: list[int]) -> Callable[[Base], bytes]:
    return _array(tree.TYPE, groups, parents)


def _history(content: Any, **new: Any) -> Callable[[Base], bytes]:
    """Builder of a file with a history; `content` is packed if it is not bytes."""
    packed = content if isinstance(content, bytes) else msgpack.packb(content)
    return lambda b: with_chunks(b.data, history(b.data, packed, **new))


def _steps(*references: int) -> Callable[[Base], bytes]:
    return _history([[], [["{}", list(references)]]])


def _together(b: Base) -> bytes:
    """File with two blocks that exceed the limit only together."""
    half = 1 << 25
    blocks = ((kind, half + (kind == "xmp")) for kind in ("icc", "xmp"))
    return with_chunks(b.data, *(
        metadata(kind, b"", frame((0, size)), size=size) for kind, size in blocks
    ))  # fmt: skip


def _with_script(b: Base) -> bytes:
    """File with a script, and a block that is as large as is allowed."""
    return with_chunks(b.data, metadata("xmp", b"", frame((0, 1 << 26)), size=1 << 26))


def _with_history(b: Base) -> bytes:
    """File with a block that is as large as is allowed, and a history."""
    data = _with_script(b)
    return with_chunks(data, history(data, msgpack.packb([[], []])))


def _early(b: Base) -> bytes:
    """File with iNFO before the textures."""
    return write([*b.chunks[:-2], info(), *b.chunks[-2:]])


def _twice(b: Base) -> bytes:
    return with_chunks(b.data, metadata("icc", b"a"), metadata("icc", b"a"))


def _many_references(b: Base) -> bytes:
    """File with a history of two steps of almost 2^20 chunks each."""
    count = (1 << 20) - 1
    step = b"\x92\xa0\xdd" + count.to_bytes(4, "big")
    parts = (b"\x92\x90\x92" + step, (0, count), step, (0, count))
    size = len(parts[0]) + len(step) + 2 * count
    return with_chunks(b.data, history(b.data, b"", zstd=frame(*parts), size=size))


def _window(b: Base) -> bytes:
    """File with a frame that needs a window of 2^31 bytes."""
    zstd = frame(CONTENT, window=(31 - 10) << 3)
    return with_chunks(b.data, metadata("exif", CONTENT, zstd))


GOOD = frame(CONTENT)
LAST = MAGIC + bytes([0x20, len(CONTENT)])
"""Header of a frame, before its blocks."""
SKIPPED = b"\x50\x2a\x4d\x18\x01\0\0\0a"
"""A skippable frame."""


# fmt: off
_BLOCKS: list[Row] = [
    ("invalid-block-plain", "a block that is not compressed", "", _block(CONTENT)),
    ("invalid-block-empty", "a block without a frame", "", _block(b"")),
    ("invalid-block-small", "a frame that holds more than its block", "", _block(GOOD, 11)),
    ("invalid-block-large", "a frame that holds less than its block", "", _block(GOOD, 13)),
    ("invalid-block-cut", "a frame that ends early", "", _block(GOOD[:-1])),
    ("invalid-block-cut-head", "a frame that ends in its head", "", _block(GOOD[:6])),
    ("invalid-block-unended", "a frame without a last block", "",
     _block(LAST + (len(CONTENT) << 3).to_bytes(3, "little") + CONTENT)),
    ("invalid-block-after", "a byte after the frame", "", _block(GOOD + b"\0")),
    ("invalid-block-two", "two frames", "", _block(GOOD + GOOD, 2 * len(CONTENT))),
    ("invalid-block-skippable", "a frame to be skipped before the other", "",
     _block(SKIPPED + GOOD)),
    ("invalid-block-kind", "a block of a frame of a kind that does not exist", "",
     _block(LAST + (len(CONTENT) << 3 | 7).to_bytes(3, "little") + CONTENT)),
    ("invalid-block-announced", "a frame that announces more than it holds", "",
     _block(frame(CONTENT, size=99))),
    ("invalid-block-dictionary", "a frame with a dictionary", "",
     _block(MAGIC + b"\xa1\x07" + GOOD[5:])),
    ("invalid-block-checksum", "a frame with a wrong checksum", "",
     _block(frame(CONTENT, checksum=checksum(CONTENT + b"a")))),
    ("invalid-block-bomb", "a block of a byte, in a frame of 64 megabytes", "SEC-6",
     _block(frame((0, 1 << 26)), 1)),
    ("invalid-block-bomb-unsaid", "the same in a frame that announces no size", "SEC-6",
     _block(frame((0, 1 << 26), window=0x28), 1, "icc")),
    ("invalid-block-none", "a block of no bytes", "", _block(frame(b""), 0)),
    ("limit-block", "a block of 64 megabytes and a byte", "SEC-6",
     _block(frame((0, (1 << 26) + 1)), (1 << 26) + 1, "xmp")),
    ("limit-blocks-together", "two blocks of 32 megabytes, and a byte", "SEC-6", _together),
    ("limit-block-history", "a block of 64 megabytes, and a history", "SEC-6", _with_history),
    ("limit-window", "a frame that needs a window of two gigabytes", "SEC-6", _window),
    ("invalid-block-twice", "two profiles", "", _twice),
]

_OTHERS: list[Row] = [
    ("invalid-info-early", "information before the last texture", "", _early),
    ("invalid-info-encoder", "an encoder of 256 characters", "",
     _array(meta.INFO_TYPE, "a" * 256, "", [])),
    ("invalid-info-areas", "areas of one layer of two", "",
     _array(meta.INFO_TYPE, "", "", [7])),
    ("invalid-info-area", "a negative area", "", _array(meta.INFO_TYPE, "", "", [7, -1])),
    ("invalid-info-value", "a value too few", "", _array(meta.INFO_TYPE, "", "")),
    ("invalid-colour-zero", "a colour without primaries", "", _array("cICp", 0, 13)),
    ("invalid-colour-large", "a transfer of 256", "", _array("cICp", 9, 256)),
    ("invalid-colour-few", "a colour of one number", "", _array("cICp", 9)),
    ("invalid-colour-four", "a colour of four numbers", "", _array("cICp", 9, 16, 0, 1)),
    ("invalid-colour-twice", "two colours", "CON-11",
     lambda b: with_chunks(b.data, colour(1, 13), colour(1, 13))),
    ("invalid-tree-layer", "a group with the name of a layer", "", _tree(["front"], [0, 0, 0])),
    ("invalid-tree-name", "two groups of one name", "", _tree(["a", "a"], [0, 0, 0, 0])),
    ("invalid-tree-empty", "a group without a name", "", _tree([""], [0, 0, 0])),
    ("invalid-tree-few", "a parent too few", "", _tree(["a"], [0, 0])),
    ("invalid-tree-many", "a parent too many", "", _tree(["a"], [0, 0, 0, 0])),
    ("invalid-tree-parent", "a parent that does not exist", "", _tree(["a"], [0, 4, 0])),
    ("invalid-tree-self", "a group in itself", "SEC-1", _tree(["a"], [3, 0, 3])),
    ("invalid-tree-layer-self", "a layer in itself", "", _tree(["a"], [0, 2, 0])),
    ("invalid-tree-circle", "three groups in each other", "SEC-1",
     _tree(["a", "b", "c"], [0, 3, 4, 5, 3])),
]

_HISTORIES: list[Row] = [
    ("invalid-undo-state", "a hash of 31 bytes", "",
     _array("uNDO", bytes(31), 3, frame(b"\x92\x90\x90"))),
    ("invalid-undo-plain", "a history that is not compressed", "",
     _history(b"", zstd=b"a", size=1)),
    ("invalid-undo-large", "a history that is shorter than its size", "",
     _history([[], []], size=4)),
    ("invalid-undo-map", "a history that is a map", "MET-15 MET-18",
     _history({"chunks": [], "steps": []})),
    ("invalid-undo-items", "a history of three items", "MET-15", _history([[], [], []])),
    ("invalid-undo-integer", "a history that is an integer", "MET-15", _history(b"\x07")),
    ("invalid-undo-nesting", "a history of arrays nested 5,000 deep", "MET-15 SEC-1",
     _history(b"\x91" * 5000 + b"\0")),
    ("invalid-undo-cut", "a history whose array ends early", "MET-15", _history(b"\x92\x90")),
    ("invalid-undo-long", "a history with a number in two bytes for one", "MET-15",
     _history(b"\x92\x90\x91\x92\xa0\x91\xcc\x00")),
    ("invalid-undo-array", "a history that announces 2^32 chunks", "MET-15 SEC-1",
     _history(b"\x92\xdd\xff\xff\xff\xff")),
    ("invalid-undo-type", "a chunk of a history whose type has three letters", "MET-15",
     _history([[["HEA", b""]], []])),
    ("invalid-undo-payload", "a chunk of a history whose payload is a text", "MET-15",
     _history([[["HEAD", "a"]], []])),
    ("invalid-undo-step", "a step without chunks", "MET-15", _history([[], [["{}"]]])),
    ("invalid-undo-said", "a step whose text is a number", "MET-15", _history([[], [[7, []]]])),
    ("invalid-undo-reference", "a step that refers to a chunk that does not exist", "MET-16",
     _steps(0, 1, 6)),
    ("invalid-undo-negative", "a step that refers to chunk -1", "MET-16", _steps(-1)),
    ("invalid-undo-steps", "4,097 steps", "MET-16", _history([[], [["", []]] * 4097])),
    ("limit-undo", "a history of 64 megabytes and a byte", "SEC-6",
     _history(b"", zstd=frame((0, (1 << 26) + 1)), size=(1 << 26) + 1)),
    ("limit-references", "a history of two million references", "SEC-2", _many_references),
]

_SCRIPTS: list[Row] = [
    ("invalid-script-bomb", "a script of two bytes, in a frame of 64 megabytes", "SEC-6",
     lambda b: scripted(frame((32, 1 << 26)), 2)),
    ("invalid-script-cut", "a script whose frame ends early", "CHK-16",
     lambda b: scripted(frame(b"{}")[:-1], 2)),
    ("invalid-script-after", "a byte after the frame of a script", "CHK-16",
     lambda b: scripted(frame(b"{}") + b"\0", 2)),
]

_MOVING: list[Row] = [
    ("limit-block-script", "a block of 64 megabytes, and a script", "SEC-6", _with_script),
]
# fmt: on

CASES = {
    **refused((*_BLOCKS, *_OTHERS, *_HISTORIES), Plain, optional=True),
    **refused(_SCRIPTS, Plain),
    **refused(_MOVING, Moving, optional=True),
}

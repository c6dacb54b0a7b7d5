"""Prints a `.pxi` file byte by byte with the meaning of every field: `python -m spec.dump FILE`."""

from __future__ import annotations

import argparse
import struct
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import msgpack
import numpy as np

from proxyimg_codec.api import Image, from_bytes
from proxyimg_codec.cli.common import run
from proxyimg_codec.container import chunks
from proxyimg_codec.container.fields import unpack
from proxyimg_codec.container.file import fields_of
from proxyimg_codec.errors import PxiError
from proxyimg_codec.geometry import coverage as cover
from proxyimg_codec.geometry.boundary import Boundary
from proxyimg_codec.geometry.mesh import Refined
from proxyimg_codec.geometry.pose import Pose
from proxyimg_codec.geometry.track import Track
from proxyimg_codec.io.files import naming, read_bytes
from proxyimg_codec.texture.diffusion import fill
from proxyimg_codec.texture.planes import Planes
from proxyimg_codec.texture.pyramid import PyramidTexture, Texture

Piece = tuple[int, str]
"""Number of bytes, and their meaning."""

LINE = 16
"""Bytes in a line."""

LINES = 16
"""Most lines of one piece that are printed; the bytes after them are counted."""


def coded_array(data: bytes) -> Iterator[Piece]:
    """Yields the pieces of a coded array."""
    lanes = 1 << data[0]
    words = int.from_bytes(data[1 + 4 * lanes : 5 + 4 * lanes], "little")
    yield 1, f"rANS stream with 2^{data[0]} lanes"
    yield 4 * lanes, "initial states"
    yield 4, f"{words} words"
    if words:
        yield 2 * words, "words"
    raw = len(data) - 5 - 4 * lanes - 2 * words
    if raw:
        yield raw, "raw bits"


def halves(data: bytes) -> Iterator[Piece]:
    """Yields the pieces of an array of float16."""
    for at in range(0, len(data), LINE):
        part = data[at : at + LINE]
        yield len(part), " ".join(f"{v:g}" for v in struct.unpack(f"<{len(part) // 2}e", part))


def arrays(data: bytes) -> Iterator[Piece]:
    """Yields the pieces of coded arrays, each of which follows its length."""
    at = 0
    while at < len(data):
        size = int.from_bytes(data[at : at + 4], "little")
        yield 4, f"coded array of {size} bytes"
        yield from coded_array(data[at + 4 : at + 4 + size])
        at += 4 + size


def blob(meaning: str) -> Callable[[bytes], Iterator[Piece]]:
    """Function that makes one piece of all bytes."""
    return lambda data: iter([(len(data), meaning)])


BINARY: dict[str, Callable[[bytes], Iterator[Piece]]] = {
    "classes": coded_array,
    "deltas": blob("raw bits"),
    "symbols": coded_array,
    "splits": arrays,
    "node_classes": coded_array,
    "node_deltas": blob("raw bits"),
    "place_classes": coded_array,
    "place_deltas": blob("raw bits"),
    "steps": halves,
    "biases": halves,
    "weights": arrays,
    "stored": coded_array,
    "codes": coded_array,
    "support": coded_array,
    "escapes": blob("7 bits a byte, low first"),
    "data": coded_array,
    "mask": coded_array,
    "curve_classes": coded_array,
    "curve_deltas": blob("raw bits"),
    "shape_classes": coded_array,
    "shape_deltas": blob("raw bits"),
    "script": blob("Zstandard frame"),
    "state": blob("SHA-256"),
    "zstd": blob("Zstandard frame"),
}
"""Functions that divide the bytes of binary fields into pieces, by the name of the field."""


def valid(chunk: chunks.Chunk) -> bool:
    """Whether a chunk has fields, and valid values in all of them."""
    try:
        fields = fields_of(chunk)
        unpack(fields, chunk.payload, "", old=chunk.old)
    except PxiError:
        return False
    return bool(fields)


def structured(payload: bytes, keys: Sequence[str]) -> Iterator[Piece]:
    """Yields the pieces of a payload: a MessagePack array of the values of `keys`, or a map."""
    unpacker = msgpack.Unpacker()
    unpacker.feed(payload)
    in_map = payload[0] < 0x90
    count = unpacker.read_map_header() if in_map else unpacker.read_array_header()
    at = unpacker.tell()
    yield at, f"map of {count} entries" if in_map else f"array of {count} values"
    for i in range(count):
        if in_map:
            key, start = unpacker.unpack(), at
            at = unpacker.tell()
            yield at - start, f"key {key!r}"
            label = "  "
        else:
            key = keys[i]
            label = f"{key}: "
        value, start = unpacker.unpack(), at
        at = unpacker.tell()
        if isinstance(value, bytes):
            yield at - start - len(value), f"{label}{len(value)} bytes"
            if value:
                yield from BINARY[key](value)
        else:
            yield at - start, f"{label}{value!r}"


def pieces(data: bytes) -> Iterator[Piece]:
    """Yields the pieces of a whole file.

    Raises:
        PxiError: The framing is damaged.
    """
    yield 8, "signature"
    yield 1, f"major version {data[8]}"
    yield 1, f"minor version {data[9]}"
    yield 2, "reserved"
    for chunk in chunks.read(data):
        yield 0, ""
        yield 4, f"chunk {chunk.type}"
        yield 4, f"payload of {len(chunk.payload)} bytes"
        if valid(chunk):
            yield from structured(chunk.payload, [f.key for f in fields_of(chunk)])
        elif chunk.payload:
            yield len(chunk.payload), "payload"
        yield 4, "CRC-32"


def dump(data: bytes) -> Iterator[str]:
    """Yields lines of offset, bytes and meaning.

    Raises:
        PxiError: The framing is damaged.
    """
    at = 0
    for size, meaning in pieces(data):
        if not size:
            yield ""
        for i in range(at, min(at + size, at + LINE * LINES), LINE):
            row = data[i : min(i + LINE, at + size)].hex(" ")
            yield f"{i:06x}  {row:{3 * LINE}} {meaning if i == at else ''}".rstrip()
        if size > LINE * LINES:
            yield f"        ... {size - LINE * LINES} more bytes"
        at += size


def grid(values: np.ndarray, shown: np.ndarray | None = None) -> Iterator[str]:
    """Yields the lines of a matrix of integers.

    Args:
        values: int [rows, columns].
        shown: bool [rows, columns]; a dot is printed where it is false. None for all true.
    """
    cells = [
        [str(v) if shown is None or shown[y, x] else "." for x, v in enumerate(row)]
        for y, row in enumerate(values)
    ]
    width = max(len(cell) for row in cells for cell in row)
    for row in cells:
        yield "  " + " ".join(cell.rjust(width) for cell in row)


def points(pairs: np.ndarray, a_line: int = 8) -> Iterator[str]:
    """Yields the lines of tuples of integers.

    Args:
        pairs: int [N, k].
        a_line: Tuples in a line.
    """
    for at in range(0, len(pairs), a_line):
        yield "  " + " ".join(str(tuple(p)) for p in pairs[at : at + a_line].tolist())


def mesh_values(name: str, refined: Refined) -> Iterator[str]:
    """Yields the lines of the nodes and faces of a layer."""
    yield f"layer {name!r}, {len(refined.nodes)} nodes in 1/1024 pixel"
    yield from points(refined.nodes)
    yield f"layer {name!r}, {len(refined.faces)} faces"
    yield from points(refined.faces)


def pose_values(name: str, pose: Pose) -> Iterator[str]:
    """Yields the lines of the pose of a layer that is not at rest."""
    yield f"layer {name!r}, pose"
    yield f"  matrix {list(pose.matrix)} shift {list(pose.shift)}"
    yield f"  opacity {pose.opacity} hidden {int(pose.hidden)}"
    if pose.colour:
        yield f"  colour {list(pose.colour)}"
    for what, moved in (("nodes", pose.nodes), ("texture", pose.places)):
        if moved is not None:
            yield f"layer {name!r}, displacements of the {what} in 1/16 pixel"
            yield from points(moved)


def track_values(name: str, track: Track) -> Iterator[str]:
    """Yields the lines of the curves and shapes of a layer that moves."""
    yield f"layer {name!r}, body {track.body}, coefficients of curves in 1/256"
    yield from grid(track.curves)
    for k, shape in enumerate(track.shapes):
        yield f"layer {name!r}, shape {k}"
        yield from points(shape)


def shape_values(name: str, outline: Boundary, width: int, height: int) -> Iterator[str]:
    """Yields the lines of the outline of a layer, and of its coverage of the canvas."""
    for k, path in enumerate(outline.paths):
        yield f"layer {name!r}, control points of path {k}"
        yield "  " + " ".join(f"({x}, {y})" for x, y in path)
    scaled = [
        np.stack([cover.to_output(p[:, i], outline.unit, 0, n, n)
                  for i, n in enumerate((width, height))], axis=1)
        for p in outline.paths
    ]  # fmt: skip
    yield f"layer {name!r}, coverage of the canvas in 1/{cover.FULL}"
    yield from grid(cover.coverage(scaled, 0, 0, width, height))


def planes_values(number: int, planes: Planes) -> Iterator[str]:
    """Yields the lines of the latents of planes."""
    levels, lowest = planes.latents
    for colour in range(planes.components):
        yield f"planes {number}, lowest plane of colour {colour}"
        yield from grid(lowest[colour])
    for level in range(len(levels), 0, -1):
        for channel, latents in enumerate(levels[level - 1]):
            if channel < 3 or level > planes.packed["grey"]:
                yield f"planes {number}, level {level}, latents of channel {channel}"
                yield from grid(latents)


def texture_values(name: str, texture: Texture) -> Iterator[str]:
    """Yields the lines of stored and filled codes, or of the samples that a view shows."""
    if isinstance(texture, PyramidTexture):
        if texture.shown is not None:
            yield f"layer {name!r}, samples that show"
            yield from grid(texture.shown.astype(int))
        return
    filled = fill(texture.codes, texture.stored)
    for f, codes in enumerate(texture.codes):
        yield f"layer {name!r}, codes of feature {f}"
        yield from grid(codes, texture.stored)
        if not texture.stored.all():
            yield f"layer {name!r}, filled codes of feature {f}"
            yield from grid(filled[f])


def values(image: Image) -> Iterator[str]:
    """Yields the lines of all integers that a small file decodes to."""
    for i, network in enumerate(image.networks):
        for k, weights in enumerate(network.weights):
            yield f"network {i}, weights of linear layer {k}"
            yield from grid(weights)
    for i, planes in enumerate(image.planes):
        yield from planes_values(i, planes)
    shown: dict[Texture, str] = {}
    for layer in image.layers:
        if layer.mesh is not None:
            yield from mesh_values(layer.name, layer.mesh.refined)
        if not layer.pose.at_rest:
            yield from pose_values(layer.name, layer.pose)
        if layer.track is not None:
            yield from track_values(layer.name, layer.track)
        if layer.outline is not None:
            yield from shape_values(layer.name, layer.outline, image.width, image.height)
        if layer.texture in shown:
            yield f"layer {layer.name!r} shows the texture of {shown[layer.texture]!r}"
            continue
        shown[layer.texture] = layer.name
        yield from texture_values(layer.name, layer.texture)


def main(argv: list[str] | None = None) -> int:
    """Entry point; returns the exit code."""
    parser = argparse.ArgumentParser(prog="spec.dump", description=__doc__)
    parser.add_argument("file", type=Path)
    parser.add_argument("--values", action="store_true", help="print the decoded integers instead")
    args = parser.parse_args(argv)

    def write() -> None:
        with naming(args.file):
            data = read_bytes(args.file)
            for line in values(from_bytes(data)) if args.values else dump(data):
                print(line)

    return run("spec.dump", write)


if __name__ == "__main__":
    sys.exit(main())

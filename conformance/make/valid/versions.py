"""Valid cases of files of earlier versions."""

from __future__ import annotations

from dataclasses import replace

import msgpack

from proxyimg_codec.codec.write import to_bytes
from proxyimg_codec.container import plan
from proxyimg_codec.container.chunks import Chunk, read, write
from proxyimg_codec.geometry.pose import Pose

from ..builders import (
    Numbers,
    bend,
    disc,
    grid_mesh,
    layered,
    on_back,
    with_maps,
)
from ..registry import Valids
from .views import pieces

CASES = Valids()
_case = CASES.case


@_case("A file of version 0.1, of maps", "file: version", "fields: maps")
def _version_0_1(n: Numbers) -> bytes:
    return with_maps(to_bytes(layered(n)), (0, 1))


@_case("A file of version 0.2, of maps, with a mesh and a pose", "file: version", "fields: maps")
def _version_0_2(n: Numbers) -> bytes:
    mesh = grid_mesh((2, 1), 5, 4)
    return with_maps(to_bytes(on_back(n, disc(n, mesh, nodes=bend(n, mesh)))), (0, 2))


@_case("A file of version 0.3 with maps, but arrays in the layers", "file: version", "fields: maps")
def _version_0_3(n: Numbers) -> bytes:
    return with_maps(to_bytes(layered(n)), (0, 3), without=["LAYR"])


@_case("A file of version 0.9", "file: version")
def _version_0_9(n: Numbers) -> bytes:
    return write(read(to_bytes(layered(n))), (0, 9))


@_case("A file of version 0.10, whose pyramid textures end with cuts", "file: version", "CON-19",
       "pyramid: cuts")  # fmt: skip
def _version_0_10(n: Numbers) -> bytes:
    """With what was possible in it alone."""
    chunks = [
        replace(c, payload=msgpack.packb(msgpack.unpackb(c.payload)[:7])) if c.type == "TEXR" else c
        for c in planes_first(to_bytes(pieces(n, {"disc": Pose(shift=(3 * 1024, -900))})))
    ]
    return write(chunks, (0, 10))


def planes_first(data: bytes) -> list[Chunk]:
    """Chunks of a file as they were in 0.11: PLAN is short, and stands before TEXR without matte.

    Args:
        data: File of the present version.
    """
    chunks = []
    for chunk in read(data):
        if chunk.type == plan.TYPE:
            *values, _, _, escapes, stream = msgpack.unpackb(chunk.payload)
            chunk = replace(chunk, payload=msgpack.packb([*values, escapes, stream]))
        elif chunk.type == "TEXR":
            chunk = replace(chunk, payload=msgpack.packb(msgpack.unpackb(chunk.payload)[:13]))
        chunks.append(chunk)
    order = ["HEAD", "LAYR", "MESH", "POSE", "NETW", "PLAN", "TEXR"]
    return sorted(chunks, key=lambda c: order.index(c.type) if c.type in order else len(order))


@_case("A file of version 0.11, whose pyramid textures end with unmix", "file: version", "CON-19",
       "CON-20", "pyramid: cuts")  # fmt: skip
def _version_0_11(n: Numbers) -> bytes:
    moved = pieces(n, {"disc": Pose(shift=(3 * 1024, -900))})
    return write(planes_first(to_bytes(moved)), (0, 11))


@_case("A file of version 0.2 with arrays", "file: version", "fields: maps")
def _arrays_0_2(n: Numbers) -> bytes:
    return write(read(to_bytes(layered(n))), (0, 2))

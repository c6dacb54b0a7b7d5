"""Conversion of the fields of chunks to a picture; the inverse is `pack`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from ..container import meta, texr
from ..container.chunks import PADDING
from ..container.content import Container
from ..errors import FormatError
from ..geometry import boundary as boundaries
from ..geometry import pose as poses
from ..geometry import track as tracks
from ..geometry.boundary import Boundary
from ..geometry.mesh import Mesh
from ..geometry.pose import REST
from ..geometry.track import Timeline, Track
from ..limits import Budget
from ..model import Layer, Layers, Picture
from ..texture import implicit, network, planes, pyramid
from ..texture.network import Network
from ..texture.occlusion import Occlusion
from ..texture.planes import Planes
from ..texture.pyramid import Texture


def unpack(c: Container, budget: Budget, damage: tuple[str, ...] = ()) -> Picture:
    """Unpacks the picture of a parsed file.

    Args:
        c: The parsed and checked file.
        budget: Running budget of the file, which meshes go on to spend when they are decoded.
        damage: Descriptions of the damage that was tolerated.

    Raises:
        FormatError: The file breaks the format.
        UnsupportedError: The file needs a newer reader.
        LimitError: The file exceeds `budget`.
    """
    networks = tuple(network.unpack(v, f"chunk NETW {i}") for i, v in enumerate(c.networks))
    meshes = {
        v["layer"]: Mesh({k: w for k, w in v.items() if k != "layer"}, f"chunk MESH {i}", budget)
        for i, v in enumerate(c.meshes)
    }
    posed = {
        v["layer"]: poses.decode(v, meshes.get(v["layer"]), f"chunk POSE {i}")
        for i, v in enumerate(c.poses)
    }
    timeline, moves = motion(c.motion, meshes, budget)
    parents, groups = _parents(c)
    outlines = [boundaries.decode(v, f"chunk LAYR {i}") for i, v in enumerate(c.layers)]
    sources = tuple(planes.unpack(v, f"chunk PLAN {i}") for i, v in enumerate(c.planes))
    textures = _textures(c, networks, sources, outlines)
    layers = [
        Layer(
            v["name"], _box(v), outlines[i], textures[i], meshes.get(i), v["sampling"],
            posed.get(i, REST), parents[i], moves.get(i),
        )
        for i, v in enumerate(c.layers)
    ]  # fmt: skip
    width, height = c.head["size"]
    return Picture(
        width, height, c.head["channels"], bool(c.head["opaque"]), c.head["depth"],
        Layers(layers), networks, _blocks(c), c.info,
        tuple(chunk for chunk in c.extra if chunk.type != PADDING),
        groups, timeline, c.history, damage, sources,
    )  # fmt: skip


def _blocks(c: Container) -> Mapping[str, bytes]:
    """Metadata blocks; ``cicp`` in the form that PNG has."""
    if c.cicp is None:
        return c.blocks
    return {**c.blocks, "cicp": bytes([c.cicp["primaries"], c.cicp["transfer"], 0, 1])}


def _parents(c: Container) -> tuple[list[str | None], dict[str, str | None]]:
    """Parents of all layers, in their order, and of all groups, by name."""
    if c.tree is None:
        return [None] * len(c.layers), {}
    groups = c.tree["groups"]
    nodes = [None, *(v["name"] for v in c.layers), *groups]
    parents = [nodes[k] for k in c.tree["parents"]]
    count = len(c.layers)
    return parents[:count], dict(zip(groups, parents[count:], strict=True))


def _textures(
    c: Container,
    networks: tuple[Network, ...],
    sources: tuple[Planes, ...],
    outlines: list[Boundary | None],
) -> list[Texture]:
    """Textures of all layers; layers that share a texture get the same object."""
    textures: list[Texture] = []
    for i, (layer, v) in enumerate(zip(c.layers, c.textures, strict=True)):
        where = f"chunk TEXR {i}"
        if v["coder"] == texr.SHARED:
            textures.append(textures[v["texture"]])
        elif v["coder"] == texr.PYRAMID:
            cuts = Occlusion.of(v["cuts"], i, outlines, _box(layer))
            cuts = cuts and replace(cuts, unmix=bool(v["unmix"]))
            textures.append(pyramid.unpack(v, sources, where, cuts))
        else:
            textures.append(implicit.unpack(v, networks, where, layer["sampling"]))
    return textures


def _box(layer: Mapping[str, Any]) -> tuple[int, int, int, int]:
    x, y, width, height = layer["box"]
    return x, y, width, height


def motion(
    fields: Mapping[str, Any] | None, meshes: Mapping[int, Mesh], budget: Budget
) -> tuple[Timeline | None, dict[int, Track]]:
    """Decodes the motion of a picture.

    Args:
        fields: Values of mOTN; None if there is no such chunk.
        meshes: Meshes by the number of their layer.
        budget: Running budget of the file.

    Returns:
        The timeline, or None, and the tracks of the layers that move, by the number of the layer.

    Raises:
        FormatError: The chunk is corrupt.
        LimitError: The motion exceeds `budget`.
    """
    if fields is None:
        return None, {}
    where = "chunk mOTN"
    script = b""
    if fields["size"]:
        script = meta.decompressed(fields["size"], fields["script"], where, budget, "MOT-1")
    try:
        text = script.decode()
    except UnicodeDecodeError:
        raise FormatError("the script is not UTF-8", where, rule="MOT-10") from None
    numbers = fields["layers"]
    timeline = Timeline(
        fields["duration"], fields["fps"], bool(fields["loop"]), fields["intervals"],
        fields["unit"], text,
    )  # fmt: skip
    curves, shapes = (
        (fields[f"{name}_classes"], fields[f"{name}_deltas"]) for name in ("curve", "shape")
    )
    refined = [meshes[n].refined for n in numbers]
    found = tracks.decode(curves, shapes, fields["modes"], timeline, refined, where, budget)
    bodies = zip(found, fields["bodies"], strict=True)
    return timeline, dict(zip(numbers, (replace(t, body=b) for t, b in bodies), strict=True))

"""Pictures in memory <-> the fields of their chunks."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from dataclasses import replace
from typing import Any

from ..container import meta, texr
from ..container.chunks import Chunk
from ..container.fields import pack as packed
from ..container.file import Container
from ..errors import FormatError
from ..geometry import boundary as boundaries
from ..geometry import pose as posing
from ..geometry import track as tracks
from ..geometry.mesh import Mesh
from ..geometry.pose import REST
from ..geometry.track import Timeline, Track
from ..image import Image, Layer, Layers
from ..limits import Limits
from ..texture import implicit, network, planes, pyramid
from ..texture.cuts import Cuts
from ..texture.implicit import ImplicitTexture
from ..texture.planes import Planes
from ..texture.pyramid import Texture

_PADDING = "paDD"


def padding(size: int) -> Chunk:
    """A chunk of `size` bytes that lengthens a file too small for what it holds (SEC-3)."""
    return Chunk(_PADDING, bytes(size))


def pack(image: Image) -> Container:
    """The fields of all chunks of a picture."""
    meshes = [(i, v.mesh) for i, v in enumerate(image.layers) if v.mesh is not None]
    poses = [(i, v) for i, v in enumerate(image.layers) if not v.pose.at_rest]
    return Container(
        {
            "size": [image.width, image.height],
            "channels": image.channels,
            "opaque": int(image.opaque),
            "depth": image.depth,
            "layers": len(image.layers),
            "networks": len(image.networks),
        },
        tuple(
            {
                "name": v.name,
                "box": list(v.box),
                "sampling": v.sampling,
                **boundaries.encode(v.boundary),
            }
            for v in image.layers
        ),
        tuple(n.packed for n in image.networks),
        _textures(image),
        tuple(p.packed for p in image.planes),
        tuple({"layer": i, **m.fields} for i, m in meshes),
        tuple({"layer": i, **posing.encode(v.pose, v.mesh)} for i, v in poses),
        _tree(image),
        _motion(image),
        image.history,
        image.blocks,
        image.info,
        image.extra,
    )


def _textures(image: Image) -> tuple[Mapping[str, Any], ...]:
    """Fields of each TEXR; what is equal to an earlier one refers to it."""
    first: dict[Hashable, int] = {}
    numbers = {p: k for k, p in enumerate(image.planes)}
    out: list[Mapping[str, Any]] = []
    for i, layer in enumerate(image.layers):
        at = first.get(layer.texture)
        if at is None:
            fields, meaning = _texture(image, i, numbers)
            key = (packed(texr.CODERS[fields["coder"]], fields), meaning)
            at = first[layer.texture] = first.setdefault(key, i)
        out.append(fields if at == i else {"coder": texr.SHARED, "texture": at})
    return tuple(out)


def _texture(
    image: Image, number: int, planes: Mapping[Planes, int]
) -> tuple[Mapping[str, Any], Hashable]:
    """Fields of a layer's TEXR, and what else they depend on for their meaning."""
    shown = image.layers[number].texture
    if isinstance(shown, ImplicitTexture):
        return shown.packed, None
    if shown.cuts is None:
        return shown.fields(planes), None
    cuts = shown.cuts.numbers(number, [v.boundary for v in image.layers])
    assert cuts is not None, "views whose cuts are gone have a mask"
    return shown.fields(planes, cuts), (shown.cuts.box, number in cuts)


def _tree(image: Image) -> dict[str, Any] | None:
    above = [layer.parent for layer in image.layers] + list(image.groups.values())
    if not image.groups and not any(above):
        return None
    number = {n: i + 1 for i, n in enumerate([*(v.name for v in image.layers), *image.groups])}
    return {
        "groups": list(image.groups),
        "parents": [0 if name is None else number[name] for name in above],
    }


def _motion(image: Image) -> dict[str, Any] | None:
    moving = [(i, v.track, v.mesh) for i, v in enumerate(image.layers) if v.track and v.mesh]
    line = image.timeline
    if line is None or not moving:
        return None
    curves, shapes = tracks.encode([(track, mesh.refined) for _, track, mesh in moving])
    script = line.script.encode()
    return {
        "duration": line.duration,
        "fps": line.fps,
        "loop": int(line.loop),
        "intervals": line.intervals,
        "unit": line.unit,
        "layers": [i for i, _, _ in moving],
        "bodies": [track.body for _, track, _ in moving],
        "modes": len(moving[0][1].curves),
        "curve_classes": curves[0],
        "curve_deltas": curves[1],
        "shape_classes": shapes[0],
        "shape_deltas": shapes[1],
        "size": len(script),
        "script": meta.compressed(script) if script else b"",
    }


def unpack(c: Container, limits: Limits, damage: tuple[str, ...] = ()) -> Image:
    """The picture of a parsed file.

    Raises:
        FormatError: The file breaks the format.
        UnsupportedError: It needs a newer reader.
        LimitError: It exceeds `limits`.
    """
    limits = limits.budget()
    networks = tuple(network.unpack(v, f"chunk NETW {i}") for i, v in enumerate(c.networks))
    meshes = {
        v["layer"]: Mesh({k: w for k, w in v.items() if k != "layer"}, f"chunk MESH {i}", limits)
        for i, v in enumerate(c.meshes)
    }
    poses = {
        v["layer"]: posing.decode(v, meshes.get(v["layer"]), f"chunk POSE {i}")
        for i, v in enumerate(c.poses)
    }
    timeline, moves = moving(c.motion, meshes, limits)
    groups = c.tree["groups"] if c.tree else []
    nodes = [None, *(v["name"] for v in c.layers), *groups]
    parents = [nodes[k] for k in c.tree["parents"]] if c.tree else [None] * len(c.layers)
    sources = [planes.unpack(v, f"chunk PLAN {i}") for i, v in enumerate(c.planes)]
    outlines = [boundaries.decode(v, f"chunk LAYR {i}") for i, v in enumerate(c.layers)]
    boxes = [(v["box"][0], v["box"][1], v["box"][2], v["box"][3]) for v in c.layers]
    textures: list[Texture] = []
    for i, (v, t) in enumerate(zip(c.layers, c.textures, strict=True)):
        if t["coder"] == texr.SHARED:
            textures.append(textures[t["texture"]])
        elif t["coder"] == texr.PYRAMID:
            cuts = Cuts.of(t["cuts"], i, outlines, boxes[i])
            textures.append(pyramid.unpack(t, sources, f"chunk TEXR {i}", cuts))
        else:
            textures.append(implicit.unpack(t, networks, f"chunk TEXR {i}", v["sampling"]))
    layers = [
        Layer(
            v["name"],
            box,
            outline,
            texture,
            meshes.get(i),
            v["sampling"],
            poses.get(i, REST),
            parent,
            moves.get(i),
        )
        for i, (v, box, outline, texture, parent) in enumerate(
            zip(c.layers, boxes, outlines, textures, parents[: len(c.layers)], strict=True)
        )
    ]
    width, height = c.head["size"]
    return Image(
        width, height, c.head["channels"], bool(c.head["opaque"]), c.head["depth"],
        Layers(layers), networks, c.blocks, c.info,
        tuple(chunk for chunk in c.extra if chunk.type != _PADDING),
        dict(zip(groups, parents[len(c.layers) :], strict=True)), timeline, c.history, damage,
    )  # fmt: skip


def moving(
    fields: Mapping[str, Any] | None, meshes: Mapping[int, Mesh], limits: Limits
) -> tuple[Timeline | None, dict[int, Track]]:
    """The timeline of mOTN, and the track of each layer that moves, by its number.

    Raises:
        FormatError: The chunk is corrupt.
        LimitError: It exceeds `limits`.
    """
    if fields is None:
        return None, {}
    where = "chunk mOTN"
    script = b""
    if fields["size"]:
        script = meta.decompressed(fields["size"], fields["script"], where, limits, "MOT-1")
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
    found = tracks.decode(curves, shapes, fields["modes"], timeline, refined, where, limits)
    bodies = zip(found, fields["bodies"], strict=True)
    return timeline, dict(zip(numbers, (replace(t, body=b) for t, b in bodies), strict=True))

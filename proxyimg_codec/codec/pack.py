"""Conversion of a picture to the fields of its chunks; the inverse is `unpack`."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from dataclasses import replace
from typing import Any

from ..container import meta, texr
from ..container.content import Container
from ..container.fields import pack as packed
from ..geometry import boundary as boundaries
from ..geometry import pose as poses
from ..geometry import track as tracks
from ..model import Layers, Picture
from ..render.neighbours import settled
from ..texture.implicit import ImplicitTexture
from ..texture.planes import Planes


def pack(picture: Picture) -> Container:
    """Packs a picture to the fields of all its chunks."""
    # Edits have done so; a picture whose layers were replaced by hand may name cuts that are gone.
    picture = replace(picture, layers=Layers(settled(picture.layers)))
    meshes = [(i, v.mesh) for i, v in enumerate(picture.layers) if v.mesh is not None]
    posed = [(i, v) for i, v in enumerate(picture.layers) if not v.pose.at_rest]
    return Container(
        {
            "size": [picture.width, picture.height],
            "channels": picture.channels,
            "opaque": int(picture.opaque),
            "depth": picture.depth,
            "layers": len(picture.layers),
            "networks": len(picture.networks),
        },
        tuple(
            {
                "name": v.name,
                "box": list(v.box),
                "sampling": v.sampling,
                **boundaries.encode(v.boundary),
            }
            for v in picture.layers
        ),
        tuple(n.packed for n in picture.networks),
        _textures(picture),
        tuple(p.packed for p in picture.planes),
        tuple({"layer": i, **m.fields} for i, m in meshes),
        tuple({"layer": i, **poses.encode(v.pose, v.mesh)} for i, v in posed),
        _tree(picture),
        _motion(picture),
        picture.history,
        {k: v for k, v in picture.blocks.items() if k != "cicp"},
        _cicp(picture),
        picture.info,
        picture.extra,
    )


def _cicp(picture: Picture) -> Mapping[str, Any] | None:
    """Fields of cICp; None for a picture without the block."""
    block = picture.blocks.get("cicp")
    return None if block is None else {"primaries": block[0], "transfer": block[1]}


def _textures(picture: Picture) -> tuple[Mapping[str, Any], ...]:
    """Fields of each TEXR; a texture equal to an earlier one becomes a reference to that."""
    first: dict[Hashable, int] = {}
    numbers = {p: k for k, p in enumerate(picture.planes)}
    out: list[Mapping[str, Any]] = []
    for i, layer in enumerate(picture.layers):
        at = first.get(layer.texture)
        if at is None:
            fields, meaning = _texture(picture, i, numbers)
            key = (packed(texr.CODERS[fields["coder"]], fields), meaning)
            at = first[layer.texture] = first.setdefault(key, i)
        out.append(fields if at == i else {"coder": texr.SHARED, "texture": at})
    return tuple(out)


def _texture(
    picture: Picture, number: int, planes: Mapping[Planes, int]
) -> tuple[Mapping[str, Any], Hashable]:
    """Fields of the TEXR of a layer, and a key for what else decides their meaning."""
    shown = picture.layers[number].texture
    if isinstance(shown, ImplicitTexture):
        return shown.packed, None
    if shown.cuts is None:
        return shown.fields(planes), None
    cuts = shown.cuts.numbers(number, [v.boundary for v in picture.layers])
    assert cuts is not None, "views whose cuts are gone have a mask"
    return shown.fields(planes, cuts), (shown.cuts.box, number in cuts)


def _tree(picture: Picture) -> dict[str, Any] | None:
    above = [layer.parent for layer in picture.layers] + list(picture.groups.values())
    if not picture.groups and not any(above):
        return None
    number = {n: i + 1 for i, n in enumerate([*(v.name for v in picture.layers), *picture.groups])}
    return {
        "groups": list(picture.groups),
        "parents": [0 if name is None else number[name] for name in above],
    }


def _motion(picture: Picture) -> dict[str, Any] | None:
    moving = [(i, v.track, v.mesh) for i, v in enumerate(picture.layers) if v.track and v.mesh]
    line = picture.timeline
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

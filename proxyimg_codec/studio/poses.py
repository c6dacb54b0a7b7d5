"""Motions for the page: those that it asks for, and poses of all frames, packed."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..animate import animate, presets
from ..animate.motion import Motion
from ..errors import UsageError
from ..geometry.mesh import FRACTION_BITS
from ..limits import DEFAULT_LIMITS
from ..model import Picture
from .drawing import mesh
from .jobs import Job

_OPTIONS = ("duration", "fps", "loop", "seed")


def motion_of(picture: Picture, asked: Mapping[str, Any]) -> Motion:
    """Motion that a request asks for.

    Args:
        picture: The picture that is to move.
        asked: ``motion``, as in a motion file; if it names a preset, ``layers`` (names, or None for
            all), ``together`` and ``pins`` (as those of a layer in a motion file), and what else
            ``motion`` has replaces the values of the preset.

    Raises:
        UsageError: It is not valid, or does not fit the picture.
    """
    values = asked.get("motion")
    if not isinstance(values, dict):
        raise UsageError("motion: must be an object, as in a motion file")
    boxes = animate.boxes(picture)
    if "preset" in values:
        values = _from_preset(picture, values, asked)
    return Motion.from_json(json.dumps(values), boxes, picture.size)


def _from_preset(
    picture: Picture, values: Mapping[str, Any], asked: Mapping[str, Any]
) -> dict[str, Any]:
    """JSON values of a motion that names no preset."""
    names, together = asked.get("layers"), asked.get("together", True)
    if names is not None and not (isinstance(names, list) and all(map(_is_name, names))):
        raise UsageError("layers: must be names of layers, or null for all")
    if not isinstance(values["preset"], str) or not isinstance(together, bool):
        raise UsageError("preset: must be a name, and together true or false")
    given = {k: values[k] for k in _OPTIONS if k in values}
    for key, value in given.items():
        if not isinstance(value, (int, float)):
            raise UsageError(f"{key}: must be a number")
    made = animate.preset(picture, values["preset"], names, together=together, **given).to_dict()
    rest = {k: v for k, v in values.items() if k not in ("preset", "layers", *_OPTIONS)}
    if isinstance(rest.get("wind"), dict):
        rest["wind"] = {**made.get("wind", {}), **rest["wind"]}
    if asked.get("pins") is not None:
        for layer in made["layers"].values():
            layer["pins"] = asked["pins"]
    own = values.get("layers")
    for name, layer in made["layers"].items():
        more = own.get(name, own.get("*")) if isinstance(own, dict) else None
        if isinstance(more, dict):
            made["layers"][name] = {**layer, **more}
    return {**made, **rest}


def _is_name(value: Any) -> bool:
    return isinstance(value, str)


def known_presets() -> list[dict[str, Any]]:
    """Presets with their meaning, and the pins and wind of a layer of 100 pixels."""
    found = []
    for name, make in presets.PRESETS.items():
        values = make({"": (0.0, 0.0, 100.0, 100.0)}, 141.0, 4.0)
        layer = values["layers"][""]
        found.append({
            "name": name,
            "meaning": (make.__doc__ or "").splitlines()[0],
            "pins": layer.get("pins", []),
            "material": layer.get("material"),
            "wind": values.get("wind"),
        })  # fmt: skip
    return found


def packed(picture: Picture) -> bytes:
    """Displacements of all nodes in all frames of the motion of a picture; see `README.md`.

    Raises:
        UsageError: The picture does not move.
        LimitError: They are more than a reader accepts.
    """
    timeline = picture.timeline
    if timeline is None:
        raise UsageError("the picture does not move; give it a motion first")
    moving = [(k, v) for k, v in enumerate(picture.layers) if v.track is not None]
    counts = [len(v.mesh.refined.nodes) if v.mesh else 0 for _, v in moving]
    DEFAULT_LIMITS.check("output_pixels", timeline.frames * sum(counts))
    layers, parts, offset = [], [], 0
    for (k, layer), count in zip(moving, counts, strict=True):
        assert layer.track is not None, "it is one of those that move"
        poses = [layer.track.at(timeline, f / timeline.fps) for f in range(timeline.frames)]
        parts.append((np.stack(poses) / (1 << FRACTION_BITS)).astype("<f4").tobytes())
        entry = {"index": k, "name": layer.name, "nodes": count, "offset": offset}
        layers.append({**entry, "mesh": mesh(picture, layer)})
        offset += len(parts[-1])
    return _joined(
        {
            "fps": timeline.fps, "frames": timeline.frames, "loop": timeline.loop,
            "seconds": timeline.seconds, "layers": layers,
        },
        parts,
    )  # fmt: skip


def _joined(header: Mapping[str, Any], parts: Sequence[bytes]) -> bytes:
    text = json.dumps(header, ensure_ascii=False).encode()
    text += b" " * (-len(text) % 4)
    return b"".join([len(text).to_bytes(4, "little"), text, *parts])


def moving(picture: Picture, motion: Motion, job: Job) -> Picture:
    """Simulates a motion; returns the picture with it.

    Raises:
        PxiError: As `animate.animate`, or the job was cancelled.
    """
    return animate.animate(picture, motion, lambda done, total: job.report("motion", done, total))

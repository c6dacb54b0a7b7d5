"""Motion of a picture as data for the simulation, which is read from JSON and written as JSON.

The JSON Schema is `motion.schema.json` beside this module. Lengths are canvas pixels with y down,
times are seconds.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

from ..errors import InputError, UsageError
from . import presets
from .materials import MATERIALS, Material
from .motion_types import (
    Attachment,
    Collide,
    Disc,
    Handle,
    Impulse,
    Key,
    LayerMotion,
    Pair,
    Rectangle,
    Spot,
    Wind,
)
from .presets import PRESETS, Box, Size
from .schema import check

__all__ = ["PRESETS", "Attachment", "Box", "Collide", "Disc", "Handle", "Impulse", "Key",
           "LayerMotion", "Motion", "Rectangle", "Spot", "Wind", "preset"]  # fmt: skip

STEPS_MAX = 100_000
"""Most steps of simulation in the duration of a motion."""

RATE_MIN = 96
"""Least number of steps of simulation per second, whatever the frame rate."""

_FREE = Collide()


@dataclass(frozen=True)
class Motion:
    """Motion of a picture.

    Attributes:
        layers: Motion of each layer, by name; ``*`` stands for every layer that is not named.
        duration: Duration, or period of the loop, in seconds.
        fps: Frames per second.
        loop: Whether the first frame follows the last; impulses and handles then repeat.
        seed: Seed of the wind.
        substeps: Least number of steps of simulation per frame; there are at least 96 per second.
        gravity: Acceleration in pixels per second squared.
        drag: Rate at which air slows layers down, in 1/s, in addition to that of their materials.
        wind: The wind, or None.
        collide: Collisions to simulate.
        attachments: Attachments of layers to each other.
        together: Whether layers that touch, and have the same motion, move as one body.

    Raises:
        UsageError: A value is out of range, or values contradict each other; the message says the
            place.
    """

    layers: Mapping[str, LayerMotion]
    duration: float = 4.0
    fps: int = 24
    loop: bool = True
    seed: int = 0
    substeps: int = 4
    gravity: Pair = (0.0, 0.0)
    drag: float = 0.5
    wind: Wind | None = None
    collide: Collide = _FREE
    attachments: tuple[Attachment, ...] = ()
    together: bool = False

    def __post_init__(self) -> None:
        check(self.to_dict())
        _check_times(self)
        if self.wind and not any(self.wind.direction):
            raise UsageError("wind.direction: 0, 0 points nowhere")
        for i, a in enumerate(self.attachments):
            if a.layers[0] == a.layers[1]:
                raise UsageError(f"attachments[{i}].layers: {a.layers[0]!r} is named twice")

    @property
    def frames(self) -> int:
        """Number of frames, at least 1."""
        return max(1, round(self.duration * self.fps))

    @property
    def steps(self) -> int:
        """Number of steps of simulation per frame."""
        return max(self.substeps, math.ceil(RATE_MIN / self.fps))

    @property
    def period(self) -> float:
        """Duration of all frames in seconds."""
        return self.frames / self.fps

    @staticmethod
    def read(
        path: str | Path, boxes: Mapping[str, Box] | None = None, canvas: Size | None = None
    ) -> Motion:
        """Reads a motion file.

        Args:
            path: Path of the JSON file.
            boxes: Bounds of the layers of the picture, as for `from_json`.
            canvas: Width and height of the canvas, as for `from_json`.

        Raises:
            InputError: The file cannot be read.
            UsageError: The file is not a valid motion; the message says file and place.
        """
        try:
            text = Path(path).read_text("utf-8")
        except (OSError, UnicodeDecodeError) as error:
            raise InputError(f"{path}: cannot be read: {error}") from None
        try:
            return Motion.from_json(text, boxes, canvas)
        except UsageError as error:
            raise UsageError(f"{path}: {error}") from None

    @staticmethod
    def from_json(
        text: str, boxes: Mapping[str, Box] | None = None, canvas: Size | None = None
    ) -> Motion:
        """Makes the motion that JSON describes.

        Args:
            text: The JSON.
            boxes: Bounds x0, y0, x1, y1 of the layers of the picture in canvas pixels, by name;
                needed if the JSON names a preset, which completes it.
            canvas: Width and height of the canvas in pixels; presets pin what it cuts off.

        Raises:
            UsageError: The text is not JSON, or not a valid motion; the message says the place.
        """
        try:
            values = json.loads(text)
        except (ValueError, RecursionError) as error:
            raise UsageError(f"is not valid JSON: {error}") from None
        check(values)
        if "preset" in values:
            values = presets.filled(values, boxes or {}, canvas)
            check(values)
        return _motion(values)

    def to_dict(self) -> dict[str, Any]:
        """Returns the motion as JSON values, without those that are defaults."""
        values = _pruned(self)
        named = {m: name for name, m in MATERIALS.items()}
        values["layers"] = {}
        for name, layer in self.layers.items():
            values["layers"][name] = _pruned(layer)
            material = named.get(layer.material, asdict(layer.material))
            values["layers"][name]["material"] = material
        return {"version": 1, **values}

    def to_json(self) -> str:
        """Returns the motion as JSON that `from_json` reads."""
        return json.dumps(self.to_dict(), indent=1) + "\n"


def preset(
    name: str,
    layers: Mapping[str, Box],
    *,
    duration: float = 4.0,
    fps: int = 24,
    loop: bool = True,
    seed: int = 0,
    pins: Sequence[Spot] | None = None,
    canvas: Size | None = None,
) -> Motion:
    """Makes the motion of a preset.

    Args:
        name: Name of the preset, one of `PRESETS`.
        layers: Bounds x0, y0, x1, y1 of the layers to move in canvas pixels, by name.
        duration: Duration, or period of the loop, in seconds.
        fps: Frames per second.
        loop: Whether the first frame follows the last.
        seed: Seed of the wind.
        pins: Nodes that do not move, instead of those that the preset pins.
        canvas: Width and height of the canvas in pixels; the preset pins what it cuts off.

    Raises:
        UsageError: There is no such preset, no layer, or a value is out of range.
    """
    common = {"duration": duration, "fps": fps, "loop": loop, "seed": seed}
    values = presets.preset(name, layers, duration if duration > 0 else 1.0, canvas)
    motion = {"version": 1, **values, **common}
    if pins is not None:
        for layer in motion["layers"].values():
            layer["pins"] = [p if isinstance(p, str) else _lists(asdict(p)) for p in pins]
    check(motion)
    return _motion(motion)


def _check_times(motion: Motion) -> None:
    """Raises `UsageError` if times lie outside the duration, or there are too many steps."""
    total = motion.frames * motion.steps
    if total > STEPS_MAX:
        raise UsageError(
            f"duration: {motion.duration:g} s at {motion.fps:g} fps with {motion.steps} substeps "
            f"are {total} steps; at most {STEPS_MAX} are possible"
        )
    for name, layer in motion.layers.items():
        for i, impulse in enumerate(layer.impulses):
            if impulse.time >= motion.period:
                raise UsageError(
                    f"layers.{name}.impulses[{i}].time: {impulse.time:g} is not before the end "
                    f"at {motion.period:g} s"
                )
        for i, handle in enumerate(layer.handles):
            _check_keys(handle.keys, motion, f"layers.{name}.handles[{i}].keys")


def _check_keys(keys: Sequence[Key], motion: Motion, path: str) -> None:
    times = [k.time for k in keys]
    for i in range(1, len(times)):
        if times[i] <= times[i - 1]:
            raise UsageError(f"{path}[{i}].time: {times[i]:g} does not come after {times[i - 1]:g}")
    end = times[0] + motion.period if motion.loop else motion.duration
    last = len(keys) - 1
    if times[-1] > end:
        raise UsageError(f"{path}[{last}].time: {times[-1]:g} is after the end at {end:g} s")
    first, final = ((k.offset, k.scale, k.turn % 360) for k in (keys[0], keys[-1]))
    if motion.loop and times[-1] == end and first != final:
        raise UsageError(f"{path}[{last}]: a period after the first key it must be equal to it")


def _motion(values: Mapping[str, Any]) -> Motion:
    """Makes the motion of JSON values that match the schema."""
    kept = {k: _frozen(v) for k, v in values.items() if k not in ("version", "$schema")}
    for key in ("fps", "seed", "substeps"):  # JSON may write 24.0
        if key in kept:
            kept[key] = int(kept[key])
    for key, kind in {"wind": Wind, "collide": Collide}.items():
        if key in values:
            kept[key] = kind(**kept[key])
    kept["attachments"] = tuple(Attachment(**a) for a in kept.get("attachments", ()))
    kept["layers"] = {name: _layer(v) for name, v in kept["layers"].items()}
    return Motion(**kept)


def _layer(values: dict[str, Any]) -> LayerMotion:
    material = values.get("material", "cloth")
    if isinstance(material, str):
        material = {"preset": material}
    base = asdict(MATERIALS[material.get("preset", "cloth")])
    given = {k: v for k, v in material.items() if k != "preset"}
    handles = (
        Handle(**{**h, "keys": tuple(Key(**k) for k in h["keys"])})
        for h in values.get("handles", ())
    )
    return LayerMotion(
        **{
            **values,
            "material": Material(**{**base, **given}),
            "pins": tuple(_spot(p) for p in values.get("pins", ())),
            "impulses": tuple(Impulse(**i) for i in values.get("impulses", ())),
            "handles": tuple(handles),
        }
    )


def _spot(value: Any) -> Spot:
    if isinstance(value, str):
        return value  # type: ignore[return-value]  # `check` has seen that it is a side
    return Rectangle(**value) if "box" in value else Disc(**value)


def _frozen(value: Any) -> Any:
    """Replaces lists in JSON values by tuples."""
    if isinstance(value, list):
        return tuple(_frozen(v) for v in value)
    return {k: _frozen(v) for k, v in value.items()} if isinstance(value, dict) else value


def _lists(value: Any) -> Any:
    """Replaces tuples in values by lists, and leaves out None in dictionaries."""
    if isinstance(value, list | tuple):
        return [_lists(v) for v in value]
    if isinstance(value, dict):
        return {k: _lists(v) for k, v in value.items() if v is not None}
    return value


def _pruned(item: Any) -> dict[str, Any]:
    """Converts a dataclass to JSON values, without those that are defaults."""
    plain = {f.name: f.default for f in fields(item)}
    kept = {k: v for k, v in asdict(item).items() if getattr(item, k) != plain[k]}
    pruned: dict[str, Any] = _lists(kept)
    return pruned

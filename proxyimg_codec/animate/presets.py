"""Presets: motions for any picture, as the JSON values of a motion.

All lengths scale with the layers, so that a picture moves alike at every resolution.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

from ..errors import UsageError

Box = tuple[float, float, float, float]
"""Bounds x0, y0, x1, y1 in canvas pixels."""

Size = tuple[int, int]
"""Width and height in pixels."""

Values = dict[str, Any]

CUT = 1.0
"""Distance in pixels from a side of the canvas within which a layer is cut off by it."""

HOP_HEIGHT, HOP_TIME, HOP_EVERY = 0.1, 0.65, 1.3
"""Height of a hop relative to the diagonal, its seconds in the air, and seconds between hops."""

BREATH_EVERY, BREATH = 2.0, 1.12
"""Seconds from one breath to the next, and factor by which a breath enlarges the chest."""

CHEST, CHEST_RADIUS = 0.6, 0.2
"""Height of the chest in the box, from its top, and radius relative to the diagonal."""

NUDGE_EVERY = 2.0
"""Seconds from one nudge of the jelly to the next."""


def preset(
    name: str, boxes: Mapping[str, Box], duration: float, canvas: Size | None = None
) -> Values:
    """Makes the JSON values of a preset, without the version.

    Sides at which the canvas cuts a layer off are pinned, so that no gap opens there.

    Args:
        name: Name of the preset, one of `PRESETS`.
        boxes: Bounds of the layers to move, by name.
        duration: Duration of the motion in seconds, positive.
        canvas: Width and height of the canvas; None if it cuts nothing off.

    Raises:
        UsageError: There is no such preset, or no layer.
    """
    if name not in PRESETS:
        raise UsageError(f"there is no preset {name!r}; there are {', '.join(PRESETS)}")
    if not boxes:
        raise UsageError(f"preset {name!r} has no layer to move; name one at least")
    boxes = {n: (float(a), float(b), float(c), float(d)) for n, (a, b, c, d) in boxes.items()}
    x0, y0, x1, y1 = zip(*boxes.values(), strict=True)
    extent = math.hypot(max(x1) - min(x0), max(y1) - min(y0))
    values = PRESETS[name](boxes, max(extent, 1.0), duration)
    for key, layer in values["layers"].items():
        pins = layer.get("pins", [])
        cut = [] if canvas is None else _cut_off(boxes[key], canvas)
        if cut:
            layer["pins"] = [*pins, *(side for side in cut if side not in pins)]
    return values


def _cut_off(box: Box, canvas: Size) -> list[str]:
    """Sides of a layer at which the canvas cuts it off."""
    (x0, y0, x1, y1), (width, height) = box, canvas
    gaps = {"top": y0, "bottom": height - y1, "left": x0, "right": width - x1}
    return [side for side, gap in gaps.items() if gap <= CUT]


def filled(
    values: Mapping[str, Any], boxes: Mapping[str, Box], canvas: Size | None = None
) -> Values:
    """Completes a motion that names a preset: values of the preset stand for those not given.

    Args:
        values: JSON values of the motion.
        boxes: Bounds of the layers of the picture, by name.
        canvas: Width and height of the canvas, as for `preset`.

    Returns:
        JSON values of a motion that names no preset.

    Raises:
        UsageError: The motion names a layer or a preset that does not exist.
    """
    named = values.get("layers", {"*": {}})
    missing = [n for n in named if n not in boxes and n != "*"]
    if missing or not boxes:
        known = ", ".join(map(repr, boxes)) or "none"
        raise UsageError(f"layers: there is no layer {', '.join(missing)!r}; there are: {known}")
    chosen = boxes if "*" in named else {n: boxes[n] for n in named}
    base = preset(values["preset"], chosen, values.get("duration", 4.0), canvas)
    layers = {n: {**v, **named.get(n, named.get("*", {}))} for n, v in base["layers"].items()}
    merged = {"version": 1, **base, **values, "layers": layers}
    if "wind" in base or "wind" in values:
        merged["wind"] = {**base.get("wind", {}), **values.get("wind", {})}
    del merged["preset"]
    return merged


def _sway(boxes: Mapping[str, Box], extent: float, duration: float) -> Values:
    """Sways in the wind, pinned at the bottom, and stays on the canvas."""
    wind = {"strength": 2.1, "scale": extent, "frequency": 0.35, "gust": 0.85, "across": 0.05}
    layers = _each(boxes, "hair", "bottom")
    return {"wind": wind, "layers": layers, "collide": {"canvas": True}}


def _breeze(boxes: Mapping[str, Box], extent: float, duration: float) -> Values:
    """Hangs in a light wind, pinned at the top."""
    wind = {"strength": 2.4, "scale": extent, "frequency": 0.45, "gust": 0.8, "across": 0.3}
    return {"wind": wind, "layers": _each(boxes, "cloth", "top")}


def _wave(boxes: Mapping[str, Box], extent: float, duration: float) -> Values:
    """Waves like a flag, pinned at the left."""
    wind = {"strength": 1.7, "scale": 0.6 * extent, "frequency": 0.7, "gust": 0.9, "across": 0.9}
    return {"wind": wind, "layers": _each(boxes, "cloth", "left")}


def _flame(boxes: Mapping[str, Box], extent: float, duration: float) -> Values:
    """Flickers upwards, pinned at the bottom."""
    wind = {"direction": [0, -1], "strength": 1.2, "scale": extent, "frequency": 1.0,
            "gust": 0.75, "across": 0.6}  # fmt: skip
    return {"wind": wind, "layers": _each(boxes, "flame", "bottom")}


def _jelly(boxes: Mapping[str, Box], extent: float, duration: float) -> Values:
    """Wobbles, nudged from the left and from the right in turn."""
    nudges = _times(duration, NUDGE_EVERY)
    layers = _each(boxes, "jelly", "bottom")
    for name, (x0, y0, x1, y1) in boxes.items():
        speed = 0.6 * math.hypot(x1 - x0, y1 - y0)
        layers[name]["impulses"] = [
            {"time": t, "velocity": [speed * (1 - 2 * (i % 2)), -0.3 * speed]}
            for i, t in enumerate(nudges)
        ]
    return {"layers": layers}


def _bounce(boxes: Mapping[str, Box], extent: float, duration: float) -> Values:
    """Hops on the spot."""
    gravity = 8 * HOP_HEIGHT * extent / HOP_TIME**2
    speed = gravity * HOP_TIME / 2
    layers = _each(boxes, "jelly", None)
    for layer in layers.values():
        layer |= {"material": {"preset": "jelly", "shape": 3.5}, "floor": True}
        layer["impulses"] = [
            {"time": t, "velocity": [0, -speed]} for t in _times(duration, HOP_EVERY)
        ]
    return {"gravity": [0, gravity], "drag": 0.1, "layers": layers}


def _breathe(boxes: Mapping[str, Box], extent: float, duration: float) -> Values:
    """Breathes in and out, pinned at the bottom."""
    layers = _each(boxes, "jelly", "bottom")
    starts = _times(duration, BREATH_EVERY)
    breath = duration / len(starts)
    for name, (x0, y0, x1, y1) in boxes.items():
        keys = [
            {"time": start + late * breath, "scale": scale}
            for start in starts
            for late, scale in ((0.0, 1.0), (0.4, BREATH))
        ]
        layers[name]["handles"] = [
            {
                "at": [(x0 + x1) / 2, y0 + CHEST * (y1 - y0)],
                "radius": CHEST_RADIUS * math.hypot(x1 - x0, y1 - y0),
                "keys": [*keys, {"time": duration, "scale": 1.0}],
            }
        ]
    return {"layers": layers}


PRESETS: dict[str, Callable[[Mapping[str, Box], float, float], Values]] = {
    "sway": _sway,
    "breeze": _breeze,
    "jelly": _jelly,
    "wave": _wave,
    "bounce": _bounce,
    "flame": _flame,
    "breathe": _breathe,
}
"""Function of each preset: its JSON values, from bounds of layers, common diagonal and duration."""


def _each(boxes: Mapping[str, Box], material: str, pin: str | None) -> dict[str, Values]:
    """JSON values of upright layers of one material; `pin` names the side that is pinned."""
    pins = {} if pin is None else {"pins": [pin]}
    return {name: {"material": material, **pins, "upright": True} for name in boxes}


def _times(duration: float, every: float) -> list[float]:
    """Times of events about `every` seconds apart, which divide the duration evenly."""
    count = min(max(1, round(duration / every)), 1000)
    return [duration * i / count for i in range(count)]

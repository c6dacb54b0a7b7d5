"""Operation that lets layers move: a motion is simulated and baked, and can be undone."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from ..animate import animate as animation
from ..animate.motion import Motion
from ..model import Picture
from .operations import changed, operation


@operation("animate", motion="motion: a motion, as in a motion file; it may name a preset")
def animate(picture: Picture, motion: Mapping[str, Any]) -> Picture:
    """Lets layers move; a motion that the picture had is replaced.

    Raises:
        UsageError: The motion is not valid, or does not fit the picture.
        LimitError: Nodes move farther than a file can hold.
    """
    chosen = Motion.from_json(json.dumps(motion), animation.boxes(picture), picture.size)
    moving = animation.animate(picture, chosen)
    return changed(moving, list(moving.layers))

"""Completions by OpenCV, to compare with. A part of `benchmarks.background`."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.background_scores import Mask
from benchmarks.common import Pixels

Fill = Callable[[Pixels, Mask], Pixels]

RADIUS = 3
"""Radius of Telea and NS in pixels."""


def telea(picture: Pixels, hole: Mask) -> Pixels:
    """Completion by fast marching (Telea 2004)."""
    return np.asarray(cv2.inpaint(picture, hole.astype(np.uint8), RADIUS, cv2.INPAINT_TELEA))


def ns(picture: Pixels, hole: Mask) -> Pixels:
    """Completion by fluid dynamics (Bertalmio, Bertozzi and Sapiro 2001)."""
    return np.asarray(cv2.inpaint(picture, hole.astype(np.uint8), RADIUS, cv2.INPAINT_NS))


def fsr(picture: Pixels, hole: Mask) -> Pixels:
    """Completion by frequency selective reconstruction (Genser and others 2018), the fast one."""
    return _contributed(picture, hole, cv2.xphoto.INPAINT_FSR_FAST)


def shift_map(picture: Pixels, hole: Mask) -> Pixels:
    """Completion by a shift map (He and Sun 2012), in CIE Lab as OpenCV asks for."""
    lab = np.asarray(cv2.cvtColor(picture, cv2.COLOR_RGB2Lab))
    filled = cv2.cvtColor(_contributed(lab, hole, cv2.xphoto.INPAINT_SHIFTMAP), cv2.COLOR_Lab2RGB)
    return np.where(hole[..., None], filled, picture)


def _contributed(picture: Pixels, hole: Mask, method: int) -> NDArray[np.uint8]:
    out = np.zeros_like(picture)
    cv2.xphoto.inpaint(picture, np.where(hole, 0, 255).astype(np.uint8), out, method)
    return out


PEERS: dict[str, Fill] = {"Telea": telea, "NS": ns, "FSR": fsr, "shift map": shift_map}

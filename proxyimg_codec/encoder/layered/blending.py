"""Compositing of layers with blending modes (W3C, Compositing and Blending Level 1).

What a mode does to colours is psd-tools' code, which is imported only where there is one.
"""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from typing import Any

import numpy as np

from ...errors import UnsupportedError
from ...io.samples import rounded, to_float
from ...texture.network import Floats
from .nodes import Node, Patch

MODES = (
    "multiply", "screen", "overlay", "darken", "lighten", "color-dodge", "color-burn",
    "hard-light", "soft-light", "difference", "hue", "saturation", "color", "luminosity", "plus",
)  # fmt: skip
"""Names of blending modes in CSS and SVG; ``plus`` is the sum."""

MODE = "blending mode "
"""Beginning of `Node.blend` of a layer with a blending mode."""


def merged(nodes: Sequence[Node], size: tuple[int, int], where: str) -> Patch:
    """Draws nodes over each other on a clear canvas.

    Args:
        nodes: Layers and groups that show, back to front.
        size: Width and height of the canvas in pixels.
        where: Name of the file in messages.

    Returns:
        RGB and alpha of the whole canvas, in 16 bits if a layer has them, in 8 otherwise.

    Raises:
        UnsupportedError: psd-tools is needed and not installed.
    """
    canvas = np.zeros((size[1], size[0], 4), np.float32)
    deep = _draw(canvas, nodes, where)
    canvas[..., :3] /= np.maximum(canvas[..., 3:], np.float32(1e-6))
    return Patch(rounded(np.clip(canvas, 0, 1), np.uint16 if deep else np.uint8), 0, 0)


def _draw(canvas: Floats, nodes: Sequence[Node], where: str) -> bool:
    """Draws nodes on a premultiplied canvas [H, W, 4]; tells whether a layer has 16 bits."""
    deep = False
    for node in nodes:
        if not node.shows:
            continue
        if node.children is not None and not node.isolated:
            deep |= _draw(canvas, node.children, where)  # its opacity is 1
            continue
        above = np.zeros_like(canvas)
        if node.children is not None:
            deep |= _draw(above, node.children, where)
        else:
            patch = node.draw(f"{where}: layer {node.name!r}")
            deep |= patch is not None and patch.pixels.dtype == np.uint16
            _place(above, patch)
        _blend(canvas, above, node)
    return deep


def _place(canvas: Floats, patch: Patch | None) -> None:
    """Puts pixels on a clear canvas, as far as they lie on it, premultiplied."""
    if patch is None:
        return
    source = to_float(patch.pixels)[0]
    source[..., :3] *= source[..., 3:]
    height, width = canvas.shape[:2]
    top, left = max(patch.y, 0), max(patch.x, 0)
    rows, columns = (max(-patch.y, 0), max(-patch.x, 0))
    part = source[rows : max(height - patch.y, 0), columns : max(width - patch.x, 0)]
    canvas[top : top + part.shape[0], left : left + part.shape[1]] = part


def _blend(canvas: Floats, above: Floats, node: Node) -> None:
    """Blends a premultiplied layer [H, W, 4] into a canvas."""
    mode = node.blend.removeprefix(MODE)
    alpha, behind = above[..., 3:].copy(), canvas[..., 3:].copy()
    colour = above[..., :3] / np.maximum(alpha, np.float32(1e-6))
    if mode:
        below = canvas[..., :3] / np.maximum(behind, np.float32(1e-6))
        mixed = _function(mode)(np.clip(below, 0, 1), np.clip(colour, 0, 1))
        colour = colour + behind * (mixed - colour)
    alpha *= np.float32(node.opacity)
    canvas[..., :3] = alpha * colour + (1 - alpha) * canvas[..., :3]
    canvas[..., 3:] = alpha + (1 - alpha) * behind


def _function(mode: str) -> Any:
    """Function of two arrays of colours [H, W, 3] in 0..1, those behind and those in front."""
    try:
        functions = import_module("psd_tools.composite.blend")
    except ImportError:
        raise UnsupportedError(
            f"blending mode {mode} needs psd-tools (pip install 'proxyimg-codec[psd]'); or set it "
            "to normal"
        ) from None
    return getattr(functions, "linear_dodge" if mode == "plus" else mode.replace("-", "_"))

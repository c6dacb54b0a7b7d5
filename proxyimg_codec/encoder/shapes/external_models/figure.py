"""Maps of what stands out, by models with the interface of U²-Net or IS-Net."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from ..onnx_model import Floats, Model
from .kinds import Kind, check_kind
from .pixels import IMAGENET_MEAN, IMAGENET_STD, planes, side_of

SIDES = {Kind.U2NET: 320, Kind.ISNET: 1024}
"""Side of the square that a model sees, in pixels, if it leaves it free."""

SEEN = 0.5
"""Figure score from which on a part is looked at again."""

LEAST, MARGIN, MOST = 0.005, 0.15, 4
"""Parts that are looked at again: least share of the picture, margin around them, relative to their
longer side, and how many."""


def figure_map(model: Model, rgb: NDArray[np.uint8]) -> Floats:
    """Figure map of a picture.

    The mean of the picture and its mirror image; the largest parts are looked at once more in a
    copy that shows them alone, larger.

    Args:
        model: Model with the interface of U²-Net or IS-Net.
        rgb: uint8 [H, W, 3] picture in sRGB.

    Returns:
        float32 [H, W] in 0..1, how much a pixel belongs to what stands out.

    Raises:
        InputError: The model has another interface, or its output is no such map.
    """
    kind = check_kind(model, (Kind.U2NET, Kind.ISNET), "a map of figures")
    mirrored = _run(model, kind, np.ascontiguousarray(rgb[:, ::-1]))[:, ::-1]
    figure = (_run(model, kind, rgb) + mirrored) / 2
    result = figure.astype(np.float32)
    for rows, cols in _boxes(figure):
        close = _run(model, kind, np.ascontiguousarray(rgb[rows, cols]))
        result[rows, cols] = (figure[rows, cols] + close) / 2
    return result


def _run(model: Model, kind: Kind, rgb: NDArray[np.uint8]) -> Floats:
    """Figure map float32 [H, W] of a picture as it is."""
    size = side_of(model.inputs[0], SIDES[kind])
    scaled = cv2.resize(rgb, size[::-1], interpolation=cv2.INTER_AREA).astype(np.float32)
    if kind is Kind.U2NET:
        scaled /= max(float(scaled.max()), 1.0)
        picture = planes(scaled, IMAGENET_MEAN, IMAGENET_STD)
    else:
        picture = planes(scaled / 255, (0.5,) * 3, (1.0,) * 3)
    # The first output is the finest.
    found = model.run({model.inputs[0].name: picture}, [model.outputs[0].name])[0]
    score = np.asarray(found[0, 0], np.float32)
    if score.min() < -0.01 or score.max() > 1.01:  # before the sigmoid
        score = np.asarray(1 / (1 + np.exp(-np.clip(score, -30, 30))), np.float32)
    return np.asarray(cv2.resize(np.clip(score, 0, 1), rgb.shape[1::-1]), np.float32)


def _boxes(figure: NDArray[np.floating]) -> list[tuple[slice, slice]]:
    """Rows and columns of the largest parts, with a margin."""
    height, width = figure.shape
    count, _, stats, _ = cv2.connectedComponentsWithStats((figure >= SEEN).astype(np.uint8))
    order = sorted(range(1, count), key=lambda i: (-stats[i, cv2.CC_STAT_AREA], i))
    boxes = []
    for i in order[:MOST]:
        x, y, wide, high, area = (int(v) for v in stats[i])
        margin = round(MARGIN * max(wide, high)) + 4
        rows = slice(max(0, y - margin), min(height, y + high + margin))
        cols = slice(max(0, x - margin), min(width, x + wide + margin))
        if area >= LEAST * figure.size:
            boxes.append((rows, cols))
    return boxes

"""Pictures as models want them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..onnx_model import Floats, Tensor

IMAGENET_MEAN, IMAGENET_STD = (0.485, 0.456, 0.406), (0.229, 0.224, 0.225)
"""Mean and deviation of the colours of ImageNet, in 0..1, by which most models were trained."""


def planes(rgb: NDArray[np.floating], mean: Sequence[float], std: Sequence[float]) -> Floats:
    """Normalized planes float32 [1, 3, H, W] of a picture float32 [H, W, 3]."""
    normal = (rgb - np.asarray(mean, np.float32)) / np.asarray(std, np.float32)
    return np.ascontiguousarray(normal.transpose(2, 0, 1)[None], np.float32)


def side_of(tensor: Tensor, usual: int) -> tuple[int, int]:
    """Height and width that an input [1, 3, h, w] asks for; `usual` where it leaves them free."""
    height, width = tensor.shape[2:4]
    return height or usual, width or usual

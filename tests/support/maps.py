"""Maps of pictures of flat colours, without a network, and such pictures."""

import cv2
import numpy as np

from proxyimg_codec.encoder.shapes.maps import Maps


def plain(rgb: np.ndarray, jobs: int = 1) -> Maps:
    """Boundaries are where colours change, and nothing stands out."""
    levels = rgb.astype(np.float32) / 255
    kernel = np.ones((3, 3), np.uint8)
    change = (cv2.dilate(levels, kernel) - cv2.erode(levels, kernel)).max(2)
    flat = np.full(rgb.shape[:2], 0.5, np.float32)
    return Maps(flat, np.clip(2 * change, 0, 1), np.zeros((*rgb.shape[:2], 2), np.float32))


def house() -> np.ndarray:
    """uint8 [97, 131, 3]: a red house with a yellow window before blue, and a green tree."""
    picture = np.full((97, 131, 3), (90, 120, 200), np.uint8)
    picture[HOUSE] = (200, 60, 50)
    picture[WINDOW] = (230, 220, 90)
    picture[TREE] = (40, 140, 60)
    return picture


def _box(x: int, y: int, width: int, height: int) -> np.ndarray:
    mask = np.zeros((97, 131), bool)
    mask[y : y + height, x : x + width] = True
    return mask


HOUSE, WINDOW, TREE = _box(15, 35, 50, 52), _box(30, 45, 19, 17), _box(87, 22, 29, 66)
"""bool [97, 131]: the house with its window, the window, and the tree of `house`."""

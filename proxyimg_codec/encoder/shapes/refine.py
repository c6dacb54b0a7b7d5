"""Refinement of regions: smooth borders that follow the edges of the picture."""

import cv2
import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.float32]
Labels = NDArray[np.intp]
Mask = NDArray[np.bool_]

REFINE_SIDE, WORK_SIDE = 640, 256
# Lengths are pixels at WORK_SIDE; the guide is Lab / 100.
GUIDE_RADIUS, GUIDE_EPS, SMOOTH = 3, 1e-4, 1.5


def reduced_lab(rgb: NDArray[np.uint8], support: Mask, side: int) -> tuple[Image, Mask]:
    """Reduces a picture to at most `side` pixels a side.

    Colours outside the support are arbitrary, so they are left out of every average.

    Returns:
        float32 [h, w, 3] picture in Lab, and bool [h, w] support.
    """
    height, width = support.shape
    scale = min(1.0, side / max(height, width))
    size = (max(1, round(width * scale)), max(1, round(height * scale)))
    weight = cv2.resize(support.astype(np.float32), size, interpolation=cv2.INTER_AREA)
    visible = np.where(support[..., None], rgb, np.uint8(0))
    sums = cv2.resize(visible, size, interpolation=cv2.INTER_AREA)
    mean = sums.sum((0, 1)) / weight.sum()
    small = np.where(weight[..., None] > 0, sums / np.maximum(weight, 1e-6)[..., None], mean)
    lab = cv2.cvtColor((small / 255).astype(np.float32), cv2.COLOR_RGB2LAB)
    return np.asarray(lab, np.float32), weight >= 0.5


def spread(labels: Labels) -> Labels:
    """Gives each pixel with label -1 the label of the nearest pixel that has one."""
    missing = labels < 0
    _, nearest = cv2.distanceTransformWithLabels(
        missing.astype(np.uint8), cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL
    )
    of_pixel = np.zeros(int(nearest.max()) + 1, np.intp)
    of_pixel[nearest[~missing]] = labels[~missing]
    return np.asarray(of_pixel[nearest])


def refined(labels: Labels, rgb: NDArray[np.uint8], support: Mask) -> Labels:
    """Enlarges labels to the size of the picture, with smooth borders that follow its edges.

    Args:
        labels: int [h, w] labels from 0.
        rgb: uint8 [H, W, 3] picture.
        support: bool [H, W] pixels whose colours count.

    Returns:
        int [H, W] labels.
    """
    height, width = rgb.shape[:2]
    count = int(labels.max()) + 1
    if count == 1:
        return np.zeros((height, width), np.intp)
    guide = reduced_lab(rgb, support, REFINE_SIDE)[0] / 100
    size, unit = guide.shape[1::-1], max(guide.shape) / WORK_SIDE
    best = np.full((height, width), -1, np.float32)
    full = np.zeros((height, width), np.intp)
    for label in range(count):
        vote = cv2.resize((labels == label).astype(np.float32), size)
        vote = cv2.ximgproc.guidedFilter(guide, vote, max(2, round(GUIDE_RADIUS * unit)), GUIDE_EPS)
        vote = cv2.resize(cv2.GaussianBlur(vote, (0, 0), SMOOTH * unit), (width, height))
        full[vote > best] = label
        best = np.maximum(best, vote)
    return full

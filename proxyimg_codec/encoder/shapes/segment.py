"""The built-in decomposition of a picture into a few layers, without trained weights.

Superpixels are merged greedily by colour, texture, the edge between them and saliency, at
about 256 pixels; the regions that remain get smooth borders that follow the picture's edges.
Saliency is robust background detection (Zhu et al., 2014): what a smooth path of colours joins
to much of the picture's frame is background.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

from proxyimg_codec.encoder.shapes.masks import Region, description, nearness, unique_names

Floats = NDArray[np.float64]
Image = NDArray[np.float32]
Labels = NDArray[np.intp]
Mask = NDArray[np.bool_]

WORK_SIDE, REFINE_SIDE, SUPERPIXELS = 256, 640, 360
MIN_SIDE, MIN_AREA = 12, 0.01
# Weights that bring the features of a superpixel to the scale of Lab distances.
LIGHTNESS, TEXTURE, SALIENCY = 0.7, 4.0, 60.0
# Merging: weight of the edge; powers of size and border length in the cost; its factor for
# regions that do not touch; the cost above which two regions are worth keeping apart.
EDGE, SIZE_POWER, BORDER, APART, KEEP = 0.1, 0.5, 0.6, 3.0, 50.0
# Border refinement, in pixels at WORK_SIDE; the guide is Lab / 100.
GUIDE_RADIUS, GUIDE_EPS, SMOOTH = 3, 1e-4, 1.5


def segment(
    rgb: NDArray[np.uint8], max_layers: int = 4, support: Mask | None = None
) -> list[Region]:
    """Split a picture into a few plausible layers.

    Deterministic. Fewer than `max_layers` come back where the picture asks for no more: a
    uniform or tiny one is a single region.

    Args:
        rgb: uint8 [H, W, 3], sRGB.
        max_layers: The most regions to return, >= 1.
        support: bool [H, W], the pixels to segment (where alpha is above zero); None for all
            of an opaque picture.

    Returns:
        Disjoint regions back to front, whose union is the picture or the support; the rearmost
        of an opaque picture is named `back`, the others by colour and place. Empty only if the
        support is.
    """
    whole = np.ones(rgb.shape[:2], np.bool_) if support is None else support
    if not whole.any():
        return []
    small, inside = _reduced(rgb, whole, WORK_SIDE)
    labels, salient = np.zeros(inside.shape, np.intp), np.zeros(inside.shape)
    if min(small.shape[:2]) >= MIN_SIDE and inside.any():
        labels, salient = _merged(small, inside, max_layers, opaque=support is None)
    full = _refined(_spread(labels), rgb, whole)
    masks = {i: whole & (full == i) for i in range(int(labels.max()) + 1)}
    salience = {i: float(salient[labels == i].mean()) for i in masks if masks[i].any()}
    # Sorted by nearness: the list holds back to front.
    back_to_front = sorted(salience, key=lambda i: nearness(masks[i], salience[i]))
    names = [description(rgb, masks[i]) for i in back_to_front]
    if support is None:
        names[0] = "back"
    stack = zip(unique_names(names), back_to_front, strict=True)
    return [Region(name, masks[i]) for name, i in stack]


def _reduced(rgb: NDArray[np.uint8], support: Mask, side: int) -> tuple[Image, Mask]:
    """Reduce to at most `side` pixels: Lab float32 [h, w, 3] and the support bool [h, w].

    Colours outside the support mean nothing, so they are left out of every average.
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


def _merged(lab: Image, inside: Mask, max_layers: int, opaque: bool) -> tuple[Labels, Floats]:
    """Labels of the merged regions (-1 outside) and saliency in 0..1, both [h, w]."""
    smooth = np.asarray(cv2.bilateralFilter(lab, 5, 12, 3), np.float32)
    parts = _superpixels(smooth, inside)
    count = int(parts.max()) + 1
    area = np.bincount(parts[inside], minlength=count).astype(float)

    def mean(plane: NDArray[np.floating]) -> Floats:
        return np.asarray(np.bincount(parts[inside], plane[inside], count) / area)

    colour = np.stack([mean(smooth[..., c]) for c in range(3)], 1)
    shared, edge = _adjacency(parts, smooth)
    # Deviation within superpixels, where their neighbours have it too: edges are no texture.
    detail = mean(np.abs(lab - colour[parts]).sum(2))
    around = (shared > 0) @ detail / np.maximum((shared > 0).sum(1), 1)
    colour *= (LIGHTNESS, 1, 1)
    salient = np.zeros(count)
    if opaque:
        rows, cols = np.indices(lab.shape[:2]) / max(lab.shape[:2])
        place = np.stack([mean(rows), mean(cols)], 1)
        frame = np.zeros(count, np.bool_)
        frame[np.concatenate([parts[0], parts[-1], parts[:, 0], parts[:, -1]])] = True
        salient = _saliency(colour, place, shared > 0, frame)
    features = np.column_stack([colour, TEXTURE * np.minimum(detail, around), SALIENCY * salient])
    groups = _Merger(features, area, shared, edge).run(max_layers)
    return np.where(inside, groups[parts], -1), salient[parts]


def _superpixels(lab: Image, inside: Mask) -> Labels:
    """Superpixels [h, w] numbered from 0; -1 outside."""
    step = max(4, round((lab.shape[0] * lab.shape[1] / SUPERPIXELS) ** 0.5))
    levels = np.clip(lab * (2.55, 1, 1) + (0, 128, 128), 0, 255).astype(np.uint8)
    slic = cv2.ximgproc.createSuperpixelSLIC(levels, cv2.ximgproc.SLIC, step, 12.0)
    slic.iterate(8)
    slic.enforceLabelConnectivity(40)
    parts = np.full(inside.shape, -1)
    parts[inside] = np.unique(slic.getLabels()[inside], return_inverse=True)[1]
    return parts


def _adjacency(parts: Labels, lab: Image) -> tuple[Floats, Floats]:
    """Length of the shared border and the edge strength summed along it, both [N, N]."""
    soft = cv2.GaussianBlur(lab, (0, 0), 1.0)
    across, down = (cv2.Sobel(soft, cv2.CV_32F, *d) / 4 for d in ((1, 0), (0, 1)))
    strength = np.sqrt((across**2 + down**2).sum(2)) / 2
    # Edges amid many others are texture.
    strength /= 1 + cv2.GaussianBlur(strength, (0, 0), 6) / 6
    count = int(parts.max()) + 1
    shared, edge = np.zeros((2, count, count))
    for first, second in ((np.s_[:, :-1], np.s_[:, 1:]), (np.s_[:-1], np.s_[1:])):
        a, b = parts[first], parts[second]
        border = (a != b) & (a >= 0) & (b >= 0)
        np.add.at(shared, (a[border], b[border]), 1)
        np.add.at(edge, (a[border], b[border]), strength[first][border] + strength[second][border])
    return shared + shared.T, edge + edge.T


def _saliency(colour: Floats, place: Floats, touching: Mask, frame: Mask) -> Floats:
    """Saliency [N] in 0..1 of superpixels by robust background detection."""
    apart = np.linalg.norm(colour[:, None] - colour, axis=2)
    path = np.where(touching | (frame[:, None] & frame), np.maximum(apart - 3, 0), np.inf)
    np.fill_diagonal(path, 0)
    for k in range(len(path)):
        np.minimum(path, path[:, k : k + 1] + path[k], out=path)
    reach = np.exp(-((path / 10) ** 2))
    back = 1 - np.exp(-((reach @ frame) ** 2) / reach.sum(1) / 2)
    near = np.exp(-8 * ((place[:, None] - place) ** 2).sum(2))
    contrast = _unit((apart * near) @ back / near.sum(1).mean(), 10)
    bond = np.where(touching, np.exp(-((apart / 11) ** 2)) + 0.02, 0)
    # Least squares: 0 in the background, 1 where contrast is, equal across bonds (Jacobi).
    total, salient = 5 * back + contrast + bond.sum(1) + 1e-6, contrast
    for _ in range(100):
        salient = (contrast + bond @ salient) / total
    return _unit(salient, 0.2)


def _unit(values: Floats, least: float) -> Floats:
    """Stretch to 0..1, but a range below `least` by no more than that would be."""
    return np.asarray((values - values.min()) / max(float(np.ptp(values)), least))


class _Merger:
    """Greedy merging of a region graph; the arrays are [N] or [N, N], by region."""

    def __init__(self, features: Floats, area: Floats, shared: Floats, edge: Floats) -> None:
        self.features, self.area, self.shared, self.edge = features, area, shared, edge
        self.alive = np.ones(len(area), np.bool_)
        self.group = np.arange(len(area))
        self.allow_apart(1e9)

    def allow_apart(self, factor: float) -> None:
        """Let regions that do not touch merge, at `factor` times the cost."""
        self.apart = factor
        self.cost = np.stack([self.costs(i) for i in range(len(self.area))])

    def costs(self, i: int) -> Floats:
        """Cost [N] of merging `i` with each other region."""
        away = ((self.features - self.features[i]) ** 2).sum(1)
        size = self.area * self.area[i] / (self.area + self.area[i]) / self.area.sum()
        edge = self.edge[i] / np.maximum(self.shared[i], 1)
        cost = size**SIZE_POWER * away * (1 + EDGE * edge)
        # Mumford-Shah: a long border between small regions is worth removing.
        length = self.shared[i] / np.sqrt(np.minimum(self.area, self.area[i]))
        cost *= np.where(length > 0, np.maximum(length, 0.1) ** -BORDER, self.apart)
        cost[~(self.alive & self.alive[i]) | (np.arange(len(cost)) == i)] = np.inf
        return np.asarray(cost)

    def merge(self, i: int, j: int) -> None:
        """Put region `j` into region `i`."""
        share = self.area[[i, j]] / self.area[[i, j]].sum()
        self.features[i] = share @ self.features[[i, j]]
        self.area[i] += self.area[j]
        self.alive[j] = False
        self.group[self.group == j] = i
        for matrix in (self.shared, self.edge):
            matrix[i] += matrix[j]
            matrix[:, i] = matrix[i]
            matrix[j] = matrix[:, j] = matrix[i, i] = 0
        self.cost[i] = self.cost[:, i] = self.costs(i)
        self.cost[j] = self.cost[:, j] = np.inf

    def run(self, max_layers: int) -> Labels:
        """Merge until every pair of at most `max_layers` regions is distinct; groups [N] from 0."""
        while self.alive.sum() > max(24, 2 * max_layers):
            self.merge(*divmod(int(self.cost.argmin()), len(self.cost)))
        self.allow_apart(APART)
        while self.area[self.alive].min() < MIN_AREA * self.area[self.alive].sum():
            i = int(np.where(self.alive, self.area, np.inf).argmin())
            self.merge(int(self.cost[i].argmin()), i)
        while self.alive.sum() > 1:
            i, j = divmod(int(self.cost.argmin()), len(self.cost))
            if self.alive.sum() <= max_layers and self.cost[i, j] > KEEP:
                break
            self.merge(i, j)
        return np.unique(self.group, return_inverse=True)[1]


def _spread(labels: Labels) -> Labels:
    """Give pixels without a label that of the nearest pixel with one."""
    missing = labels < 0
    _, nearest = cv2.distanceTransformWithLabels(
        missing.astype(np.uint8), cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL
    )
    of_pixel = np.zeros(int(nearest.max()) + 1, np.intp)
    of_pixel[nearest[~missing]] = labels[~missing]
    return np.asarray(of_pixel[nearest])


def _refined(labels: Labels, rgb: NDArray[np.uint8], support: Mask) -> Labels:
    """Bring labels to full size with smooth borders that follow the picture's edges."""
    height, width = rgb.shape[:2]
    count = int(labels.max()) + 1
    if count == 1:
        return np.zeros((height, width), np.intp)
    guide = _reduced(rgb, support, REFINE_SIDE)[0] / 100
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

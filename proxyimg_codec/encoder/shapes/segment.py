"""Built-in segmenter: decomposes a picture into a few layers, without trained weights.

In a picture reduced to about 256 pixels a side, superpixels are merged greedily by colour, texture,
saliency, and the edge between them. The remaining regions get smooth borders that follow the edges
of the picture. Saliency comes from robust background detection (Zhu et al., 2014): an area is
background if smooth paths of colours join it to much of the frame of the picture.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

from .masks import Region, description, nearness, unique_names

Floats = NDArray[np.float64]
Image = NDArray[np.float32]
Labels = NDArray[np.intp]
Mask = NDArray[np.bool_]

WORK_SIDE, REFINE_SIDE, SUPERPIXELS = 256, 640, 360
MIN_SIDE, MIN_AREA = 12, 0.01
# Weights that bring the features of superpixels to the scale of distances in Lab.
LIGHTNESS, TEXTURE, SALIENCY = 0.7, 4.0, 60.0
# Cost of a merge: weight of the edge, powers of size and of border length, factor for regions that
# do not touch; and the cost above which two regions stay apart.
EDGE, SIZE_POWER, BORDER, APART, KEEP = 0.1, 0.5, 0.6, 3.0, 50.0
# Refinement of borders: lengths are pixels at WORK_SIDE; the guide is Lab / 100.
GUIDE_RADIUS, GUIDE_EPS, SMOOTH = 3, 1e-4, 1.5


def segment(
    rgb: NDArray[np.uint8], max_layers: int = 4, support: Mask | None = None
) -> list[Region]:
    """Splits a picture into a few plausible layers; deterministic.

    Args:
        rgb: uint8 [H, W, 3] picture in sRGB.
        max_layers: Most regions to return, at least 1. There are fewer if the picture has fewer
            distinct regions; a uniform or tiny picture is a single one.
        support: bool [H, W], True for the pixels to segment; None for all of an opaque picture.

    Returns:
        Disjoint regions back to front, whose union is the picture or the support. The rearmost of
        an opaque picture is named `back`, the others by colour and place. The list is empty only
        if the support is.
    """
    whole = np.ones(rgb.shape[:2], np.bool_) if support is None else support
    if not whole.any():
        return []
    small, inside = _reduced(rgb, whole, WORK_SIDE)
    labels, salient = np.zeros(inside.shape, np.intp), np.zeros(inside.shape)
    if min(small.shape[:2]) >= MIN_SIDE and inside.any():
        labels, salient = _merged(small, inside, max_layers, opaque=support is None)
    full = refined(_spread(labels), rgb, whole)
    masks = {i: whole & (full == i) for i in range(int(labels.max()) + 1)}
    salience = {i: float(salient[labels == i].mean()) for i in masks if masks[i].any()}
    # Ascending nearness is back to front.
    back_to_front = sorted(salience, key=lambda i: nearness(masks[i], salience[i]))
    names = [description(rgb, masks[i]) for i in back_to_front]
    if support is None:
        names[0] = "back"
    stack = zip(unique_names(names), back_to_front, strict=True)
    return [Region(name, masks[i]) for name, i in stack]


def _reduced(rgb: NDArray[np.uint8], support: Mask, side: int) -> tuple[Image, Mask]:
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


def _merged(lab: Image, inside: Mask, max_layers: int, opaque: bool) -> tuple[Labels, Floats]:
    """Merges superpixels to regions.

    Args:
        lab: float32 [h, w, 3] picture in Lab.
        inside: bool [h, w] support.
        max_layers: Most regions.
        opaque: Whether the picture is opaque; only then saliency is used.

    Returns:
        int [h, w] label of each pixel, -1 outside; and float64 [h, w] saliency in 0..1.
    """
    smooth = np.asarray(cv2.bilateralFilter(lab, 5, 12, 3), np.float32)
    parts = _superpixels(smooth, inside)
    count = int(parts.max()) + 1
    area = np.bincount(parts[inside], minlength=count).astype(float)

    def mean(plane: NDArray[np.floating]) -> Floats:
        return np.asarray(np.bincount(parts[inside], plane[inside], count) / area)

    colour = np.stack([mean(smooth[..., c]) for c in range(3)], 1)
    shared, edge = _adjacency(parts, smooth)
    # Deviation within superpixels is texture only if their neighbours have it too, else an edge.
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
    """Superpixel of each pixel, int [h, w], numbered from 0; -1 outside."""
    step = max(4, round((lab.shape[0] * lab.shape[1] / SUPERPIXELS) ** 0.5))
    levels = np.clip(lab * (2.55, 1, 1) + (0, 128, 128), 0, 255).astype(np.uint8)
    slic = cv2.ximgproc.createSuperpixelSLIC(levels, cv2.ximgproc.SLIC, step, 12.0)
    slic.iterate(8)
    slic.enforceLabelConnectivity(40)
    parts = np.full(inside.shape, -1)
    parts[inside] = np.unique(slic.getLabels()[inside], return_inverse=True)[1]
    return parts


def _adjacency(parts: Labels, lab: Image) -> tuple[Floats, Floats]:
    """Length of the border that two superpixels share, and the edge strength summed along it.

    Args:
        parts: int [h, w] superpixel of each pixel, or -1.
        lab: float32 [h, w, 3] picture in Lab.

    Returns:
        Two symmetric arrays float64 [N, N].
    """
    soft = cv2.GaussianBlur(lab, (0, 0), 1.0)
    across, down = (cv2.Sobel(soft, cv2.CV_32F, *d) / 4 for d in ((1, 0), (0, 1)))
    strength = np.sqrt((across**2 + down**2).sum(2)) / 2
    # Edges among many others are texture.
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
    """Saliency of superpixels by robust background detection.

    Args:
        colour: float64 [N, 3] mean colours in Lab.
        place: float64 [N, 2] centres, relative to the longer side of the picture.
        touching: bool [N, N], True for superpixels that share a border.
        frame: bool [N], True for those at the frame of the picture.

    Returns:
        float64 [N] in 0..1.
    """
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
    # Least squares by Jacobi iteration: 0 in the background, 1 at contrast, equal across bonds.
    total, salient = 5 * back + contrast + bond.sum(1) + 1e-6, contrast
    for _ in range(100):
        salient = (contrast + bond @ salient) / total
    return _unit(salient, 0.2)


def _unit(values: Floats, least: float) -> Floats:
    """Maps values to 0..1 linearly; their range counts as `least` if it is smaller."""
    return np.asarray((values - values.min()) / max(float(np.ptp(values)), least))


class _Merger:
    """Greedy merging of the regions of a graph.

    Args:
        features: float64 [N, F] mean features of each region.
        area: float64 [N] pixels of each region.
        shared: float64 [N, N] length of the border that two regions share.
        edge: float64 [N, N] edge strength summed along it.
    """

    def __init__(self, features: Floats, area: Floats, shared: Floats, edge: Floats) -> None:
        self.features, self.area, self.shared, self.edge = features, area, shared, edge
        self.alive = np.ones(len(area), np.bool_)
        self.group = np.arange(len(area))
        self.allow_apart(1e9)

    def allow_apart(self, factor: float) -> None:
        """Sets the factor of the cost of merging regions that do not touch."""
        self.apart = factor
        self.cost = np.stack([self.costs(i) for i in range(len(self.area))])

    def costs(self, i: int) -> Floats:
        """Cost float64 [N] of merging region `i` with each other one; infinite where impossible."""
        away = ((self.features - self.features[i]) ** 2).sum(1)
        size = self.area * self.area[i] / (self.area + self.area[i]) / self.area.sum()
        edge = self.edge[i] / np.maximum(self.shared[i], 1)
        cost = size**SIZE_POWER * away * (1 + EDGE * edge)
        # As in the functional of Mumford and Shah, a long border between small regions is dear.
        length = self.shared[i] / np.sqrt(np.minimum(self.area, self.area[i]))
        cost *= np.where(length > 0, np.maximum(length, 0.1) ** -BORDER, self.apart)
        cost[~(self.alive & self.alive[i]) | (np.arange(len(cost)) == i)] = np.inf
        return np.asarray(cost)

    def merge(self, i: int, j: int) -> None:
        """Merges region `j` into region `i`."""
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
        """Merges until at most `max_layers` regions are left and all of them are distinct.

        Returns:
            int [N] number, from 0, of the merged region that each region belongs to.
        """
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

"""Planning of layers: names and boundaries, back to front, from a picture and its masks."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from ...geometry.boundary import Boundary
from ...geometry.mesh import Mesh
from ...texture.network import Floats
from ..settings import Settings
from .contours import fit_paths
from .coverage import coverage_together
from .external_models.depth import ordered_by_depth
from .external_models.segmenters import find_depth, find_segmenter
from .masks import NAME_MAX, Region, check_count, groups_of, resolve
from .soft import SOFT_PIXELS, matted
from .soft import dilated as _dilate

UNIT = 2
"""Unit of boundaries: control points are multiples of 2**-UNIT pixel."""

OVERLAP = 3
"""Pixels by which a layer continues under those in front of it, so that nothing shines through."""

CORNER = 24
"""Most pixels of a continuation that is only the corner where two outlines cross; an edge of 8
pixels has as many."""

FINE_PIXELS = 1 << 20
"""Most pixels of a transparent picture whose outlines are traced on a finer grid."""

FINE = 2
"""Base-2 logarithm of the number of points of the finer grid per pixel."""

FINE_TOLERANCE: dict[str, dict[str, float]] = {"lsq": {"tolerance": 1.2}, "chamfer": {}}
"""Options of the fit of boundaries on the finer grid, in its units."""

SEEN = 0.4
"""Squared error of colours over black and white for that of alpha, roughly."""

TOLERABLE = {False: 0.8, True: 0.3}
"""Error that outlines may cause, as a share of that of the coding, by whether textures have alpha:
a crisp outline is worth something, where alpha is stored anyway it is worth less."""

AROUND = 2
"""Pixels by which an outline keeps off where alpha shows the details."""


@dataclass(frozen=True, eq=False)
class LayerPlan:
    """Plan of a layer.

    Attributes:
        name: Name of the layer.
        boundary: Boundary at rest; None for the whole canvas.
        mesh: Mesh of the layer, or None.
        parent: Name of the layer or group that the layer follows, or None.
        alpha: float32 [H, W] in 0..1, that of a soft layer, which is clear along its boundary; None
            for others.
    """

    name: str
    boundary: Boundary | None
    mesh: Mesh | None = None
    parent: str | None = None
    alpha: Floats | None = None


@dataclass(frozen=True, eq=False)
class Plan:
    """Plan of the layers of a picture.

    Attributes:
        layers: Layers, back to front.
        channels: Channels of their textures: 3 for colour, 4 for colour and alpha.
        opaque: Whether the back layer covers the whole canvas.
        groups: Parent of each group, or None, by the group's name.
    """

    layers: tuple[LayerPlan, ...]
    channels: int
    opaque: bool
    groups: Mapping[str, str | None] = field(default_factory=dict)


def plan_layers(picture: Floats, settings: Settings, masks: Sequence[Region] | None) -> Plan:
    """Decomposes a picture into layers.

    Args:
        picture: float32 [H, W, 4] in 0..1 with straight alpha.
        settings: Settings of the encoder.
        masks: Layers given by the user, back to front; None to find them by the segmenter.

    Returns:
        The plan, without meshes. A picture that is clear everywhere has one layer called ``empty``.

    Raises:
        InputError: A mask is invalid or does not fit the picture, or there are too many.
        UsageError: There is no such segmenter or model of depth, or `matte` does not suit.
    """
    height, width = picture.shape[:2]
    alpha = picture[..., 3]
    opaque = bool((alpha == 1).all())
    translucent = _translucent(alpha)
    sizes = cv2.connectedComponentsWithStats(translucent.astype(np.uint8))[2][1:, cv2.CC_STAT_AREA]
    soft = bool(sizes.max(initial=0) >= SOFT_PIXELS)
    support = None if opaque else alpha >= 0.5
    if support is not None and soft:
        # Crisp outlines stay where they are; only translucent parts extend the support.
        around = _dilate(translucent, 3) | _faint(alpha)
        support |= around if settings.pyramid else around & (alpha > 0)
    if support is not None and not support.any():
        return Plan((LayerPlan("empty", None),), 4, False)
    if masks is not None:
        _check_masks(masks)
        regions = resolve(matted(masks, picture, settings, opaque), height, width, support)
    else:
        regions = matted(_found(picture, settings, support), picture, settings, opaque)
    check_count(len(regions), "layers, with what no mask covers,")
    boundaries = _outlines(regions, alpha, soft, settings)
    if settings.pyramid and not opaque and _too_coarse(boundaries, alpha, soft, settings):
        soft, regions = True, _with_room(regions, alpha)
        boundaries = _outlines(regions, alpha, soft, settings)
    layers = tuple(
        LayerPlan(region.name, boundary, parent=region.parent, alpha=region.alpha)
        for region, boundary in zip(regions, boundaries, strict=True)
    )
    return Plan(layers, 4 if soft else 3, opaque, groups_of(regions))


def _outlines(
    regions: Sequence[Region], alpha: Floats, soft: bool, settings: Settings
) -> list[Boundary | None]:
    """Boundaries of regions; None for the back of an opaque picture.

    Args:
        regions: Regions, back to front, with masks bool [H, W].
        alpha: float32 [H, W] in 0..1, that of the picture.
        soft: Whether textures have alpha, which then shows the details.
        settings: Settings of the encoder.
    """
    opaque = bool((alpha == 1).all())
    outline = alpha if not opaque and not soft and alpha.size <= FINE_PIXELS else None
    solid = None if opaque and settings.pyramid else alpha >= 0.97
    found: list[Boundary | None] = []
    front = np.zeros(alpha.shape, bool)
    for k, region in reversed(list(enumerate(regions))):
        boundary = None
        if not opaque or k > 0:
            mask = _continued(region.mask, front, soft and settings.pyramid, solid)
            boundary = _boundary(mask, outline, settings)
        found.insert(0, boundary)
        front |= region.mask
    return found


def _continued(
    mask: NDArray[np.bool_],
    front: NDArray[np.bool_],
    soft: bool,
    solid: NDArray[np.bool_] | None,
) -> NDArray[np.bool_]:
    """Mask of a layer as its boundary has it: with what may be, and what must be, hidden of it.

    Args:
        mask: bool [H, W], the mask of the layer.
        front: bool [H, W], the masks of all in front of it.
        soft: Whether planes have alpha: what is translucent in them must not lie in two layers.
        solid: bool [H, W], pixels that let nothing through. Hidden parts keep away from others, and
            from outlines of layers in front with nothing of this layer beyond, where the coverage
            of both would add up. None for planes of an opaque picture, where neither matters.
    """
    seen, hidden = mask & ~front, mask & front
    more = _dilate(seen, OVERLAP) & front
    if soft and solid is not None:
        more &= solid
    if hidden.any():
        # The layer goes on by itself where its outline crosses another.
        beyond = more & ~hidden
        _, labels, stats, _ = cv2.connectedComponentsWithStats(beyond.astype(np.uint8))
        corners = np.unique(labels[beyond & _dilate(hidden, 1)])
        more &= ~np.isin(labels, corners[stats[corners, cv2.CC_STAT_AREA] <= CORNER])
    if solid is not None:
        hidden &= _eroded(solid & (mask | front), OVERLAP)
    return np.asarray(seen | hidden | more)


def regions_of_picture(picture: Floats, settings: Settings) -> list[Region]:
    """Finds the regions of a picture by the segmenter.

    Args:
        picture: float32 [H, W, 4] in 0..1 with straight alpha.
        settings: Settings of the encoder.

    Returns:
        Regions back to front; none if the picture is clear everywhere.

    Raises:
        UsageError: There is no such segmenter.
    """
    alpha = picture[..., 3]
    return _found(picture, settings, None if (alpha == 1).all() else alpha >= 0.5)


def _found(picture: Floats, settings: Settings, support: NDArray[np.bool_] | None) -> list[Region]:
    """Regions that the segmenter finds, or the whole support if one layer is asked for."""
    if settings.max_layers == 1:
        whole = np.ones(picture.shape[:2], bool) if support is None else support
        return [Region("picture", whole)]
    rgb = np.rint(picture[..., :3] * 255).astype(np.uint8)
    regions = find_segmenter(settings.segmenter, settings.jobs)(rgb, settings.max_layers, support)
    if settings.depth is not None and len(regions) > 1:
        depth = find_depth(settings.depth, settings.jobs)(rgb)
        regions = ordered_by_depth(regions, depth, opaque=support is None)
    return regions


def _boundary(mask: NDArray[np.bool_], outline: Floats | None, settings: Settings) -> Boundary:
    """Fits a boundary to a mask.

    Args:
        mask: bool [H, W], True inside.
        outline: float32 [H, W] alpha whose 0.5 contour is traced on the finer grid, within the
            mask; or None.
        settings: Settings of the encoder.
    """
    fit_method: Callable[..., list[NDArray[np.int64]]] = fit_paths
    if settings.boundary == "chamfer":
        from .chamfer import fit_paths_chamfer

        fit_method = fit_paths_chamfer
    if outline is None:
        return Boundary(UNIT, tuple(fit_method(mask, step=2.0**-UNIT)))
    size = (mask.shape[1] << FINE, mask.shape[0] << FINE)
    inside = cv2.resize(outline, size, interpolation=cv2.INTER_LINEAR) >= 0.5
    # One pixel of slack, because interpolated alpha may reach 0.5 just outside the mask.
    near = cv2.resize(_dilate(mask, 1).astype(np.uint8), size, interpolation=cv2.INTER_NEAREST)
    fine = inside & (near > 0)
    if not fine.any():
        fine = cv2.resize(mask.astype(np.uint8), size, interpolation=cv2.INTER_NEAREST) > 0
    return Boundary(
        FINE + 1, tuple(fit_method(fine, step=0.5, **FINE_TOLERANCE[settings.boundary]))
    )


def _too_coarse(
    boundaries: Sequence[Boundary | None], alpha: Floats, soft: bool, settings: Settings
) -> bool:
    """Whether outlines show alpha, float32 [H, W] in 0..1, worse than the quality allows.

    If textures have alpha, which `soft` tells, that takes away what is too much. Outlines miss thin
    details and the width of soft rims. The squared error of coding, in levels of 8 bits, is about
    step**1.5 / 10 (measured on sprites at qualities from 36 to 68).
    """
    covered = coverage_together(boundaries, alpha.shape[1], alpha.shape[0])
    if not ((alpha > 0) & (alpha < 1)).any():  # then whole pixels count, not the steps of the rim
        covered = np.rint(covered)
    missed = alpha - covered
    error = SEEN * 255**2 * float(((np.maximum(missed, 0) if soft else missed) ** 2).mean())
    return error > TOLERABLE[soft] * 2 ** (1.5 * settings.step / 64) / 10


def alike(settings: Settings) -> float:
    """Difference between alpha and coverage, 0..1, that coding hides: a quantization step."""
    return float(2 ** (settings.step / 64) / 255)


def _with_room(regions: Sequence[Region], alpha: Floats) -> list[Region]:
    """Regions whose masks keep off from all that alpha, float32 [H, W] in 0..1, shows."""
    covered = np.logical_or.reduce([r.mask for r in regions])
    room = _dilate(alpha > 0.02, AROUND) & ~covered
    # What is around goes to the nearest region, and of those there to the one in front.
    front = np.zeros(alpha.shape, np.int32)
    for k, region in enumerate(regions):
        front[region.mask] = k
    _, nearest = cv2.distanceTransformWithLabels(
        (~covered).astype(np.uint8), cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL
    )
    owner = np.zeros(int(nearest.max()) + 1, np.int32)
    owner[nearest[covered]] = front[covered]
    return [replace(r, mask=r.mask | (room & (owner[nearest] == k))) for k, r in enumerate(regions)]


def _eroded(mask: NDArray[np.bool_], radius: int) -> NDArray[np.bool_]:
    """Mask without what is nearer to the outside than a radius; the frame is no outside."""
    return ~_dilate(~mask, radius)


def _check_masks(masks: Sequence[Region]) -> None:
    check_count(len(masks), "masks")
    for region in masks:
        name: object = region.name
        if not (isinstance(name, str) and 1 <= len(name) <= NAME_MAX and name.isprintable()):
            raise InputError(f"mask name {name!r} must be 1..{NAME_MAX} printable characters")


def _translucent(alpha: Floats) -> NDArray[np.bool_]:
    """Translucent pixels, bool [H, W], except for the anti-aliased rims of outlines."""
    inside = alpha >= 0.5
    rim = _dilate(inside, 2) & _dilate(~inside, 2)
    return (alpha > 0.03) & (alpha < 0.97) & ~rim


def _faint(alpha: Floats) -> NDArray[np.bool_]:
    """Translucent pixels, bool [H, W], except for those between opaque and clear ones.

    So a soft slope counts that passes one half where the picture ends.
    """
    rim = _dilate(alpha >= 0.97, 2) & _dilate(alpha <= 0.03, 2)
    return (alpha > 0.03) & (alpha < 0.97) & ~rim

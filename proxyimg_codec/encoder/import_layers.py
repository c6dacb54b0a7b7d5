"""Encoding of a layered picture as a `Picture`, layer by layer.

Unlike a layer of a flat picture, a layer here has a texture of all its pixels, also of those that
other layers hide.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import cv2
import numpy as np

from .. import plugins
from ..errors import InputError
from ..geometry.pose import OPACITY_MAX, Pose
from ..io.samples import to_float
from ..limits import DEFAULT_LIMITS, enough_memory
from ..model import Layer, Layers, Picture
from ..texture.implicit import Box, ImplicitTexture
from ..texture.network import Floats, NetShape, Network
from .encode import Progress, check_blocks, fit_image
from .implicit.fit_problem import Problem, build_apart
from .layered.source import LayeredPicture, SourceLayer
from .settings import Settings
from .shapes.layers import LayerPlan, Plan, plan_layers
from .shapes.masks import unique_names
from .shapes.meshes import with_meshes

MARGIN = 8
"""Pixels around a layer that take part in the fit of its boundary."""

SURE = 0.5
"""Least alpha at which the colour of a pixel is trusted, in a layer without translucent parts."""


def encode_layers(
    picture: LayeredPicture, settings: Settings | None = None, progress: Progress | None = None
) -> tuple[Any, LayeredPicture]:
    """Encodes a layered picture, layer by layer.

    Each layer has all its pixels. As a pyramid it has planes of its own; of implicit textures, all
    opaque layers share one network, and all others another one. Texture ``auto`` is implicit if
    another setting needs it, or if the layers have more samples than readers accept by default.
    Opacity, visibility and groups of the layers are kept, and so are the metadata blocks.

    Args:
        picture: Layers on a canvas, such as `read_openraster` returns.
        settings: Settings of the encoder; those of segmentation have no effect.
        progress: Called with the name of a stage, and its numbers of units done and in all.

    Returns:
        The `Image` as a reader will decode it, and `picture` without the layers that were left out
        because they have too few or too faint pixels.

    Raises:
        InputError: No layer is left, or a mesher fails.
        UsageError: A metadata block is invalid, there is no such mesher, or a target size or PSNR
            is out of reach.
        UnsupportedError: A package that is needed is not installed.
        LimitError: The canvas is larger than readers accept by default, or needs more memory than
            there is.
    """
    found, kept = encode_layered(picture, settings, progress)
    return plugins.find("handles", "image")(found), kept


@enough_memory("to encode the picture; make it smaller, or encode it in parts")
def encode_layered(
    picture: LayeredPicture, settings: Settings | None = None, progress: Progress | None = None
) -> tuple[Picture, LayeredPicture]:
    """Encodes a layered picture as `encode_layers` does, and returns it as data."""
    settings = _settled(settings or Settings(), picture)
    report = progress or (lambda stage, done, total: None)
    DEFAULT_LIMITS.check("side", max(picture.width, picture.height))
    check_blocks(picture.blocks)
    picture, plans = _planned(picture, settings, report)
    sources = picture.layers
    visible = composite(picture)
    visible[..., :3] *= visible[..., 3:]
    whole = Plan(tuple(p.layers[0] for p in plans), 4, False)
    meshed = with_meshes(visible, whole, settings).layers
    covered = plans[0].opaque and not sources[0].hidden and sources[0].opacity == 1
    channels = [plan.channels for plan in plans]
    if settings.pyramid:
        return _stacked(picture, meshed, channels, covered, settings, report), picture
    # Opaque layers have a network of their own without alpha, so that they stay exactly opaque.
    parts = []
    for kind in (3, 4):
        which = [k for k, own in enumerate(channels) if own == kind]
        if which:
            some = replace(picture, layers=tuple(sources[k] for k in which))
            plan = Plan(tuple(meshed[k] for k in which), kind, False)
            parts.append(_fitted(some, plan, settings, report))
    return _merged(parts, picture, covered), picture


def _settled(settings: Settings, picture: LayeredPicture) -> Settings:
    """Settles which coder the texture ``auto`` stands for."""
    if settings.texture != "auto" or not settings.pyramid or settings.target:
        return settings
    samples = 2 * sum(math.prod(source.pixels.shape[:2]) for source in picture.layers)
    few = samples <= DEFAULT_LIMITS.samples or settings.tune != "mse"
    return replace(settings, texture="pyramid" if few else "implicit")


def _planned(
    picture: LayeredPicture, settings: Settings, report: Progress
) -> tuple[LayeredPicture, list[Plan]]:
    """Plans each layer; returns the source without layers that are too faint, and the plans."""
    sources: list[SourceLayer] = []
    plans: list[Plan] = []
    left_out = list(picture.left_out)
    for k, source in enumerate(picture.layers):
        report("layers", k, len(picture.layers))
        plan = _plan(source, picture, settings)
        if plan.layers[0].boundary is None and not plan.opaque:
            left_out.append(source.name)
        else:
            sources.append(source)
            plans.append(plan)
    if not sources:
        raise InputError("all layers are empty, or too faint to be seen")
    return replace(picture, layers=tuple(sources), left_out=tuple(left_out)), plans


def _stacked(
    picture: LayeredPicture, plans: Sequence[LayerPlan], channels: Sequence[int], covered: bool,
    settings: Settings, report: Progress,
) -> Picture:  # fmt: skip
    """Encodes layers with pyramid textures."""
    from .pyramid.stack import encode_stack
    from .pyramid.tiles import with_tiles

    def pixels_of(number: int, box: Box) -> Floats:
        pixels = _on_canvas(picture.layers[number], box)
        alpha = pixels[..., 3].copy()
        cleaned = _clean(pixels, channels[number] == 4)
        cleaned[..., 3] = alpha
        return cleaned

    def finished(found: Picture) -> Picture:
        return with_tiles(_merged([found], picture, covered), settings)

    pairs = list(zip(plans, channels, strict=True))
    return encode_stack(pairs, pixels_of, finished, composite(picture), settings, report)


def _fitted(
    picture: LayeredPicture,
    plan: Plan,
    settings: Settings,
    report: Progress,
) -> Picture:
    """Encodes the layers of `picture` as a picture with one network."""
    size = (picture.width, picture.height)

    def picture_of(k: int) -> Floats:
        return _clean(_on_canvas(picture.layers[k], (0, 0, *size)), plan.channels == 4)

    def problem_of(shape: NetShape, spacing: float) -> Problem:
        return build_apart(picture_of, [v.boundary for v in plan.layers], shape, spacing, size)

    pixels = sum(math.prod(source.pixels.shape[:2]) for source in picture.layers)
    return fit_image(problem_of, pixels, plan, size, settings, report)


def _merged(parts: Sequence[Picture], picture: LayeredPicture, opaque: bool) -> Picture:
    """Merges encoded parts into one picture.

    Args:
        parts: Pictures with at most one network each; every layer of `picture` is in one of them.
        picture: The source, for order, poses and groups of the layers.
        opaque: Whether the back layer covers the canvas.
    """
    sources = picture.layers
    paths = {s.groups[: i + 1]: "" for s in sources for i in range(len(s.groups))}
    names = unique_names([*(s.name for s in sources), *(path[-1] for path in paths)])
    paths = dict(zip(paths, names[len(sources) :], strict=True))
    fitted: dict[str, Layer] = {}
    networks: list[Network] = []
    for part in parts:
        for layer in part.layers:
            texture = layer.texture
            if isinstance(texture, ImplicitTexture):
                texture = replace(texture, network=texture.network + len(networks))
            fitted[layer.name] = replace(layer, texture=texture)
        networks += part.networks
    layers = [
        replace(
            fitted[s.name],
            pose=Pose(opacity=round(s.opacity * OPACITY_MAX), hidden=s.hidden),
            parent=paths.get(s.groups),
        )
        for s in sources
    ]
    return replace(
        parts[0],
        channels=max(part.channels for part in parts),
        opaque=opaque,
        depth=16 if any(s.pixels.dtype == np.uint16 for s in sources) else 8,
        layers=Layers(layers),
        networks=tuple(networks),
        blocks=dict(picture.blocks),
        info=parts[0].info and {**parts[0].info, "areas": _areas(picture)},
        groups={name: paths.get(path[:-1]) for path, name in paths.items()},
    )


def _areas(picture: LayeredPicture) -> list[int]:
    """Number of visible pixels of each layer; translucent ones count in part."""
    clear = np.ones((picture.height, picture.width), np.float32)
    areas = []
    for layer in reversed(picture.layers):
        alpha = to_float(layer.pixels)[0][..., 3] * np.float32(layer.opacity * (not layer.hidden))
        height, width = alpha.shape
        below = clear[layer.y : layer.y + height, layer.x : layer.x + width]
        areas.append(round(float((alpha * below).sum(dtype=np.float64))))
        below *= 1 - alpha
    return areas[::-1]


def composite(picture: LayeredPicture) -> Floats:
    """Composites the visible layers: float32 [H, W, 4] in 0..1 with straight alpha."""
    result = np.zeros((picture.height, picture.width, 4), np.float32)
    for layer in picture.layers:
        if layer.hidden:
            continue
        source = to_float(layer.pixels)[0]
        height, width = source.shape[:2]
        alpha = source[..., 3:] * np.float32(layer.opacity)
        below = result[layer.y : layer.y + height, layer.x : layer.x + width]
        below *= 1 - alpha
        below[..., :3] += source[..., :3] * alpha
        below[..., 3:] += alpha
    result[..., :3] /= np.maximum(result[..., 3:], np.float32(1e-6))
    return np.clip(result, 0, 1)


def _plan(layer: SourceLayer, picture: LayeredPicture, settings: Settings) -> Plan:
    """Plans one layer as a picture of its own; the boundary is in canvas coordinates."""
    height, width = layer.pixels.shape[:2]
    x0, y0 = max(layer.x - MARGIN, 0), max(layer.y - MARGIN, 0)
    x1 = min(layer.x + width + MARGIN, picture.width)
    y1 = min(layer.y + height + MARGIN, picture.height)
    alone = _on_canvas(layer, (x0, y0, x1 - x0, y1 - y0))
    plan = plan_layers(alone, replace(settings, max_layers=1), None)
    outline = plan.layers[0].boundary
    if outline is None:
        return replace(plan, layers=(LayerPlan(layer.name, None),))
    moved = tuple(p + np.array([x0, y0]) * (1 << outline.unit) for p in outline.paths)
    return replace(plan, layers=(LayerPlan(layer.name, replace(outline, paths=moved)),))


def _on_canvas(layer: SourceLayer, region: tuple[int, int, int, int]) -> Floats:
    """Places a layer alone on a region x, y, w, h of the canvas.

    Returns:
        float32 [h, w, 4] in 0..1 with straight alpha, clear outside the layer.
    """
    x, y, width, height = region
    canvas = np.zeros((height, width, 4), np.float32)
    source = to_float(layer.pixels)[0]
    row, column = layer.y - y, layer.x - x
    top, left = max(row, 0), max(column, 0)
    seen = source[top - row : height - row, left - column : width - column]
    canvas[top : top + seen.shape[0], left : left + seen.shape[1]] = seen
    return canvas


def _clean(picture: Floats, soft: bool) -> Floats:
    """Continues the colours of a layer beyond its rim.

    Decoders draw the rim by the coverage of the boundary, so the texture there has to have the
    colours of the inside. Each pixel that is not trusted takes the colour of the nearest one that
    is.

    Args:
        picture: float32 [H, W, 4] with straight alpha; it is changed.
        soft: Whether the texture has alpha. If so, all pixels with any alpha are trusted; if not,
            those with at least `SURE`, and alpha becomes 1 everywhere.

    Returns:
        The changed `picture`.
    """
    alpha = picture[..., 3]
    sure = alpha > 0 if soft else alpha >= SURE
    _, nearest = cv2.distanceTransformWithLabels(
        (~sure).astype(np.uint8), cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL
    )
    colours = np.zeros((int(nearest.max()) + 1, 3), np.float32)
    colours[nearest[sure]] = picture[sure][:, :3]
    picture[..., :3] = colours[nearest]
    if not soft:
        picture[..., 3] = 1
    return picture

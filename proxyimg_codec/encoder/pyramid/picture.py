"""Encoding of planned layers as a `Picture` whose layers are views of shared planes."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...codec.write import to_bytes
from ...errors import UsageError
from ...geometry.boundary import Boundary
from ...model import Layer, Layers, Picture
from ...render.quality import psnr
from ...texture.network import Floats
from ...texture.occlusion import Occlusion
from ...texture.planes import Planes, blocks
from ...texture.pyramid import PyramidTexture
from ..completion.behind import Source, pixels_behind
from ..completion.hidden import copies_of
from ..completion.membrane import continued, continued_from
from ..settings import Settings
from ..shapes.coverage import coverage_of, coverage_together
from ..shapes.layers import Plan, alike
from .encode import CELL, EFFORTS, Raster, encode
from .goal import Effort
from .matte import Soft, soft_rasters

Report = Callable[[str, int, int], None]
Box = tuple[int, int, int, int]
View = tuple[Box, Occlusion | None]

TOLERANCE = 0.015
"""Deviation from a target that is good enough: of the logarithm of a size, or of PSNR / 5 dB."""

TRIES = 6
"""Most attempts to meet a target, with little effort and again with full effort."""

FIRST_STEP, LAST_STEP = 0, 640
"""Range of the index s of the quantization step 2**(s / 64)."""


@dataclass
class Interrupts:
    """Record of `KeyboardInterrupt`, after which refinement stops and searches end.

    Attributes:
        seen: Whether there was one.
    """

    seen: bool = False


SURE = 0.5
"""Least coverage at which alpha is taken from the pixel; it continues beyond."""


def encode_picture(
    picture: Floats, plan: Plan, settings: Settings, report: Report, behind: Source | None = None
) -> Picture:
    """Encodes planned layers with pyramid textures.

    On `KeyboardInterrupt` during refinement, the picture has the latents that were found so far.

    Args:
        picture: float32 [H, W, 4] in 0..1 with straight alpha.
        plan: Plan of the layers.
        settings: Settings of the encoder.
        report: Called with the name of a stage, and its numbers of units done and in all.
        behind: What gives the hidden pixels of the back layer; None if they are copied or filled.

    Returns:
        A picture with a depth of 8 bits, without metadata.

    Raises:
        InputError: An inpainter fails.
        UsageError: A target size or PSNR is out of reach.
    """
    height, width = picture.shape[:2]
    views, softs = _views(picture, plan)
    rasters = [colour_of(picture)._replace(structural=settings.tune == "ms-ssim")]
    if plan.channels == 4:
        share = coverage_together([v.boundary for v in plan.layers], width, height)
        rasters.append(alpha_of(within(picture[..., 3], share, alike(settings))))
    shared = len(rasters)
    own = [] if behind is None else _behind(rasters, views[0][1], behind)
    rasters += own
    numbers = [dict[str, int]() for _ in views]
    numbers[0] = {name: shared + i for i, name in enumerate(("behind", "behind_alpha")[: len(own)])}
    for k, each in softs.items():
        numbers[k] = {"behind": len(rasters), "matte": len(rasters) + 1}
        rasters += [each.behind, each.matte]
    copies = []
    for k, (_, cuts) in enumerate(views):
        report("hidden", k, len(views))
        soft = softs[k].samples if k in softs else None
        copies.append(None if own and k == 0 else copies_of(picture, cuts, settings, soft))

    def picture_of(sources: Sequence[Planes]) -> Picture:
        alpha = sources[1] if shared > 1 else None
        layers = []
        for v, (box, cuts), copied, named in zip(plan.layers, views, copies, numbers, strict=True):
            planes: dict[str, Any] = {name: sources[number] for name, number in named.items()}
            shown = PyramidTexture(sources[0], alpha, box, cuts=cuts, copies=copied, **planes)
            layers.append(Layer(v.name, box, v.boundary, shown, v.mesh, parent=v.parent))
        channels = 4 if softs else plan.channels
        return Picture(width, height, channels, plan.opaque, 8, Layers(layers), (),
                       groups=plan.groups)  # fmt: skip

    return encode_rasters(rasters, picture_of, picture, settings, report)


def _views(picture: Floats, plan: Plan) -> tuple[list[View], dict[int, Soft]]:
    """Rectangles and cuts of all layers, and rasters of soft ones."""
    height, width = picture.shape[:2]
    boundaries = [v.boundary for v in plan.layers]
    views, softs = list[View](), dict[int, Soft]()
    for k, layer in enumerate(plan.layers):
        covered = coverage_of(layer.boundary, width, height).reshape(height, width)
        box, cuts = _view(boundaries, k, covered)
        if layer.alpha is not None and cuts is not None:
            found = soft_rasters(picture[..., :3], layer.alpha, covered, cuts)
            softs |= {} if found is None else {k: found}
        views.append((box, replace(cuts, unmix=False) if cuts and k in softs else cuts))
    return views, softs


def encode_rasters(
    rasters: Sequence[Raster], picture_of: Callable[[Sequence[Planes]], Picture], original: Floats,
    settings: Settings, report: Report,
) -> Picture:  # fmt: skip
    """Encodes rasters so that the picture made of them meets the target of the settings, if any.

    Args:
        rasters: The rasters.
        picture_of: Makes the picture of the planes of all rasters.
        original: float32 [H, W, 4] in 0..1 with straight alpha: how the picture should look.
        settings: Settings of the encoder.
        report: As for `encode_picture`.

    Raises:
        UsageError: A target size or PSNR is out of reach.
    """
    interrupts = Interrupts()

    def at(step: int, effort: Effort) -> Picture:
        return picture_of(_coded(rasters, step, effort, settings, report, interrupts))

    effort = EFFORTS[settings.effort - 1]
    if settings.target is None:
        return at(settings.step, effort)
    return _aimed(at, original, settings, effort, interrupts)


def _coded(
    rasters: Sequence[Raster], step: int, effort: Effort, settings: Settings, report: Report,
    interrupts: Interrupts,
) -> list[Planes]:  # fmt: skip
    """Encodes all rasters at the step of index `step`; records an interrupt in `interrupts`."""
    work = sum(r.samples[..., 0].size * r.effort(effort).turns(r.structural) for r in rasters)
    done = 0

    def tick(samples: int) -> None:
        nonlocal done
        done += samples
        report("texture", done * settings.steps // work, settings.steps)

    out = []
    for raster in rasters:
        planes, complete = encode(
            raster, step, Effort(0, 0) if interrupts.seen else raster.effort(effort),
            settings.seed, tick, settings.jobs,
        )  # fmt: skip
        interrupts.seen |= not complete
        out.append(planes)
    return out


def _aimed(
    at: Callable[[int, Effort], Picture], picture: Floats, settings: Settings, effort: Effort,
    interrupts: Interrupts,
) -> Picture:  # fmt: skip
    """Finds a step at which the picture meets the target: with little effort first, then with full.

    Args:
        at: Encodes the picture at an index of the step, with some effort.
        picture: float32 [H, W, 4] in 0..1 with straight alpha.
        settings: Settings with a target.
        effort: Full effort.
        interrupts: Record that ends the search early.

    Raises:
        UsageError: The target is out of reach.
    """
    kind, wanted = settings.target or ("", 0.0)
    pixels = picture.shape[0] * picture.shape[1]

    def off(image: Picture) -> float:
        """Deviation from the target as for `TOLERANCE`; positive if there are too many bits."""
        if kind == "psnr":
            found = psnr(picture if picture[..., 3].min() < 1 else picture[..., :3], image)
            return (99.0 if found is None else found) / 5 - wanted / 5
        size = len(to_bytes(image))
        return math.log((8 * size / pixels if kind == "bpp" else size) / wanted)

    step, slope = settings.step, -0.0095
    for trial in (Effort(1, 1), effort):
        seen: list[tuple[int, float]] = []
        for _ in range(TRIES):
            image = at(step, trial)
            error = off(image)
            seen.append((step, error))
            if abs(error) <= TOLERANCE or interrupts.seen:
                break
            if len(seen) > 1 and seen[-2][0] != step:
                measured = (error - seen[-2][1]) / (step - seen[-2][0])
                slope = measured if -0.05 < measured < -0.001 else slope
            moved = min(max(round(step - error / slope), FIRST_STEP), LAST_STEP)
            if moved == step:
                break
            step = moved
    if abs(error) > 2 * TOLERANCE and not interrupts.seen:
        raise UsageError(f"target {kind} {wanted:g} is out of reach for this picture")
    return image


def _view(boundaries: Sequence[Boundary | None], number: int, covered: Floats) -> View:
    """Box and cuts of a layer.

    Args:
        boundaries: Boundaries of all layers at rest, back to front.
        number: Number of the layer.
        covered: float32 [H, W] share of each sample that it covers, whether that shows or not.

    Returns:
        The rectangle x, y, width, height that holds the layer, and the boundaries that cut it; None
        if there is only one layer.
    """
    height, width = covered.shape
    rows, columns = np.flatnonzero(covered.any(1)), np.flatnonzero(covered.any(0))
    if boundaries[number] is None or not len(rows):  # the whole canvas, or too small to be seen
        box = (0, 0, width, height)
    else:
        # A margin for the interpolating kernel, whose samples beyond the rim are then filled.
        x0, y0 = max(int(columns[0]) - 2, 0), max(int(rows[0]) - 2, 0)
        x1, y1 = min(int(columns[-1]) + 3, width), min(int(rows[-1]) + 3, height)
        box = (x0, y0, x1 - x0, y1 - y0)
    if len(boundaries) == 1:
        return box, None
    cuts = [
        k for k, boundary in enumerate(boundaries)
        if boundary is not None and (k == number or (k > number and _meets(boundary, box)))
    ]  # fmt: skip
    return box, Occlusion.of(cuts, number, boundaries, box)


def _meets(boundary: Boundary, box: Box) -> bool:
    """Whether the bounds of a boundary and a box have a pixel in common."""
    x0, y0, x1, y1 = boundary.bounds()
    x, y, width, height = box
    return x0 < x + width and x < x1 and y0 < y + height and y < y1


def colour_of(picture: Floats) -> Raster:
    """Makes a raster of the colours of a picture; clear pixels continue the colours of others.

    Args:
        picture: float32 [H, W, 4] in 0..1 with straight alpha.
    """
    samples, alpha = picture[..., :3] * np.float32(255), picture[..., 3]
    grey = bool((samples == samples[..., :1]).all())
    if (alpha == 1).all():
        return Raster(np.ascontiguousarray(samples), None, None, grey)
    weight = alpha**2
    samples = np.where(alpha[..., None] > 0, samples, continued(samples, alpha))
    return Raster(samples.astype(np.float32), weight, _cells(alpha > 0), grey)


def alpha_of(alpha: Floats) -> Raster:
    """Makes a grey raster of alpha, float32 [H, W] in 0..1."""
    samples = np.repeat(alpha[..., None] * np.float32(255), 3, 2)
    return Raster(samples, grey=True, alpha=True)


def within(alpha: Floats, share: Floats, same: float) -> Floats:
    """Alpha that is `alpha` again, float32 [H, W], when layers are also cut by their outlines.

    Args:
        alpha: float32 [H, W] in 0..1, that of the picture.
        share: float32 [H, W] in 0..1, coverage of the outlines together.
        same: Difference of both up to which outlines alone show alpha.
    """
    sure = share >= SURE
    inside = np.where(sure, np.minimum(alpha / np.maximum(share, SURE), 1), 0)
    inside[sure & (share < 1) & (np.abs(alpha - share) < same)] = 1
    around = continued(inside[..., None].astype(np.float32), np.where(sure, share, 0))
    return np.where(sure, inside, around[..., 0]).astype(np.float32)


def _behind(rasters: Sequence[Raster], cuts: Occlusion | None, source: Source) -> list[Raster]:
    """Makes rasters of the hidden pixels of the back layer; none if nothing of it is hidden.

    Args:
        rasters: Rasters of the colour of the picture, and of its alpha if it has planes.
        cuts: Cuts of the back layer.
        source: What gives the pixels.

    Returns:
        The raster of colour, and if there is one of alpha, one that continues it.
    """
    found = pixels_behind(rasters[0].samples / np.float32(255), cuts, source)
    if found is None or cuts is None:
        return []
    pixels, hidden = found
    samples, weight, cells = pixels * np.float32(255), hidden.astype(np.float32), _cells(hidden)
    grey = rasters[0].grey and bool((samples == samples[..., :1]).all())
    made = [rasters[0]._replace(samples=samples, weight=weight, cells=cells, grey=grey)]
    x, y, width, height = cuts.box
    for alpha in rasters[1:]:
        part = alpha.samples[y : y + height, x : x + width]
        whole = continued_from(part, cuts.trusted)
        made.append(Raster(np.clip(whole, 0, 255), weight, cells, True))
    return made


def _cells(mask: NDArray[np.bool_]) -> NDArray[np.bool_] | None:
    """Cells of the support, bool [rows, columns], that hold a sample of a mask [H, W].

    None stands for all cells; at least one cell is True.
    """
    cells = blocks(mask, CELL)
    if not cells.any():
        cells[0, 0] = True
    return None if cells.all() else cells

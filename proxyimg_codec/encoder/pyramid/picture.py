"""Encoding of planned layers as a `Picture` whose layers are views of shared planes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...geometry.boundary import Boundary
from ...model import Layer, Layers, Picture
from ...texture.completion import Copies
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
from .target import aimed

Report = Callable[[str, int, int], None]
Box = tuple[int, int, int, int]
View = tuple[Box, Occlusion | None]

SURE = 0.5
"""Least coverage at which alpha is taken from the pixel; it continues beyond."""


def encode_picture(
    picture: Floats, plan: Plan, settings: Settings, report: Report,
    finished: Callable[[Picture], Picture], behind: Source | None = None,
) -> Picture:  # fmt: skip
    """Encodes planned layers with pyramid textures.

    On `KeyboardInterrupt` during refinement, the picture has the latents that were found so far.

    Args:
        picture: float32 [H, W, 4] in 0..1 with straight alpha.
        plan: Plan of the layers.
        settings: Settings of the encoder.
        report: Called with the name of a stage, and its numbers of units done and in all.
        finished: Gives the picture, of 8 bits and without metadata, what else its file has.
        behind: What gives the hidden pixels of the back layer; None if they are copied or filled.

    Returns:
        What `finished` makes.

    Raises:
        InputError: An inpainter fails.
        UsageError: A target size or PSNR is out of reach.
    """
    height, width = picture.shape[:2]
    views, softs = _views(picture, plan)

    def copied(k: int) -> Copies | None:
        if k == 0 and behind is not None:
            return None
        soft = softs[k].samples if k in softs else None
        return copies_of(picture, views[k][1], settings, soft)

    copies = _each_copied(copied, len(views), settings.jobs, report)  # before rasters take memory
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

    def picture_of(sources: Sequence[Planes]) -> Picture:
        alpha = sources[1] if shared > 1 else None
        layers = []
        for v, (box, cuts), copied, named in zip(plan.layers, views, copies, numbers, strict=True):
            planes: dict[str, Any] = {name: sources[number] for name, number in named.items()}
            shown = PyramidTexture(sources[0], alpha, box, cuts=cuts, copies=copied, **planes)
            layers.append(Layer(v.name, box, v.boundary, shown, v.mesh, parent=v.parent))
        channels = 4 if softs else plan.channels
        found = Picture(width, height, channels, plan.opaque, 8, Layers(layers), (),
                        groups=plan.groups)  # fmt: skip
        return finished(found)

    return encode_rasters(rasters, shared, picture_of, picture, settings, report)


def _each_copied(
    copied: Callable[[int], Copies | None], count: int, jobs: int, report: Report
) -> list[Copies | None]:
    """Finds what is copied into the hidden part of each layer, on several threads."""
    out = list[Copies | None]()
    report("hidden", 0, count)
    with ThreadPoolExecutor(jobs) as pool:
        for found in pool.map(copied, range(count)):
            out.append(found)
            report("hidden", len(out), count)
    return out


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
    rasters: Sequence[Raster], shown: int, picture_of: Callable[[Sequence[Planes]], Picture],
    original: Floats, settings: Settings, report: Report,
) -> Picture:  # fmt: skip
    """Encodes rasters so that the picture made of them meets the target of the settings, if any.

    Args:
        rasters: The rasters.
        shown: Number of rasters, the first ones, that show in the picture at rest.
        picture_of: Makes the picture of the planes of all rasters.
        original: float32 [H, W, 4] in 0..1 with straight alpha: how the picture should look.
        settings: Settings of the encoder.
        report: As for `encode_picture`.

    Raises:
        UsageError: A target size or PSNR is out of reach.
    """
    effort = EFFORTS[settings.effort_for(original[..., 0].size) - 1]
    work = sum(r.samples[..., 0].size * r.effort(effort).turns(r.structural) for r in rasters)
    done = 0

    def tick(samples: int) -> None:
        nonlocal done
        done += samples
        report("texture", min(done * settings.steps // work, settings.steps), settings.steps)

    if settings.target is not None:
        return aimed(rasters, shown, picture_of, original, settings, effort, tick)
    out = []
    for raster in rasters:
        own = raster.effort(effort)
        planes, complete = encode(raster, settings.step, own, settings.seed, tick, settings.jobs)
        effort = effort if complete else Effort(0, 0)
        out.append(planes)
    return picture_of(out)


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

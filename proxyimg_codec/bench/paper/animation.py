"""Section *animation*: how steady frames are along their motion, and how like the still."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from ...animate.animate import amplitude, preset
from ...animate.motion import PRESETS
from ...api import Image, encode
from ...encoder.shapes.mask_files import load_masks
from ...encoder.shapes.masks import Region
from ...errors import InputError
from ...geometry.mesher import derived
from ...model import Layers
from .. import rd
from ..features import BLOCK_FEATURES
from .items import Earlier, Effort, Given, Item, Pixels, Row
from .pictures import centre
from .tables import Column, Table

CODERS = ("implicit", "pyramid")

SECONDS, FPS = 4.0, 24

EDGE = 0.028
"""Edge length of the meshes, relative to the diagonal of a layer."""

PAIRS = 5
"""Pairs of consecutive frames, spread over the clip."""

ASIDE = 8
"""Pixels by which the still is moved for comparison."""


def conclusions(rows: Sequence[Row]) -> list[str]:
    """Sentences on how much of the change between frames is not motion."""
    said = []
    for coder in CODERS:
        group = [r for r in rows if r["coder"] == coder and r.get("idle")]
        if group:
            share = sum(r["flow"] / r["idle"] for r in group) / len(group)
            said.append(f"{coder}: {share:.0%} of the change between frames is not motion along "
                        "the known flow (mean of pictures and motions).")  # fmt: skip
    return said


TABLE = Table(
    rows=("coder", "motion"),
    columns=(
        Column("flow", "along the flow", "{:.2f}"),
        Column("idle", "without flow", "{:.2f}"),
        Column("step", "px a frame", "{:.2f}"),
        Column("gradients", "HOG distance", "{:.3f}"),
        Column("frechet", "Fréchet, HOG ×10⁻³", "{:.3f}"),
        Column("away", "px from rest", "{:.1f}"),
        Column("seconds", "CPU s", "{:.1f}"),
    ),
    charted="frechet",
    conclusions=conclusions,
    notes=(
        "Masks of the folder `kodak_masks` make the layers; each moves as a body of its own, "
        f"{SECONDS:g} s at {FPS} frames a second.",
        "*Along the flow* is the RMS difference, in 8-bit levels, of consecutive frames at points "
        "that show the same point of the same moving layer; *without flow* that of the same pixels "
        "where they stand. The flow is known, not estimated.",
        f"The Fréchet distance is FID's formula in another space: {BLOCK_FEATURES} features of "
        "histograms of oriented gradients of all blocks at three scales, of frames against the "
        "still. It cannot be compared with FID, whose network is not to be had here. For scale, "
        "*moved aside* is the still, moved 8 px, and *other pictures* are those of the section.",
        "VideoScore needs a large model that no package brings; its columns are missing. The "
        "paper's figures are of videos of its own, so none stand here.",
    ),
)


def items(given: Given, effort: Effort) -> list[Item]:
    """Items of crops of pictures of ``kodak/`` that have a label map in ``kodak_masks/``.

    Raises:
        InputError: One of the folders is missing, or no picture has a map.
    """
    folder = given.data / "kodak_masks"
    maps = {p.stem: p for p in rd.files_of(folder)}
    files = [p for p in rd.files_of(given.data / "kodak") if p.stem in maps]
    if not files:
        raise InputError(f"{folder}: has no label map of a picture of {given.data / 'kodak'}")
    loaded = {p.stem: rd.load(p)[..., :3] for p in files}
    masks = {name: _masks(maps[name], whole, effort.side) for name, whole in loaded.items()}
    # What is marked may lie outside of the crop.
    names = [name for name in loaded if masks[name]]
    names = names[:: max(len(names) // effort.few, 1)][: effort.few]
    cut = {name: centre(loaded[name], effort.side) for name in names}
    found = []
    for name, pixels in cut.items():
        others = [p for other, p in cut.items() if other != name]
        scale = partial(_scale, others=others)
        found.append(Item("animation", name, "for scale", repr(effort), pixels, scale))
        for coder in CODERS:
            run = partial(_measure, coder=coder, masks=masks[name], effort=min(effort.effort, 2))
            found.append(Item("animation", name, coder, repr(effort), pixels, run))
    return found


def _masks(path: Path, whole: Pixels, side: int) -> list[Region]:
    """Regions of the central crop that are neither empty nor all of it."""
    height, width = whole.shape[:2]
    regions = load_masks(path, width, height)
    cut = [Region(r.name, centre(r.mask, side)) for r in regions]
    return [r for r in cut if 0.005 < r.mask.mean() < 0.95]


def _scale(pixels: Pixels, earlier: Earlier, *, others: Sequence[Pixels]) -> list[Row]:
    """Rows for scale: what distances are large."""
    aside = [np.roll(pixels, ASIDE, 1)]
    named = {f"moved aside {ASIDE} px": aside, "other pictures": others}
    return [{"coder": "none", "motion": motion, **_likeness(pixels, shown)}
            for motion, shown in named.items() if shown]  # fmt: skip


def _likeness(still: Pixels, shown: Sequence[Pixels]) -> Row:
    from ..features import distance, frechet

    away = float(np.mean([distance(still, frame).mean() for frame in shown]))
    return {"gradients": round(away, 5), "frechet": round(1000 * frechet([still], shown), 5)}


def _measure(
    pixels: Pixels, earlier: Earlier, *, coder: str, masks: Sequence[Region], effort: int
) -> list[Row]:
    import time

    picture = encode(
        pixels, masks=list(masks), texture=coder, effort=effort, mesh="none", jobs=1
    ).picture
    back, *fronts = picture.layers
    meshed = [replace(v, mesh=derived(v.boundary, picture.size, EDGE)) for v in fronts]
    image = Image(replace(picture, layers=Layers([back, *meshed])))
    still, rows = image.render(), []
    for name in PRESETS:
        started = time.process_time()
        motion = preset(image, name, together=False, duration=SECONDS, fps=FPS)
        moved = image.animated(motion)
        row = {"coder": coder, "motion": name, **_steadiness(moved)}
        shown = [moved.render(t=k * SECONDS / PAIRS) for k in range(PAIRS)]
        row |= _likeness(still, shown) | {"away": round(amplitude(moved), 3)}
        rows.append(row | {"seconds": round(time.process_time() - started, 2)})
    return rows


def _steadiness(moved: Image) -> Row:
    """RMS differences of consecutive frames along the flow and without, and the displacement."""
    from ..consistency import pair

    assert moved.timeline is not None
    count, fps = moved.timeline.frames, moved.timeline.fps
    at = [k * count // PAIRS for k in range(PAIRS)]
    sums = np.sum([pair(moved.at(k / fps), moved.at((k + 1) / fps)) for k in at], axis=0)
    seen, exact, _, idle, length = (float(v) for v in sums)
    if not seen:
        return {"flow": None, "idle": None, "step": None}
    return {"flow": round((exact / seen) ** 0.5, 4), "idle": round((idle / seen) ** 0.5, 4),
            "step": round(length / seen, 4)}  # fmt: skip

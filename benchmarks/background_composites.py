"""Sprites pasted on photographs, removed again, and what is drawn there beside the photograph.

A part of `benchmarks.background`.
"""

from __future__ import annotations

import time
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks import background_scores as scores
from benchmarks.background_peers import PEERS
from benchmarks.background_scores import Mask, Real
from benchmarks.common import Pixels, kodak, read_rgb
from benchmarks.composites import reduced
from benchmarks.layer_scores import interval
from proxyimg_codec import encode
from proxyimg_codec.api import Image
from proxyimg_codec.bench.sprites import Sprite, scaled, solid
from proxyimg_codec.encoder.shapes.masks import Region
from proxyimg_codec.io import raster

COUNT = 40
"""Composites, unless fewer are asked for."""

SIDE = 480
"""Longer side of composites in pixels."""

SIZES = (0.35, 0.6)
"""Longer sides of sprites as shares of the shorter side of the photograph."""

MARGIN = 8
"""Pixels between a sprite and the frame, at least."""

LEAST = 500
"""Fewest pixels of a hole whose gradients count at all scales."""

TOUCHED = 2
"""Pixels around the hole that OpenCV fills too, because the codec smears the object into them."""

BAND, RING = 6, 30
"""Pixels inside the rim, and around the hole, that are looked at by themselves."""

OURS = ("auto", "smooth")
"""Backgrounds of ours: the default, and the smooth one, which is that of version 0.4.0."""

SCORES = (*(f"energy {s} px" for s in scores.STEPS), "patches", "hole", "rim", "structure")
"""Columns of the table of a composite."""

PATCHES, HOLE, RIM, STRUCTURE = range(3, 7)


class Composite(NamedTuple):
    """A sprite on a photograph.

    Attributes:
        photo: uint8 [H, W, 3] what is behind.
        mixed: uint8 [H, W, 3] what is seen.
        mask: bool [H, W], True where the sprite covers half or more.
        hole: bool [H, W], True where it covers more than 2 %.
    """

    photo: Pixels
    mixed: Pixels
    mask: Mask
    hole: Mask


def sprites(data: Path) -> list[Pixels]:
    """Sprites of ``clipart/`` and ``anime/`` that are solid objects, uint8 [h, w, 4]."""
    files = [*sorted((data / "clipart").glob("*.png")), *sorted((data / "anime").glob("*.png"))]
    pictures = [raster.read(path).pixels for path in files]
    cropped = [solid(p) for p in pictures if p.shape[2] == 4 and p.dtype == np.uint8]
    return [p for p in cropped if p is not None]


def pasted(photo: Pixels, sprite: Pixels, x: int, y: int) -> Composite:
    """Pastes a sprite uint8 [h, w, 4] on a photograph uint8 [H, W, 3], its corner at x, y."""
    layer = Sprite(sprite, x, y).on(photo.shape[:2]).astype(np.float64)
    alpha = layer[..., 3:] / 255
    mixed = np.rint(alpha * layer[..., :3] + (1 - alpha) * photo).astype(np.uint8)
    return Composite(photo, mixed, layer[..., 3] >= 128, layer[..., 3] > 5)


def composites(
    photos: list[Path], cut_out: list[Pixels], count: int, seed: int
) -> Iterator[Composite]:
    """Yields composites of photographs and sprites; the same for the same seed."""
    for k in range(count):
        rng = np.random.default_rng([seed, k])
        photo = reduced(read_rgb(photos[rng.integers(len(photos))]), SIDE)
        while True:
            sprite = cut_out[rng.integers(len(cut_out))]
            small = scaled(sprite, rng.uniform(*SIZES) * min(photo.shape[:2]))
            room = [photo.shape[k] - small.shape[k] - MARGIN for k in (0, 1)]
            y, x = (int(rng.integers(MARGIN, n)) for n in room)
            made = pasted(photo, small, x, y)
            if scores.eroded(made.hole, scores.STEPS[-1]).sum() >= LEAST:
                break
        yield made


def removed(images: dict[str, Image]) -> dict[str, Pixels]:
    """Removes the layer ``object`` of pictures: uint8 [H, W, 3] by the same names."""
    return {name: image.layers["object"].removed().render() for name, image in images.items()}


def inpainted(
    picture: Pixels, hole: Mask, names: Collection[str] = tuple(PEERS)
) -> dict[str, Pixels]:
    """Fills a hole bool [H, W] of a picture uint8 [H, W, 3] by methods of OpenCV."""
    wide = scores.dilated(hole, TOUCHED)
    return {name: PEERS[name](picture, wide) for name in names}


def scored(picture: Pixels, image: Composite) -> list[float]:
    """Scores of a picture without the object, in the order of `SCORES`."""
    photo, hole = image.photo, image.hole
    return [
        *scores.energies(picture, hole) / scores.energies(photo, hole),
        scores.coherence(picture, hole),
        scores.psnr(picture, photo, hole),
        scores.psnr(picture, photo, scores.rim(hole, BAND)),
        scores.structure(picture, photo, hole),
    ]


def surrounded(image: Composite) -> bool:
    """Whether what is around the hole has about as much energy as what it hides."""
    ring = scores.dilated(image.hole, RING) & ~image.hole
    ratios = scores.energies(image.photo, ring) / scores.energies(image.photo, image.hole)
    return bool(scores.alike(ratios))


def run(data: Path, count: int | None, seed: int, folder: Path | None) -> Iterator[str]:
    """Yields the scores of all methods, and whether ours are as good as they must be."""
    tables, truth, same, spent = list[list[list[float]]](), list[float](), list[bool](), []
    names = [*OURS, *PEERS]
    wanted = COUNT if count is None else count
    for k, image in enumerate(composites(kodak(data), sprites(data), wanted, seed)):
        images, seconds = {}, []
        for kind in OURS:
            start = time.process_time()
            masks = [Region("object", image.mask)]
            images[kind] = encode(image.mixed, masks=masks, background=kind, effort=1, jobs=1)
            seconds.append(time.process_time() - start)
        spent.append([*seconds, *(len(i.to_bytes()) for i in images.values())])
        pictures = removed(images) | inpainted(images[OURS[0]].render(), image.hole)
        tables.append([scored(pictures[name], image) for name in names])
        same.append(surrounded(image))
        truth.append(scores.coherence(image.photo, image.hole))
        if folder:
            row = [image.mixed, image.photo, *(pictures[name] for name in names)]
            raster.write(folder / f"composite-{k:02}.png", np.hstack(row))
    table, alike = np.array(tables), np.array(same)
    yield from _lines(names, table, alike)
    yield f"patches of the photograph itself: {np.mean(truth):.2f}"
    ours, theirs, size, smaller = np.mean(spent, 0)
    yield (
        f"{OURS[0]} against {OURS[1]}: {100 * (size / smaller - 1):+.2f} % bytes, "
        f"{ours - theirs:+.2f} CPU-s of {theirs:.2f}"
    )
    yield from judged(table, names)


def judged(table: Real, names: list[str]) -> Iterator[str]:
    """Yields each aim, whether the first method reaches it, and by which figure.

    Args:
        table: float64 [composites, methods, `SCORES`].
        names: Names of the methods.
    """
    mean, ours = table.mean(0), table[:, 0]
    smooth, shift = names.index("smooth"), names.index("shift map")
    share = float(scores.alike(ours[:, :PATCHES]).mean())
    ratio = float(mean[0, PATCHES] / mean[shift, PATCHES])
    hole, rim = mean[0, HOLE:STRUCTURE] - mean[smooth, HOLE:STRUCTURE]
    others = [k for k, name in enumerate(names) if name in PEERS]
    ahead = float(mean[others, STRUCTURE].min() - mean[0, STRUCTURE])
    for text, value, good in (
        ("energy within 0.5..1.5 at all scales in >= 80 %", f"{100 * share:.0f} %", share >= 0.8),
        ("patches <= 1.2 times shift map's", f"{ratio:.2f}", ratio <= 1.2),
        ("PSNR in the hole >= smooth - 1.7 dB", f"{hole:+.2f} dB", hole >= -1.7),
        (f"PSNR in {BAND} px inside the rim >= smooth - 0.5 dB", f"{rim:+.2f} dB", rim >= -0.5),
        ("structure ahead of all of OpenCV's", f"by {ahead:+.3f}", ahead > 0),
    ):
        yield f"{text}: {'yes' if good else 'NO'} ({value})"


def _lines(names: list[str], table: Real, same: NDArray[np.bool_]) -> Iterator[str]:
    """Yields a line for each method."""
    smooth, shift = table[:, names.index("smooth")], table[:, names.index("shift map")]
    yield (
        f"{len(table)} composites, 95 % intervals in brackets; energy: median of the ratios to the "
        "photograph's at 1, 2 and 4 px, share with all within 0.5..1.5, and that of the "
        f"{same.sum()} whose surroundings have such an energy; patches: mean distance in levels, "
        "and its ratio to shift map's; PSNR in dB, less that of smooth; structure: 0 is best"
    )
    for name, own in zip(names, np.moveaxis(table, 1, 0), strict=True):
        right = scores.alike(own[:, :PATCHES]).astype(np.float64)
        energy = " ".join(f"{v:.2f}" for v in np.median(own[:, :PATCHES], 0))
        low, high = scores.ratio_interval(own[:, PATCHES], shift[:, PATCHES])
        ratio = own[:, PATCHES].mean() / shift[:, PATCHES].mean()
        yield (
            f"{name:9s} energy {energy}, {_ranged(100 * right, 0)} %, "
            f"{_ranged(100 * right[same], 0)} %; "
            f"patches {own[:, PATCHES].mean():.2f}, {ratio:.2f} ({low:.2f}..{high:.2f}); "
            f"hole {own[:, HOLE].mean():.2f}, {_ranged(own[:, HOLE] - smooth[:, HOLE], 2)}; "
            f"rim {own[:, RIM].mean():.2f}, {_ranged(own[:, RIM] - smooth[:, RIM], 2)}; "
            f"structure {_ranged(own[:, STRUCTURE], 3)}"
        )


def _ranged(values: NDArray[Any], digits: int) -> str:
    """Mean of values and its 95 % interval by the bootstrap; a dash where there are none."""
    if not len(values):
        return "-"
    low, high = interval(values.tolist())
    return f"{np.mean(values):.{digits}f} ({low:.{digits}f}..{high:.{digits}f})"

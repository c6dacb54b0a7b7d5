"""Sheets of objects that were removed from pictures, for people to look at.

A part of `benchmarks.background`.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np

from benchmarks.background_composites import OURS, inpainted, pasted, removed
from benchmarks.background_scores import Mask
from benchmarks.common import Pixels, kodak, read_rgb
from benchmarks.composites import reduced
from proxyimg_codec import encode
from proxyimg_codec.api import Image
from proxyimg_codec.bench.sprites import scaled, solid
from proxyimg_codec.encoder.shapes.masks import Region
from proxyimg_codec.io import raster

SHOWN = ("Telea", "shift map", "smooth", "auto")
"""Methods of a sheet, after the picture itself."""

TILE, ROWS = (480, 480), 6
"""Most columns and rows of a picture on a sheet, and pictures of a sheet."""

MOST = 1 / 3
"""Largest share of a picture that is removed by its label map."""

SCENE, STANDING = 800, 0.75
"""Longer side of a scene in pixels, and the height of who stands in it as a share of its own."""

SCENES = (
    ("demo_bg_whitehouse", "demo_eileen_happy", 0.3),
    ("thequestion_bg_meadow", "thequestion_sylvie_blue_normal", 0.6),
    ("thequestion_bg_uni", "thequestion_sylvie_green_smile", 0.25),
    ("thequestion_bg_meadow", "demo_lucy_happy", 0.1),
)
"""Backgrounds, sprites, and where these stand: their left side as a share of the width."""

Outline = list[tuple[int, int]]


def ellipse(x: int, y: int, across: int, down: int) -> Outline:
    """Outline of an ellipse by its centre and half its sides."""
    points = cv2.ellipse2Poly((x, y), (across, down), 0, 0, 360, 6)
    return [(int(px), int(py)) for px, py in points]


OUTLINES: dict[str, Outline] = {
    "kodim04": [(228, 590), (250, 560), (312, 535), (330, 535), (330, 575), (318, 640), (285, 690),
                (238, 690)],
    "kodim05": [(640, 70), (700, 65), (742, 100), (740, 150), (750, 215), (700, 238), (640, 235),
                (605, 215), (560, 190), (560, 140), (610, 120)],
    "kodim15": [(232, 0), (330, 0), (300, 60), (255, 95), (228, 70)],
    "kodim17": ellipse(360, 562, 128, 128),
    "kodim24": [(548, 50), (618, 50), (618, 160), (548, 160)],
    "astronaut": [(385, 0), (462, 0), (465, 285), (345, 285), (350, 215), (372, 120)],
    "chelsea": [(318, 0), (400, 0), (392, 60), (372, 92), (330, 50)],
    "china": [(190, 25), (215, 25), (300, 110), (315, 140), (355, 290), (385, 330), (330, 395),
              (150, 400), (80, 300), (90, 250), (85, 115), (150, 90)],
    "coffee": [(172, 60), (225, 20), (345, 18), (408, 62), (395, 150), (375, 205), (330, 235),
               (262, 245), (250, 310), (205, 318), (185, 290), (205, 225), (180, 130)],
    "flower": ellipse(308, 221, 146, 146),
    "rocket": [(306, 122), (322, 112), (340, 122), (344, 405), (304, 405)],
}  # fmt: skip
"""Outlines drawn by hand, as with a lasso, where there is no label map or most has one label: a
necklace, a rider, a ribbon, a ball, a chimney; a model, an ear, a pagoda, a cup, a flower and a
rocket."""


class Removal(NamedTuple):
    """Something to be removed.

    Attributes:
        name: Name of the picture.
        rgb: uint8 [H, W, 3].
        mask: bool [H, W].
    """

    name: str
    rgb: Pixels
    mask: Mask


def removals(data: Path) -> Iterator[Removal]:
    """Yields what is removed: 20 things of Kodak pictures, 6 of photographs and 4 of scenes."""
    labelled = {p.stem: p for p in (data / "kodak_masks").glob("*.png")}
    files = [p for p in kodak(data) if p.stem in labelled]
    for path in [*files, *sorted((data / "photo").glob("*.*"))]:
        rgb = read_rgb(path)
        if path.stem in OUTLINES:
            mask = drawn(OUTLINES[path.stem], rgb.shape)
        else:
            mask = first_thing(raster.read(labelled[path.stem]).pixels[..., 0])
        yield Removal(path.stem, rgb, mask)
    for back, sprite, left in SCENES:
        scene = reduced(read_rgb(data / "anime" / f"{back}.jpg"), SCENE)
        figure = solid(raster.read(data / "anime" / f"{sprite}.png").pixels)
        assert figure is not None, f"{sprite} is no solid object"
        height = round(STANDING * scene.shape[0])
        figure = scaled(figure, height * max(1.0, figure.shape[1] / figure.shape[0]))
        made = pasted(scene, figure, round(left * scene.shape[1]), scene.shape[0] - len(figure))
        yield Removal(sprite, made.mixed, made.mask)


def drawn(outline: Outline, shape: tuple[int, ...]) -> Mask:
    """Mask bool [H, W] of what an outline encloses."""
    mask = np.zeros(shape[:2], np.uint8)
    cv2.fillPoly(mask, [np.array(outline, np.int32)], 1)
    return mask > 0


def first_thing(labels: Pixels) -> Mask:
    """Largest label of a map [H, W] that is not the back and at most `MOST` of the picture."""
    masks = [labels == k for k in np.unique(labels) if k]
    return max((m for m in masks if m.mean() <= MOST), key=lambda m: int(m.sum()))


def row_of(rgb: Pixels, mask: Mask, images: dict[str, Image]) -> Pixels:
    """The picture and what each method makes of it beside each other, reduced to fit `TILE`.

    OpenCV gets the reduced picture, since shift maps of large ones take long.
    """
    high, wide = mask.shape
    scale = min(TILE[0] / wide, TILE[1] / high, 1)
    size = round(wide * scale), round(high * scale)

    def small(picture: Pixels) -> Pixels:
        return np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA))

    hole = small(mask.astype(np.uint8) * 255) > 0
    whole = small(next(iter(images.values())).render())
    shown = {name: small(picture) for name, picture in removed(images).items()}
    shown |= inpainted(whole, hole, [name for name in SHOWN if name not in images])
    return np.hstack([small(rgb), *(shown[name] for name in SHOWN)])


def stacked(rows: list[Pixels]) -> Pixels:
    """Rows [H, W, 3] of different widths below each other, on grey."""
    width = max(row.shape[1] for row in rows)
    beside = [[(0, 0), (0, width - row.shape[1]), (0, 0)] for row in rows]
    return np.vstack([np.pad(r, b, constant_values=128) for r, b in zip(rows, beside, strict=True)])


def run(data: Path, count: int | None, seed: int, folder: Path | None) -> Iterator[str]:
    """Yields what was written: sheets, and each picture alone with the object removed by `auto`.

    The numbers of the pictures do not tell what was removed. Nothing here depends on the seed.
    """
    if folder is None:
        yield "removals: only with --pictures DIR, for people to look at"
        return
    wanted = list(removals(data))[:count]
    for first in range(0, len(wanted), ROWS):
        rows = list[Pixels]()
        for k, (_, rgb, mask) in enumerate(wanted[first : first + ROWS], first + 1):
            masks = [Region("object", mask)]
            images = {kind: encode(rgb, masks=masks, background=kind, effort=1) for kind in OURS}
            raster.write(folder / f"removed-{k:02}.png", removed(images)[OURS[0]])
            rows.append(row_of(rgb, mask, images))
        sheet = folder / f"removals-{first // ROWS + 1}.png"
        raster.write(sheet, stacked(rows))
        names = (f"{k:02} {r.name}" for k, r in enumerate(wanted[first : first + ROWS], first + 1))
        yield f"{sheet.name}: {', '.join(names)}; each the picture, {', '.join(SHOWN)}"

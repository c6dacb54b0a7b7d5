"""Makes the guide's picture of edits.

    python -m benchmarks.edits DATA docs/images/editing.jpg

DATA holds the Kodak pictures and their label maps.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import cv2
import numpy as np

import proxyimg_codec as pxi
from benchmarks.common import read_rgb
from proxyimg_codec.api import Image
from proxyimg_codec.encoder.shapes.masks import Region
from proxyimg_codec.io import raster

SCRIPTS: tuple[list[dict[str, object]], ...] = (
    [{"op": "move", "layer": "red", "by": [-60, 20]}],
    [
        {"op": "rotate", "layer": "red", "degrees": 30},
        {"op": "scale", "layer": "blue", "by": [1.35, 1.35], "pivot": [180, 512]},
    ],
    [
        {
            "op": "drag",
            "layer": "red",
            "handles": [[470, 450, 0, 0], [620, 400, 0, 0], [500, 180, -70, 45]],
        }
    ],
    [{"op": "remove", "layer": "red"}],
    [
        {"op": "duplicate", "layer": "red", "name": "copy"},
        {"op": "hide", "layer": "copy"},
        {"op": "texture", "layer": "red", "source": "blue", "fit": "shape"},
        {"op": "texture", "layer": "blue", "source": "copy", "fit": "shape"},
    ],
    [
        {"op": "duplicate", "layer": "blue", "name": "twin"},
        {"op": "flip", "layer": "twin", "axis": "horizontal"},
        {"op": "scale", "layer": "twin", "by": [0.7, 0.7], "pivot": [230, 512]},
        {"op": "move", "layer": "twin", "by": [150, 0]},
        {"op": "recolour", "layer": "twin", "hue": 120},
    ],
)
"""Edits of each part of the picture; two parts make a row."""


def encoded(data: Path) -> Image:
    """Encodes Kodak 23 with the layers back, red and blue."""
    pixels = read_rgb(data / "kodak" / "kodim23.png")
    labels = read_rgb(data / "kodak_masks" / "kodim23.png")[..., 0]
    values = [v for v in np.unique(labels) if v]
    masks = [Region(n, labels == v) for n, v in zip(("red", "blue"), values, strict=True)]
    return pxi.encode(pixels, masks=masks, quality=60, texture="implicit")


def main() -> None:
    """Runs the command line."""
    p = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    p.add_argument("data", type=Path)
    p.add_argument("output", type=Path)
    args = p.parse_args()
    image = encoded(args.data)
    shots = []
    for script in SCRIPTS:
        pixels = image.edited(*script).render()
        half = cv2.resize(pixels, None, fx=2 / 3, fy=2 / 3, interpolation=cv2.INTER_AREA)
        shots.append(half)
    rows = [np.concatenate(shots[i : i + 2], axis=1) for i in range(0, len(shots), 2)]
    raster.write(args.output, np.concatenate(rows), {})


if __name__ == "__main__":
    main()

"""Makes the picture of the README from the demo photo and the masks of its two birds.

python -m benchmarks.overview MASKS OUT
"""

from __future__ import annotations

import sys
from pathlib import Path

import cv2
import numpy as np

from benchmarks.common import Pixels, read_rgb
from proxyimg_codec import encode
from proxyimg_codec.encoder.shapes.mask_files import load_masks
from proxyimg_codec.io import raster

PHOTO = Path(__file__).parents[1] / "docs" / "images" / "photo.png"
DETAIL = (380, 90, 180, 120)
SIZE = (480, 320)
GAP = 8


def on_white(pixels: Pixels) -> Pixels:
    """Composites a picture, uint8 [H, W, 4] with straight alpha, over white: uint8 [H, W, 3]."""
    alpha = pixels[..., 3:] / 255.0
    return np.rint(pixels[..., :3] * alpha + 255 * (1 - alpha)).astype(np.uint8)


def main() -> None:
    """Runs the command line."""
    masks, out = sys.argv[1:]
    photo = read_rgb(PHOTO)
    height, width = photo.shape[:2]
    image = encode(photo, quality=60, masks=load_masks(masks, width, height))
    empty = image
    for name in [layer.name for layer in image.layers][1:]:
        empty = empty.layers[name].removed()
    x, y, w, h = DETAIL
    bicubic = cv2.resize(photo[y : y + h, x : x + w], SIZE, interpolation=cv2.INTER_CUBIC)
    parts = [
        photo,
        image.render(),
        on_white(image.render(layers=[1])),
        empty.render(),
        image.render(region=DETAIL, width=SIZE[0], height=SIZE[1]),
        bicubic,
    ]
    small = [
        p if p.shape[1::-1] == SIZE else cv2.resize(p, SIZE, interpolation=cv2.INTER_AREA)
        for p in parts
    ]
    framed = [
        cv2.copyMakeBorder(p, 0, GAP, 0, GAP, cv2.BORDER_CONSTANT, value=(255, 255, 255))
        for p in small
    ]
    raster.write(out, np.vstack([np.hstack(framed[:3]), np.hstack(framed[3:])]))
    print(f"{out}: from a file of {len(image.to_bytes())} bytes")


if __name__ == "__main__":
    main()

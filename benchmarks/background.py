"""How well the part of a background that an object hides is completed.

    python -m benchmarks.background DATA [--count N]

A clipart with true alpha is pasted on a photograph, the composite encoded with the true mask, the
back layer rendered alone and compared with the photograph: over the hole, and in the band of 6 px
inside its rim. Beside it OpenCV's inpainting of the decoded composite.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.common import Pixels, header, kodak, read_rgb
from proxyimg_codec import pictures
from proxyimg_codec.encoder.encode import encode
from proxyimg_codec.encoder.masks import Region

WIDTH, HEIGHT = 384, 256


def composite(photo: Pixels, sprite: Pixels) -> tuple[Pixels, Pixels, NDArray[np.bool_]]:
    """The photograph, the composite and the true mask, all WIDTH x HEIGHT."""
    y, x = (photo.shape[0] - HEIGHT) // 2, (photo.shape[1] - WIDTH) // 2
    photo = np.ascontiguousarray(photo[y : y + HEIGHT, x : x + WIDTH])
    scale = 0.5 * HEIGHT / max(sprite.shape[:2])
    small = cv2.resize(sprite, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    h, w = small.shape[:2]
    y, x = (HEIGHT - h) // 2, (WIDTH - w) // 2
    alpha = small[..., 3:].astype(np.float64) / 255
    mixed = photo.astype(np.float64)
    part = mixed[y : y + h, x : x + w]
    mixed[y : y + h, x : x + w] = alpha * small[..., :3] + (1 - alpha) * part
    mask = np.zeros((HEIGHT, WIDTH), bool)
    mask[y : y + h, x : x + w] = alpha[..., 0] >= 0.5
    return photo, np.rint(mixed).astype(np.uint8), mask


def score(photo: Pixels, filled: Pixels, where: NDArray[np.bool_]) -> float:
    """PSNR over the chosen pixels."""
    error = (photo[where].astype(np.float64) - filled[where]) ** 2
    return float(10 * np.log10(255**2 / max(float(error.mean()), 1e-6)))


def main() -> None:
    """Entry point."""
    p = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    p.add_argument("data", type=Path, help="folder with kodak and clipart")
    p.add_argument("--count", type=int, default=20)
    args = p.parse_args()
    print(header(args.data))
    sprites = [pictures.read(f).pixels for f in sorted((args.data / "clipart").glob("*.png"))]
    sprites = [s for s in sprites if s.shape[2] == 4 and (s[..., 3] > 127).mean() > 0.2]
    rows: dict[str, list[tuple[float, float, int]]] = {}
    for photo_path, sprite in zip(kodak(args.data)[: args.count], sprites, strict=False):
        photo, mixed, mask = composite(read_rgb(photo_path), sprite)
        distance = cv2.distanceTransform(mask.astype(np.uint8), cv2.DIST_L2, 5)
        band = mask & (distance <= 6)
        for name in ("diffuse", "complete"):
            image = encode(mixed, masks=[Region("object", mask)], background=name, effort=4)
            back = image.render(layers=["back"])
            size = len(image.to_bytes())
            rows.setdefault(name, []).append(
                (score(photo, back, mask), score(photo, back, band), size)
            )
        whole = image.render()
        wide = cv2.dilate(mask.astype(np.uint8), np.ones((3, 3), np.uint8))
        for name, method in (("Telea", cv2.INPAINT_TELEA), ("NS", cv2.INPAINT_NS)):
            filled = cv2.inpaint(whole, wide, 3, method)
            rows.setdefault(name, []).append(
                (score(photo, filled, mask), score(photo, filled, band), 0)
            )
    for name, values in rows.items():
        hole, band_, size_ = np.mean(values, axis=0)
        print(
            f"{name:9s} hole {hole:.2f} dB, band {band_:.2f} dB, {size_:.0f} bytes, n={len(values)}"
        )


if __name__ == "__main__":
    main()

"""Random crops for training, of the pictures in a folder and of drawn shapes."""

from __future__ import annotations

import hashlib
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from proxyimg_codec.errors import InputError

Pixels = NDArray[np.uint8]

SIZE = 256
"""Side of a crop in pixels."""

DRAWN = 0.06
"""Share of drawn shapes among crops; photographs rarely have flat colours and sharp edges."""


TEST_PICTURES = Path(__file__).with_name("test_pictures.txt")
"""File with the digests of the test pictures, one per line; these must never enter training."""


def digest(picture: Pixels) -> str:
    """SHA-256 of the size and the samples of a picture, uint8 [H, W, 3], in hexadecimal."""
    head = f"{picture.shape[1]}x{picture.shape[0]} ".encode()
    return hashlib.sha256(head + np.ascontiguousarray(picture).tobytes()).hexdigest()


def read(path: Path) -> Pixels | None:
    """Reads a picture file as RGB, uint8 [H, W, 3]; returns None if it cannot be read."""
    picture = cv2.imread(str(path), cv2.IMREAD_COLOR)
    if picture is None:
        return None
    return np.asarray(cv2.cvtColor(picture, cv2.COLOR_BGR2RGB), np.uint8)


def load(folder: Path) -> list[Pixels]:
    """Reads all pictures of a folder that have at least `SIZE` pixels a side.

    Args:
        folder: The folder; other files in it are skipped.

    Returns:
        Pictures as RGB, uint8 [H, W, 3], in the order of their names.

    Raises:
        InputError: A test picture is among them, or there is no picture.
    """
    refused = set(TEST_PICTURES.read_text().split())
    found = []
    for path in sorted(folder.iterdir()):
        picture = read(path)
        if picture is None or min(picture.shape[:2]) < SIZE:
            continue
        if digest(picture) in refused:
            raise InputError(f"{path}: this is a test picture; take it out of the folder")
        found.append(picture)
    if not found:
        raise InputError(f"{folder}: no picture of at least {SIZE} pixels a side")
    return found


def crop(pictures: list[Pixels], rng: np.random.Generator) -> Pixels:
    """Makes a random crop, with the flaws that cameras, scanners and websites leave.

    Args:
        pictures: Pictures as RGB, uint8 [H, W, 3], of at least `SIZE` pixels a side.
        rng: Generator of all random choices.

    Returns:
        uint8 [SIZE, SIZE, 3].
    """
    if rng.random() < DRAWN:
        return drawn(rng)
    picture = pictures[rng.integers(len(pictures))]
    height, width = picture.shape[:2]
    kind = rng.random()
    scale = 1.0
    if kind < 0.3:
        scale = rng.uniform(0.5, 1.0)
    elif kind < 0.65:
        scale = rng.uniform(1.0, 1.5)  # pictures of the folder were reduced; others are softer
    side = min(round(SIZE / scale), height, width)
    y, x = rng.integers(height - side + 1), rng.integers(width - side + 1)
    part = picture[y : y + side, x : x + side]
    if side != SIZE:
        way = cv2.INTER_AREA if side > SIZE and rng.random() < 0.5 else cv2.INTER_CUBIC
        part = np.asarray(cv2.resize(part, (SIZE, SIZE), interpolation=way), np.uint8)
    if rng.random() < 0.6:
        part = half_chroma(part)
    if rng.random() < 0.2:
        part = grainy(part, rng)
    if rng.random() < 0.5:
        part = part[:, ::-1]
    if rng.random() < 0.3:
        part = part[::-1]
    if rng.random() < 0.3:
        part = part.transpose(1, 0, 2)
    return np.ascontiguousarray(part)


def half_chroma(picture: Pixels) -> Pixels:
    """Halves the resolution of chroma, as most cameras and JPEG do; uint8 [SIZE, SIZE, 3]."""
    planes = cv2.cvtColor(picture, cv2.COLOR_RGB2YCrCb)
    small = cv2.resize(planes[..., 1:], (SIZE // 2, SIZE // 2), interpolation=cv2.INTER_AREA)
    planes[..., 1:] = cv2.resize(small, (SIZE, SIZE), interpolation=cv2.INTER_LINEAR)
    return np.asarray(cv2.cvtColor(planes, cv2.COLOR_YCrCb2RGB), np.uint8)


def grainy(picture: Pixels, rng: np.random.Generator) -> Pixels:
    """Adds grain to the luma of a picture, uint8 [SIZE, SIZE, 3]."""
    grain = rng.normal(0, rng.uniform(1, 5), (SIZE, SIZE, 1)).astype(np.float32)
    soft = np.asarray(cv2.GaussianBlur(grain, (0, 0), rng.uniform(0.3, 0.8)))[..., None]
    return np.asarray(np.clip(np.rint(picture + soft), 0, 255), np.uint8)


def drawn(rng: np.random.Generator) -> Pixels:
    """Draws random shapes and letters over a gradient, uint8 [SIZE, SIZE, 3]."""
    shift = 4
    top, bottom = rng.integers(0, 256, (2, 3))
    ramp = np.linspace(0, 1, SIZE)[:, None, None] * np.ones((1, SIZE, 1))
    canvas = (top + (bottom - top) * ramp).astype(np.uint8)
    if rng.random() < 0.5:
        canvas = canvas.transpose(1, 0, 2)
    canvas = np.ascontiguousarray(canvas)
    for _ in range(rng.integers(2, 12)):
        colour = [int(v) for v in rng.integers(0, 256, 3)]
        centre = rng.integers(0, SIZE, 2)
        kind = rng.integers(4)
        if kind == 0:
            radius = int(rng.integers(4, 90)) << shift
            at = [int(v) << shift for v in centre]
            cv2.circle(canvas, at, radius, colour, -1, cv2.LINE_AA, shift)
        elif kind == 1:
            points = (centre + rng.normal(0, 50, (int(rng.integers(3, 7)), 2))) * (1 << shift)
            cv2.fillPoly(canvas, [points.astype(np.int32)], colour, cv2.LINE_AA, shift)
        elif kind == 2:
            other = rng.integers(0, SIZE, 2)
            thick = int(rng.integers(1, 8))
            cv2.line(canvas, centre.tolist(), other.tolist(), colour, thick, cv2.LINE_AA)
        else:
            text = "".join(chr(rng.integers(33, 127)) for _ in range(rng.integers(1, 8)))
            face, size = int(rng.integers(0, 8)), float(rng.uniform(0.4, 3))
            corner = (int(centre[0]) - 60, int(centre[1]))
            cv2.putText(canvas, text, corner, face, size, colour, int(size) + 1, cv2.LINE_AA)
    return canvas

"""Cost of layers: one .pxi file of a layered picture against its layers as AVIF files with alpha.

    python -m benchmarks.layered DATA [-e EFFORT] [--only NAME,NAME] [--parts]

DATA is a folder with anime/, clipart/ and photo/. Each picture is a background with two sprites in
front, reduced to at most 640 pixels; every layer keeps all its own pixels. AVIF files are libaom at
speed 4 with ``tune=psnr``, one for each layer, cropped to what is not clear; clear pixels continue
the colours of others, which takes fewer bytes than black ones. Quality is the mean over the layers
of the PSNR over black and over white, so that colours count by their alpha. ``--parts`` tells the
bytes of the parts of each file.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from PIL import Image as Pillow

import proxyimg_codec as pxi
from benchmarks.common import Pixels, header, read_rgb
from benchmarks.composites import reduced
from proxyimg_codec.bench.measure import bd_rate, psnr
from proxyimg_codec.bench.peers import avif
from proxyimg_codec.container import chunks
from proxyimg_codec.encoder.import_layers import encode_layers
from proxyimg_codec.encoder.layered.source import LayeredPicture, SourceLayer
from proxyimg_codec.encoder.pyramid.picture import colour_of
from proxyimg_codec.encoder.settings import Settings
from proxyimg_codec.io.samples import to_float

SIDE = 640
"""Longer side of the pictures in pixels."""

PICTURES = {
    "house": ("anime/demo_bg_whitehouse.jpg", "anime/demo_eileen_happy.png",
              "anime/demo_lucy_happy.png"),
    "meadow": ("anime/thequestion_bg_meadow.jpg", "anime/thequestion_sylvie_blue_normal.png",
               "anime/thequestion_sylvie_green_smile.png"),
    "uni": ("anime/thequestion_bg_uni.jpg", "anime/thequestion_sylvie_green_smile.png",
            "anime/demo_eileen_happy.png"),
    "china": ("photo/china.jpg", "clipart/plush_tux_anita_01.png",
              "clipart/earth_and_north_star_dan_01.png"),
    "coffee": ("photo/coffee.png", "clipart/stack_of_books_taller_ga_.png",
               "clipart/tramezzino.png"),
    "flower": ("photo/flower.jpg", "clipart/black_lab_ganson.png",
               "clipart/turtle_jurgen_gaeremyn_01.png"),
}  # fmt: skip
"""Files of the layers of each picture, back to front."""

HEIGHTS = (0.85, 0.6)
"""Heights of the sprites as shares of that of the canvas, as far as they are not too wide."""

QUALITIES = (20.0, 36.0, 52.0, 68.0)
AVIF_QUALITIES = (15, 30, 45, 60, 72)


class Curves(NamedTuple):
    """Points (bits a pixel of the canvas, PSNR in dB) of a picture.

    Attributes:
        pxi: Points of .pxi files.
        avif: Points of AVIF files, by subsampling.
    """

    pxi: list[tuple[float, float]]
    avif: dict[str, list[tuple[float, float]]]


def layered(data: Path, files: tuple[str, ...]) -> LayeredPicture:
    """Makes a layered picture of a background and sprites, of which the last two overlap."""
    back = reduced(read_rgb(data / files[0]), SIDE)
    height, width = back.shape[:2]
    layers = [SourceLayer(Path(files[0]).stem, back, 0, 0)]
    for k, name in enumerate(files[1:]):
        with Pillow.open(data / name) as picture:
            sprite = picture.convert("RGBA")
        sprite = sprite.crop(sprite.getchannel("A").getbbox()).convert("RGBa")
        scale = min(HEIGHTS[k] * height / sprite.height, width / 2 / sprite.width)
        size = (round(sprite.width * scale), round(sprite.height * scale))
        pixels = np.asarray(sprite.resize(size, Pillow.Resampling.LANCZOS).convert("RGBA"))
        x = width // 4 + k * width // 5
        layers.append(SourceLayer(Path(name).stem, pixels[:, : width - x], x, height - size[1]))
    return LayeredPicture(width, height, tuple(layers))


def continued(pixels: Pixels) -> Pixels:
    """Continues the colours of a layer, uint8 [h, w, C], where it is clear."""
    if pixels.shape[2] == 3:
        return pixels
    colours = colour_of(to_float(pixels)[0]).samples
    return np.dstack([np.clip(np.rint(colours), 0, 255).astype(np.uint8), pixels[..., 3]])


def measure(picture: LayeredPicture, settings: Settings, parts: bool) -> Curves:
    """Encodes a picture in both ways at all qualities."""
    area = picture.width * picture.height
    own = list[tuple[float, float]]()
    for quality in QUALITIES:
        encoded, _ = encode_layers(picture, replace(settings, quality=quality))
        data = encoded.to_bytes()
        image = pxi.from_bytes(data)
        found = [psnr(v.pixels, alone(image, v)) for v in picture.layers]
        own.append((8 * len(data) / area, float(np.mean(found))))
        print(f"    pxi {quality:g}: {len(data)} bytes, " + " ".join(f"{f:.2f}" for f in found))
        if parts:
            print("      " + " ".join(sizes(data)))
    theirs = dict[str, list[tuple[float, float]]]()
    for subsampling in ("4:2:0", "4:4:4"):
        codec = avif("avif", "AVIF", 4, subsampling)
        points = theirs.setdefault(subsampling, [])
        for aim in AVIF_QUALITIES:
            files = [codec.encode(continued(v.pixels), aim) for v in picture.layers]
            pairs = zip(files, picture.layers, strict=True)
            found = [psnr(v.pixels, codec.decode(file)) for file, v in pairs]
            total = sum(map(len, files))
            points.append((8 * total / area, float(np.mean(found))))
            each = " ".join(str(len(file)) for file in files)
            print(f"    avif {subsampling} {aim}: {total} bytes ({each}), "
                  + " ".join(f"{f:.2f}" for f in found))  # fmt: skip
    return Curves(own, theirs)


def alone(image: pxi.Image, layer: SourceLayer) -> Pixels:
    """A layer drawn alone, on the rectangle of its source, with as many channels."""
    height, width, channels = layer.pixels.shape
    drawn = image.render(layers=[layer.name])
    part = drawn[layer.y : layer.y + height, layer.x : layer.x + width]
    if channels == 4 and part.shape[2] == 3:
        part = np.dstack([part, np.full(part.shape[:2], 255, np.uint8)])
    return np.asarray(part[..., :channels])


def sizes(data: bytes) -> list[str]:
    """Type and bytes of each chunk of a file."""
    return [f"{c.type}:{len(c.payload)}" for c in chunks.read(data)]


def main() -> None:
    """Runs the command line."""
    p = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    p.add_argument("data", type=Path, help="folder with anime, clipart and photo")
    p.add_argument("-e", "--effort", type=int, default=5, help="effort of our own codec")
    p.add_argument("--only", default=",".join(PICTURES), help="names of pictures")
    p.add_argument("--parts", action="store_true", help="tell the bytes of chunks")
    args = p.parse_args()
    print(header(args.data))
    rates: dict[str, list[float]] = {}
    for name in args.only.split(","):
        picture = layered(args.data, PICTURES[name])
        print(f"  {name}: {picture.width}x{picture.height}, {len(picture.layers)} layers")
        start = time.process_time()
        curves = measure(picture, Settings(effort=args.effort, jobs=1), args.parts)
        for subsampling, points in curves.avif.items():
            rates.setdefault(subsampling, []).append(bd_rate(curves.pxi, points))
        told = ", ".join(f"AVIF {k} {v[-1]:+.1f} %" for k, v in rates.items())
        spent = time.process_time() - start
        print(f"  {name}: BD-rate against {told}; {spent:.0f} CPU-s", flush=True)
    for subsampling, found in rates.items():
        print(f"mean of {len(found)} against AVIF {subsampling}: {np.mean(found):+.1f} %")


if __name__ == "__main__":
    main()

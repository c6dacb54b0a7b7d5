"""Codecs that worker processes can import, and a folder of pictures."""

import time
import zlib

import numpy as np

from proxyimg_codec.bench.peers import Codec
from proxyimg_codec.errors import UnsupportedError
from proxyimg_codec.io import raster


def encode(pixels, quality):
    """Colour in steps of 2^(8 - quality), deflated."""
    step = 2 ** (8 - int(quality))
    height, width, channels = pixels.shape
    head = bytes([height, width, channels, step // 2])
    return head + zlib.compress((pixels // step).tobytes())


def decode(data):
    shape, step = tuple(data[:3]), 2 * data[3]
    coarse = np.frombuffer(zlib.decompress(data[4:]), np.uint8).reshape(shape)
    return (coarse * step + step // 2).astype(np.uint8)


def encode_with_masks(pixels, quality, masks=None):
    return encode(pixels, quality) + bytes(len(masks or ()))


def decode_with_masks(data):
    return decode(data)


def encode_slowly(pixels, quality):
    time.sleep(60 if pixels.shape[0] > 32 else 0)
    return encode(pixels, quality)


def encode_badly(pixels, quality):
    if quality == 4:
        raise UnsupportedError("no quality of 4\nhere")
    return encode(pixels, quality)


def decode_halved(data):
    return decode(data)[::2]


def version():
    return "fake 1"


def fake(name, **changes):
    fields = {"label": name, "settings": "none", "qualities": (2, 4, 5, 6), "limits": (1, 7),
              "encode": encode, "decode": decode, "version": version, "whole": True}  # fmt: skip
    return Codec(name, **{**fields, **changes})


def picture(seed, width=48, height=40, channels=3):
    """uint8, smooth with some noise."""
    generator = np.random.default_rng(seed)
    y, x = np.mgrid[0:height, 0:width]
    waves = [120 + 60 * np.sin((x + (seed + c) * y) / 9) for c in range(channels)]
    return np.clip(np.stack(waves, 2) + generator.normal(0, 6, (height, width, channels)), 0, 255
                   ).astype(np.uint8)  # fmt: skip


def folder_of(path, **named):
    path.mkdir()
    for name, pixels in named.items():
        raster.write(path / f"{name}.png", pixels)
    return path

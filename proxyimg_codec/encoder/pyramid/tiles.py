"""Tiles of the planes of a picture, by which regions decode their part alone."""

from __future__ import annotations

from dataclasses import replace

from ...model import Layers, Picture
from ...texture.context import SHIFT_ORIGIN
from ...texture.planes import TILES, Planes, encoded
from ...texture.pyramid import PyramidTexture
from ..settings import Settings


def with_tiles(picture: Picture, settings: Settings) -> Picture:
    """Codes the planes of a picture again, with tiles or without, if `settings.tiles` asks for it.

    Args:
        picture: Picture of which large rasters have tiles that cost little.
        settings: Settings of the encoder.

    Returns:
        The picture with the same pixels; `picture` itself for tiles ``auto``.
    """
    if settings.tiles == "auto":
        return picture
    side = TILES[0] if settings.tiles == "always" else 0
    new = {planes: _coded(planes, side) for planes in picture.planes}
    layers = [
        replace(v, texture=v.texture.renewed(new)) if isinstance(v.texture, PyramidTexture) else v
        for v in picture.layers
    ]
    return replace(picture, layers=Layers(layers), planes=tuple(new.values()))


def _coded(planes: Planes, tile: int) -> Planes:
    """Planes of the same latents with tiles of a side."""
    p = planes.packed
    if p["tile"] == tile:
        return planes
    shifts = tuple(v - SHIFT_ORIGIN for v in p["shifts"])
    return encoded(
        planes.latents, planes.size, p["step"], planes.support, p["cell"], planes.components,
        p["model"], shifts, tile,
    )  # fmt: skip

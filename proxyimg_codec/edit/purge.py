"""Pixels that no layer shows any more: whether a picture has any, and how they leave it for good.

A layer that was removed, or got another texture, leaves its pixels in planes that other layers show
parts of [PYR-45], and in the history. What counts as shown is what some layer can show in any pose:
moving, hiding or fading it takes nothing away. Samples that hidden ones are filled from are among
those.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..errors import PxiError, UsageError
from ..limits import enough_memory
from ..model import Layers, Picture
from ..texture.implicit import ImplicitTexture
from ..texture.planes import Planes
from ..texture.pyramid import PyramidTexture, Texture

PREVIEWS: dict[str, tuple[re.Pattern[bytes], Callable[[re.Match[bytes]], bytes]]] = {
    "exif": (re.compile(rb"\xff\xd8\xff.*?(?:\xff\xd9|\Z)", re.DOTALL), lambda m: bytes(len(m[0]))),
    "xmp": (re.compile(rb'(<xmpGImg:image>|xmpGImg:image=")[^<"]*'), lambda m: m[1]),
}
"""Small pictures in metadata, which show what was there: JPEG streams, of which zeros are left as
offsets count on their length, and base64."""

EFFORT = 2
"""Default of how hard the encoder tries with what lies beside the pixels that go."""


@enough_memory("to purge the picture")
def purged(picture: Picture, effort: int = EFFORT) -> Picture:
    """Takes what no layer shows out of the planes of a picture, and forgets its history.

    In its place, planes continue smoothly what lies around. Latents that lie over it are encoded
    anew, at the same step. Beside it, samples change by about what quantization makes of them;
    the change fades with the distance. Planes of which everything shows stay as they are.
    Previews in EXIF and XMP go as well.

    Args:
        picture: The picture.
        effort: How hard the encoder tries, 1..9.

    Raises:
        UsageError: The effort is out of range.
        PxiError: The encoder, which this needs, is not installed.
        FormatError: The planes are corrupt.
        LimitError: There is not enough memory.
    """
    if not 1 <= effort <= 9:
        raise UsageError(f"effort is {effort}, but must be 1..9")
    new = {p: _erased(p, shown, effort) for p, shown in _shown(picture).items() if not shown.all()}
    textures = {v.texture: _with_planes(v.texture, new) for v in picture.layers}
    layers = [
        v if textures[v.texture] is v.texture else replace(v, texture=textures[v.texture])
        for v in picture.layers
    ]
    return replace(picture, layers=Layers(layers), history=(), blocks=_without_previews(picture))


def _without_previews(picture: Picture) -> dict[str, bytes]:
    """Metadata blocks of a picture without the small pictures in them."""
    blocks = dict(picture.blocks)
    for name in PREVIEWS.keys() & blocks:
        pattern, rest = PREVIEWS[name]
        blocks[name] = pattern.sub(rest, blocks[name])
    return blocks


def hidden_samples(picture: Picture) -> int:
    """Number of stored samples of planes that no layer can show.

    Raises:
        FormatError: A mask or support is corrupt.
    """
    return sum(int((p.stored & ~shown).sum()) for p, shown in _shown(picture).items())


def leaves_pixels(before: Picture, after: Picture) -> bool:
    """Whether edits left pixels in a picture that its layers showed before, and no longer show."""
    if len(after.history) > len(before.history) and _coded(before) - _coded(after):
        return True
    return hidden_samples(after) > hidden_samples(before)


def _coded(picture: Picture) -> set[bytes]:
    """Streams of all planes of a picture, and codes of all its implicit textures."""
    codes = (v.texture.codes for v in picture.layers if isinstance(v.texture, ImplicitTexture))
    return {p.packed["data"] for p in picture.planes} | {c.tobytes() for c in codes}


def _shown(picture: Picture) -> dict[Planes, NDArray[np.bool_]]:
    """For all planes that views show, bool [rows, columns], True for samples that any can show."""
    found: dict[Planes, NDArray[np.bool_]] = {}
    for view in dict.fromkeys(v.texture for v in picture.layers):
        if not isinstance(view, PyramidTexture):
            continue
        x, y, width, height = view.part
        for planes in view.sources:
            shown = found.setdefault(planes, np.zeros(planes.size[::-1], bool))
            if planes in (view.behind, view.behind_alpha, view.matte):
                shown[:] = True  # whatever moves, they are seen
                continue
            shown[y : y + height, x : x + width] |= True if view.shown is None else view.shown
    return found


def _erased(planes: Planes, shown: NDArray[np.bool_], effort: int) -> Planes:
    """Planes without the samples that do not show; `shown` is bool [rows, columns]."""
    try:
        from ..encoder.pyramid.encode import EFFORTS
        from ..encoder.pyramid.erase import erased
    except ModuleNotFoundError as error:
        raise PxiError(
            f"purging needs {error.name}: pip install 'proxyimg-codec[encode]'"
        ) from None
    return erased(planes, shown, EFFORTS[effort - 1], seed=0)


def _with_planes(texture: Texture, new: dict[Planes, Planes]) -> Texture:
    """Texture with other planes; itself if it has none of those that are replaced."""
    if not isinstance(texture, PyramidTexture) or not any(p in new for p in texture.sources):
        return texture
    made = texture.renewed({p: new.get(p, p) for p in texture.sources})
    made.__dict__["coded_mask"] = texture.coded_mask  # another encoder may have coded it
    return made

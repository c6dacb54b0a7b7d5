"""Pictures of emoji with the groups that Unicode gives them, and samples for training."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from itertools import product
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont
from torch import Tensor
from torch.nn import functional as F

from .emoji_groups import CLASSES, RANGES, group_of

SIDE = 64
"""Rows and columns of the pictures that are kept."""

FONT_SIZE = 109
"""The size of the bitmaps in fonts of emoji in colour."""

LETTERS = range(0x1F1E6, 0x1F200)
"""Code points of the letters of which two make a flag."""


class Emoji(NamedTuple):
    """Pictures of emoji.

    Attributes:
        pictures: float32 [N, 4, `SIDE`, `SIDE`], premultiplied colour and alpha in 0..1.
        labels: int64 [N] numbers of their groups in `CLASSES`.
    """

    pictures: Tensor
    labels: Tensor

    def part(self, rest: int, of: int = 2) -> Emoji:
        """Every picture whose number has the remainder `rest` when divided by `of`."""
        return Emoji(self.pictures[rest::of], self.labels[rest::of])


def read(sources: Sequence[Path]) -> Emoji:
    """Reads emoji from folders of pictures, named by code points, and from fonts.

    The name of a picture ends in its code points in base 16, joined by dashes, after an underscore.

    Raises:
        ValueError: There are no emoji.
    """
    found = [pair for source in sources for pair in _pictures(source)]
    if not found:
        raise ValueError(f"no emoji in {', '.join(map(str, sources))}")
    labels = [CLASSES.index(group) for _, group in found]
    pictures = np.stack([_squared(picture) for picture, _ in found])
    return Emoji(torch.from_numpy(pictures), torch.tensor(labels))


def _pictures(source: Path) -> Iterator[tuple[Image.Image, str]]:
    """Pictures of a folder or font, each with its group."""
    if source.is_file():
        yield from _of_font(source)
        return
    for path in sorted(source.iterdir()):
        code = re.search(r"_([0-9a-f]+)(-[0-9a-f]+)*$", path.stem)
        group = group_of(int(code[1], 16)) if code else None
        if group is not None:
            with Image.open(path) as picture:
                yield picture.convert("RGBA"), group


def _of_font(path: Path) -> Iterator[tuple[Image.Image, str]]:
    """Emoji of one code point that a font has, and flags of countries."""
    engines = ImageFont.Layout.BASIC, ImageFont.Layout.RAQM  # flags are ligatures
    single, joined = (ImageFont.truetype(str(path), FONT_SIZE, layout_engine=e) for e in engines)
    ranges = ((name, part.partition("-")) for name, text in RANGES.items() for part in text.split())
    points = (
        (single, chr(point), name)
        for name, (first, _, last) in ranges
        for point in range(int(first, 16), int(last or first, 16) + 1)
        if point > 0xFF and point not in LETTERS
    )
    flags = ((joined, chr(a) + chr(b), "flags") for a, b in product(LETTERS, LETTERS))
    nothing = _drawn(single, "\U0010fffd")
    known = {b"" if nothing is None else nothing.tobytes()}
    for font, text, name in (*points, *flags):
        picture = _drawn(font, text)
        if picture is None or picture.width > 1.5 * picture.height:
            continue  # two letters, as there is no such flag
        if (pixels := picture.tobytes()) not in known:
            known.add(pixels)
            yield picture, name


def _drawn(font: ImageFont.FreeTypeFont, text: str) -> Image.Image | None:
    """Picture of a text; None if there is nothing to see."""
    _, _, right, bottom = font.getbbox(text)
    picture = Image.new("RGBA", (int(right) or 1, int(bottom) or 1))
    ImageDraw.Draw(picture).text((0, 0), text, font=font, embedded_color=True)
    return picture if picture.getbbox() else None


def _squared(picture: Image.Image) -> NDArray[np.float32]:
    """Picture cut to what shows, in the middle of a square [4, `SIDE`, `SIDE`], premultiplied."""
    shown = picture.crop(picture.getbbox())
    side = max(shown.size)
    square = Image.new("RGBA", (side, side))
    square.paste(shown, ((side - shown.width) // 2, (side - shown.height) // 2))
    small = square.convert("RGBa").resize((SIDE, SIDE), Image.Resampling.BOX)
    return np.asarray(small, np.float32).transpose(2, 0, 1) / np.float32(255)


def samples(emoji: Emoji, count: int, side: int, random: torch.Generator) -> tuple[Tensor, Tensor]:
    """Random samples: an emoji before something smooth, near or far, seen whole or in part.

    Groups are drawn evenly, however many emoji they have.

    Args:
        emoji: The emoji.
        count: Number of samples B.
        side: Their rows and columns.
        random: Generator of all random numbers.

    Returns:
        float32 [B, 3, side, side] in 0..1, and int64 [B] groups.
    """

    def uniform(low: float, high: float, *shape: int) -> Tensor:
        return low + (high - low) * torch.rand(count, *shape, generator=random)

    groups = torch.unique(emoji.labels)
    wanted = groups[torch.randint(len(groups), (count,), generator=random)]
    chosen = [
        (own := torch.nonzero(emoji.labels == g)[:, 0])[
            torch.randint(len(own), (1,), generator=random)
        ]
        for g in wanted
    ]
    pictures = emoji.pictures[torch.cat(chosen)]
    # The share of the emoji that is seen: below 1 a detail, above 1 all and what lies around.
    share, turn = torch.exp(uniform(-1.2, 0.25)), uniform(-0.4, 0.4)
    mirrored = (torch.rand(count, generator=random) < 0.5) * -2 + 1
    cos, sin = share * turn.cos(), share * turn.sin()
    free = (1 - share).abs()[:, None]
    shift = uniform(-1, 1, 2) * free
    rows = [torch.stack([cos * mirrored, -sin, shift[:, 0]], 1),
            torch.stack([sin * mirrored, cos, shift[:, 1]], 1)]  # fmt: skip
    grid = F.affine_grid(torch.stack(rows, 1), [count, 4, side, side], align_corners=False)
    seen = F.grid_sample(pictures, grid, align_corners=False)
    coarse = uniform(0, 1, 3, 3, 3) * uniform(0, 1, 1, 1, 1) + uniform(0, 1, 3, 1, 1) * 0.6 - 0.2
    behind = F.interpolate(coarse.clamp(0, 1), (side, side), mode="bicubic").clamp(0, 1)
    return seen[:, :3] + (1 - seen[:, 3:]) * behind, wanted

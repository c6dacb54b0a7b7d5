"""Sheets: all layers of a picture at a glance, in one picture."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import UnsupportedError
from ..geometry.boundary import Boundary, encode
from ..limits import DEFAULT_LIMITS, Limits
from ..model import Pictured
from ..render.cache import Cache
from ..render.pixels import render

Pixels = NDArray[np.uint8]

TILE = 360
"""Longer side of the picture in a tile, in pixels."""

LEAST = 180
"""Least width of a tile, so that there is room for words; narrower pictures hold no names."""

GAP, LINE, TEXT = 12, 18, 13
"""Pixels between tiles, between lines of text, and of the size of letters."""

CHECK, LIGHT, DARK = 8, 255, 214
"""Side of the squares of the checkerboard in pixels, and its two greys."""

PAPER, INK = (255, 255, 255), (20, 20, 20)

FONTS = (
    "DejaVuSans.ttf", "NotoSans-Regular.ttf", "NotoSansCJK-Regular.ttc", "wqy-zenhei.ttc",
    "unifont.ttf", "Arial Unicode.ttf", "arialuni.ttf", "msgothic.ttc", "arial.ttf",
)  # fmt: skip
"""Fonts that are tried for letters which Pillow's own does not have."""


@dataclass(frozen=True, eq=False)
class Tile:
    """Layer as a sheet shows it.

    Attributes:
        name: Name of the layer.
        pixels: uint8 [H, W, 4], the layer alone with straight alpha.
        outline: Bytes that its outline takes in a file; 0 for the whole canvas.
        hidden: Whether the layer is not drawn in the picture.
    """

    name: str
    pixels: Pixels
    outline: int
    hidden: bool = False


def reduction(height: int, width: int) -> float:
    """Factor by which a picture is reduced to fit into a tile, at most 1."""
    return min(1.0, TILE / max(height, width))


def outline_bytes(boundary: Boundary | None) -> int:
    """Bytes of a coded boundary."""
    fields = encode(boundary)
    return len(fields["classes"]) + len(fields["deltas"])


def sheet_of(image: Pictured, engine: str = "auto", limits: Limits = DEFAULT_LIMITS) -> Pixels:
    """Sheet of a `.pxi` picture.

    Args:
        image: The picture.
        engine: As in `render.pixels.render`.
        limits: As in `render.pixels.render`.

    Returns:
        uint8 [rows, columns, 3], in the colours of the picture.

    Raises:
        UnsupportedError, LimitError, FormatError: As `draw_sheet` and `render.pixels.render`.
    """
    picture, cache = image.picture, Cache()
    scale = reduction(picture.height, picture.width)
    size = (max(1, round(picture.width * scale)), max(1, round(picture.height * scale)))

    def drawn(layers: list[str | int] | None) -> Pixels:
        return np.asarray(render(
            picture, width=size[0], height=size[1], layers=layers, engine=engine, limits=limits,
            cache=cache,
        ))  # fmt: skip

    tiles = []
    for k, layer in enumerate(picture.layers):
        pixels = drawn([k])
        if pixels.shape[2] == 3:
            pixels = np.dstack([pixels, np.full(pixels.shape[:2], 255, np.uint8)])
        tiles.append(Tile(layer.name, pixels, outline_bytes(layer.boundary), layer.pose.hidden))
    hidden = all(tile.hidden for tile in tiles)
    whole = np.zeros((size[1], size[0], 4), np.uint8) if hidden else drawn(None)
    return draw_sheet(whole, tiles)


def draw_sheet(picture: Pixels, tiles: Sequence[Tile]) -> Pixels:
    """Draws the picture with its layers marked, then each layer on a checkerboard.

    Args:
        picture: uint8 [H, W, 3 or 4], the whole picture, reduced as `reduction` says.
        tiles: The layers back to front, of the same size.

    Returns:
        uint8 [rows, columns, 3].

    Raises:
        UnsupportedError: Pillow, which writes the words, is not installed.
    """
    image, drawing = _pillow()
    height, width = picture.shape[:2]
    wide, high = max(width, LEAST) + GAP, height + 2 * LINE + GAP
    count = len(tiles) + 1
    columns = max(1, min(count, round(math.sqrt(1.4 * count * high / wide))))
    rows = -(-count // columns)
    sheet = image.new("RGB", (columns * wide + GAP, rows * high + GAP), PAPER)
    pen = drawing.Draw(sheet)
    shown = [t.pixels[..., 3] >= 128 for t in tiles]
    visible = _visible([mask & (not t.hidden) for mask, t in zip(shown, tiles, strict=True)])
    overlay = image.fromarray(_overlay(_on_checks(picture), visible))
    if width >= LEAST:
        _write_names(drawing.Draw(overlay), tiles, visible)
    for k in range(count):
        x, y = GAP + k % columns * wide, GAP + k // columns * high
        if k == 0:
            sheet.paste(overlay, (x, y))
            lines = [f"{len(tiles)} layers" if len(tiles) != 1 else "1 layer", "back to front"]
        else:
            tile = tiles[k - 1]
            sheet.paste(image.fromarray(_on_checks(tile.pixels)), (x, y))
            share = 100 * float(shown[k - 1].mean())
            cost = f"outline {tile.outline} bytes" if tile.outline else "no outline"
            lines = [tile.name, f"{share:.1f} %, {cost}" + ", hidden" * tile.hidden]
            pen.rectangle((x, y + height + 4, x + 8, y + height + 12), _colour(k - 1))
        for n, line in enumerate(lines):
            inset = 13 if k and not n else 0
            words = _fitted(line, wide - GAP - inset)
            pen.text((x + inset, y + height + n * LINE), words, INK, _font(words))
    return np.asarray(sheet)


def _pillow() -> tuple[Any, Any]:
    try:
        from PIL import Image, ImageDraw
    except ModuleNotFoundError:
        raise UnsupportedError("a sheet needs PIL: pip install 'proxyimg-codec[io]'") from None
    return Image, ImageDraw


def _on_checks(pixels: Pixels) -> Pixels:
    """Picture uint8 [H, W, 3] over a checkerboard."""
    if pixels.shape[2] == 3:
        return pixels
    y, x = np.indices(pixels.shape[:2]) // CHECK
    ground = np.where((x + y) % 2, DARK, LIGHT)[..., None]
    alpha = pixels[..., 3:] / 255
    return np.rint(pixels[..., :3] * alpha + ground * (1 - alpha)).astype(np.uint8)


def _visible(shown: Sequence[NDArray[np.bool_]]) -> list[NDArray[np.bool_]]:
    """Parts of layers, back to front, that no layer in front covers."""
    result: list[NDArray[np.bool_]] = []
    for mask in reversed(shown):
        front = result[0] * False if result else np.zeros_like(mask)
        for other in result:
            front = front | other
        result.insert(0, mask & ~front)
    return result


def _colour(k: int) -> tuple[int, int, int]:
    """Colour that marks layer `k`; neighbours differ, by steps of the golden angle."""
    hue = (k * 0.381966 + 0.02) % 1 * 6
    ramp = [np.clip(abs((hue + shift) % 6 - 3) - 1, 0, 1) for shift in (0, 4, 2)]
    red, green, blue = (int(40 + 200 * v) for v in ramp)
    return red, green, blue


def _overlay(picture: Pixels, visible: Sequence[NDArray[np.bool_]]) -> Pixels:
    """Picture with layers tinted and their outlines drawn."""
    result = picture.astype(np.float64)
    labels = np.full(picture.shape[:2], -1)
    for k, mask in enumerate(visible):
        labels[mask] = k
        if k:
            result[mask] = 0.65 * result[mask] + 0.35 * np.array(_colour(k))
    edge = np.zeros(labels.shape, np.bool_)
    edge[:, 1:] |= labels[:, 1:] != labels[:, :-1]
    edge[1:] |= labels[1:] != labels[:-1]
    result[edge] = 255
    return np.rint(result).astype(np.uint8)


def _write_names(pen: Any, tiles: Sequence[Tile], visible: Sequence[NDArray[np.bool_]]) -> None:
    """Writes the name of each layer into what is seen of it."""
    for tile, mask in zip(tiles, visible, strict=True):
        if not mask.any():
            continue
        y, x = _middle(mask)
        words = _fitted(tile.name, mask.shape[1] - 4)
        font = _font(words)
        half = font.getlength(words) / 2
        x = min(max(x, half + 2), mask.shape[1] - half - 2)
        pen.text((x, y), words, PAPER, font, anchor="mm", stroke_width=2, stroke_fill=INK)


def _middle(mask: NDArray[np.bool_]) -> tuple[int, int]:
    """Row and column of a pixel that is about as deep inside a mask as any."""
    step = max(1, max(mask.shape) // 90)
    deep = np.pad(mask[::step, ::step], 1)
    deep = deep if deep.any() else np.pad(mask, 1)
    step = step if mask[::step, ::step].any() else 1
    while True:
        less = deep.copy()
        for move in ((1, 0), (-1, 0), (0, 1), (0, -1)):
            less &= np.roll(deep, move, (0, 1))
        if not less.any():
            break
        deep = less
    rows, columns = np.nonzero(deep)
    at = int(np.hypot(rows - rows.mean(), columns - columns.mean()).argmin())
    return int(rows[at] - 1) * step, int(columns[at] - 1) * step


def _fitted(text: str, width: int) -> str:
    """Text, or its beginning and end, so that it is at most `width` pixels wide."""
    text = "".join(c if c.isprintable() else "?" for c in text)
    font = _font(text)
    text = "".join(c if _has(font, c) else "?" for c in text)
    short, keep = text, len(text)
    while _font(short).getlength(short) > width and keep > 2:
        keep -= 1
        short = f"{text[: (keep + 1) // 2].rstrip()}…{text[len(text) - keep // 2 :].lstrip()}"
    return short


@cache
def _fonts() -> list[Any]:
    from PIL import ImageFont

    found = [ImageFont.load_default(TEXT)]
    for name in FONTS:
        try:
            found.append(ImageFont.truetype(name, TEXT))
        except OSError:
            continue
    return found


def _font(text: str) -> Any:
    """Font that has most letters of a text."""
    return max(_fonts(), key=lambda font: sum(_has(font, c) for c in text))


@cache
def _has(font: Any, letter: str) -> bool:
    """Whether a font has a letter; what it lacks looks like a number that is no letter."""
    missing = font.getmask("\U0010ffff")
    mask = font.getmask(letter)
    return letter == " " or bytes(mask) != bytes(missing) or mask.size != missing.size

"""Requests taken apart, and answers put together."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any

from starlette.requests import Request
from starlette.responses import Response

from ..errors import LimitError, UsageError
from . import drawing
from .drawing import Wanted
from .pointing import Hints
from .strokes import painted

BODY_MAX = 1 << 22
"""Most bytes of a request that is JSON."""

Values = Mapping[str, Any]


def hints_of(values: Values, size: tuple[int, int]) -> Hints:
    """Hints of a request: points, a box, strokes.

    Raises:
        UsageError: It is not understood.
    """
    box = values.get("box")
    strokes = strokes_of(values)
    return Hints(
        tuple(_points(values.get("inside", []), "inside")),
        tuple(_points(values.get("outside", []), "outside")),
        None if box is None else _numbers(box, 4, "box"),
        painted(strokes, radius_of(values), size) if strokes else None,
    )  # fmt: skip


def strokes_of(values: Values) -> list[list[tuple[float, float]]]:
    """Strokes of a request.

    Raises:
        UsageError: It is not understood.
    """
    strokes = values.get("strokes", [])
    if not isinstance(strokes, list):
        raise UsageError("strokes: must be a list of lists of points")
    return [_points(stroke, "strokes") for stroke in strokes]


def radius_of(values: Values) -> float:
    """Radius of the brush of a request, in pixels.

    Raises:
        UsageError: It is not understood.
    """
    return float(_numbers([values.get("radius", 6)], 1, "radius")[0])


def _points(values: Any, name: str) -> list[tuple[float, float]]:
    if not isinstance(values, list):
        raise UsageError(f"{name}: must be a list of points")
    return [_numbers(value, 2, name) for value in values]


def _numbers(value: Any, count: int, name: str) -> Any:
    """Exactly `count` finite numbers, as a tuple."""
    good = isinstance(value, list) and len(value) == count
    if not good or not all(
        isinstance(v, (int, float)) and not isinstance(v, bool) and math.isfinite(v) for v in value
    ):
        raise UsageError(f"{name}: {str(value)[:60]} must be {count} numbers")
    return tuple(map(float, value))


def wanted_of(query: Mapping[str, str], canvas: tuple[int, int]) -> Wanted:
    """Request of an exact picture."""
    parts = [number_of(query, key, 0, 1 << 20) for key in ("x", "y", "w", "h")]
    region = None
    if any(v is not None for v in parts):
        defaults = (0, 0, *canvas)
        x, y, w, h = (int(d if v is None else v) for v, d in zip(parts, defaults, strict=True))
        region = (x, y, w, h)
    width, height = (number_of(query, key, 1, 1 << 15) for key in ("width", "height"))
    layers = query.get("layers")
    try:
        chosen = None if layers is None else tuple(int(v) for v in layers.split(","))
    except ValueError:
        raise UsageError(f"layers: {layers!r} must be positions such as 0,2") from None
    return Wanted(
        region, None if width is None else int(width), None if height is None else int(height),
        number_of(query, "t", -1e6, 1e6), chosen,
    )  # fmt: skip


def number_of(query: Mapping[str, str], key: str, low: float, high: float) -> float | None:
    """Number of an address within bounds; None if it is not there."""
    if key not in query:
        return None
    try:
        value = float(query[key])
    except ValueError:
        value = math.nan
    if not low <= value <= high:
        raise UsageError(f"{key}: {query[key]!r} is not a number in {low:g}..{high:g}")
    return value


def text_of(query: Mapping[str, str], key: str) -> str:
    """Text of an address, which must be there.

    Raises:
        UsageError: It is not understood.
    """
    if not query.get(key):
        raise UsageError(f"{key}: is missing in the address")
    return query[key]


async def json_of(request: Request) -> dict[str, Any]:
    """Object that a request sends."""
    kind = request.headers.get("content-type", "").partition(";")[0]
    if kind != "application/json":
        raise UsageError("the request must be of type application/json")
    try:
        values = json.loads(await body_of(request, BODY_MAX))
    except (ValueError, RecursionError) as error:
        raise UsageError(f"the request is not valid JSON: {error}") from None
    if not isinstance(values, dict):
        raise UsageError("the request must be a JSON object")
    return values


async def body_of(request: Request, most: int) -> bytes:
    """Body of a request, which is not read beyond `most` bytes.

    Raises:
        LimitError: It is longer.
    """
    said = request.headers.get("content-length", "0")
    parts, size = [], int(said) if said.isdecimal() and len(said) < 20 else 0
    if size <= most:
        size = 0
        async for part in request.stream():
            parts.append(part)
            size += len(part)
            if size > most:
                break
    if size > most:
        raise LimitError(f"the request has more than {most} bytes; raise --limit file_bytes=... "
                         "if you trust the file")  # fmt: skip
    return b"".join(parts)


def pixels_answer(
    pixels: drawing.Bytes, form: str, headers: Mapping[str, str] | None = None
) -> Response:  # fmt: skip
    """Answer with uint8 [H, W, 4], as PNG or as bytes of RGBA."""
    height, width = pixels.shape[:2]
    more = {**(headers or {}), "x-width": str(width), "x-height": str(height)}
    if form == "raw":
        return binary_answer(pixels.tobytes(), more)
    if form != "png":
        raise UsageError(f"format: {form!r} is neither png nor raw")
    return picture_answer(drawing.png(pixels), more)


def picture_answer(data: bytes, headers: Mapping[str, str] | None = None) -> Response:
    """Answer with a PNG file."""
    every = {**(headers or {}), "cache-control": "no-store"}
    return Response(data, media_type="image/png", headers=every)


def binary_answer(data: bytes, headers: Mapping[str, str] | None = None) -> Response:
    """Answer with bytes."""
    every = {**(headers or {}), "cache-control": "no-store"}
    return Response(data, media_type="application/octet-stream", headers=every)

"""Faults that concern any file: containers, boundaries, textures, pictures."""

from __future__ import annotations

import time
import types
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgpack
import numpy as np

from proxyimg_codec.cli import decode
from proxyimg_codec.container import chunks, fields, file
from proxyimg_codec.entropy import arrays, rans
from proxyimg_codec.errors import FormatError
from proxyimg_codec.geometry import coverage, deltas
from proxyimg_codec.io import raster
from proxyimg_codec.render import compose, pixels, view
from proxyimg_codec.texture import diffusion, implicit, network

Patch = tuple[object, str, Any]
"""An object, the name of an attribute, and the value that replaces it."""


class Anything:
    """Object that is equal to everything."""

    __hash__ = None  # type: ignore[assignment]  # as Python does where __eq__ is defined

    def __eq__(self, other: object) -> bool:
        return True

    def __ne__(self, other: object) -> bool:
        return False


def _paths(segments: coverage.Segments) -> list[Any]:
    """Paths [3 m, 2] of which segments are; each ends where it began."""
    paths, own = [], list[Any]()
    for segment in segments.points:
        own.append(segment[:3])
        if (segment[3] == own[0][0]).all():
            paths.append(np.concatenate(own))
            own.clear()
    return paths


def _ignoring_holes(segments: coverage.Segments, *window: Any) -> Any:
    return np.max([coverage_of([p], *window) for p in _paths(segments)], axis=0)


def _even_odd(segments: coverage.Segments, *window: Any) -> Any:
    total = sum(coverage_of([p], *window).astype(np.int64) for p in _paths(segments))
    rest = total % (2 * coverage.FULL)
    return np.minimum(rest, 2 * coverage.FULL - rest)


def _nearest(*args: Any) -> Any:
    taps = taps_of(*args)
    return taps._replace(fx=np.rint(taps.fx), fy=np.rint(taps.fy))


def _floored(points: Any, unit: int, origin: int, size: int, pixels: int) -> Any:
    return (points - (origin << unit)) * pixels * coverage.ONE // (size << unit)


def _no_trailing(data: bytes, *limits: Any) -> Any:
    at = data.find(b"TAIL\0\0\0\0")
    return read_of(data[: at + 12] if at > 0 else data, *limits)


def _straight(tile: Any, solid: bool, dtype: Any) -> Any:
    return finish_of(np.where([True] * 3 + [False], tile * tile[..., 3:], tile), solid, dtype)


def _opaque(tile: Any, solid: bool, dtype: Any) -> Any:
    done = finish_of(tile, solid, dtype)
    done[..., 3:] = np.iinfo(dtype).max
    return done


def _writing_nan(path: str, samples: Any, *_: Any) -> None:
    with open(path, "wb") as out:
        np.save(out, np.full(samples.shape, np.nan, np.float32))


def _lenient_halves(data: bytes, count: int, *_: Any, **__: Any) -> Any:
    return np.resize(np.frombuffer(data, "<f2").astype(np.float16), count)


def _lenient_fields(
    declared: tuple[fields.Field, ...], payload: bytes, where: str, **how: Any
) -> Any:
    try:
        return fields_of(declared, payload, where, **how)
    except FormatError as error:
        if "canonical" not in str(error):
            raise
        return fields_of(declared, msgpack.packb(msgpack.unpackb(payload)), where, **how)


def _ignoring_more(
    declared: tuple[fields.Field, ...], payload: bytes, where: str, **how: Any
) -> Any:
    try:
        return fields_of(declared, payload, where, **how)
    except FormatError as error:
        if " values instead of " not in str(error):
            raise
        first = msgpack.unpackb(payload)[: len(declared)]
        return fields_of(declared, msgpack.packb(first), where, **how)


def _sorting_keys(
    declared: tuple[fields.Field, ...], payload: bytes, where: str, **how: Any
) -> Any:
    content = msgpack.unpackb(payload)
    if isinstance(content, dict) and content.keys() == {f.key for f in declared}:
        payload = msgpack.packb([content[f.key] for f in declared])
    return fields_of(declared, payload, where, **how)


def _refusing_maps(
    declared: tuple[fields.Field, ...], payload: bytes, where: str, **how: Any
) -> Any:
    if payload[:1] < b"\x90":
        raise FormatError("not an array", where)
    return fields_of(declared, payload, where, **how)


def _hanging(*_: Any) -> int:
    while True:
        time.sleep(1)


def _crashing(argv: list[str]) -> int:
    return 1 if main_of(argv) else 0


def _obliging(argv: list[str]) -> int:
    main_of(argv)
    return 0


coverage_of, taps_of, read_of = coverage.coverage, implicit.taps, chunks.read
finish_of, write_of, fields_of, main_of = pixels._finished, raster.write, fields.unpack, decode.main
premultiplied_of, compose_of, selected_of = compose.premultiplied, compose.compose, pixels.selected

_Coverage = Callable[..., Any]


def _coverage(function: _Coverage) -> list[Patch]:
    """Patches that replace the function of coverage."""
    return [(coverage, "coverage", function)]


FAULTS: dict[str, list[Patch]] = {
    "half-pixel": [(view, "_centres", lambda origin, start, stop, pitch:
        np.arange(start, stop, dtype=np.float64) * pitch + origin)],
    "layer-order": [(pixels, "compose", lambda p, v, layers, *rest:
        compose_of(p, v, layers[::-1], *rest))],
    "ignores-holes": _coverage(_ignoring_holes),
    "even-odd": _coverage(_even_odd),
    "hard-edges": _coverage(lambda *a: (coverage_of(*a) > coverage.FULL // 2) * coverage.FULL),
    "coarse-coverage": _coverage(lambda *a: coverage_of(*a) // 8192 * 8192),
    "points-floored": [(coverage, "to_output", _floored)],
    "coarse-curves": [(coverage, "MAX_LOG2_CHORDS", 1)],
    "escape-narrow": [(deltas, "_ESCAPE", 16)],
    "swaps-channels": [(compose, "premultiplied", lambda out:
        premultiplied_of(out)[:, [2, 1, 0, 3]])],
    "not-premultiplied": [(pixels, "_finished", _straight)],
    "drops-alpha": [(pixels, "_finished", _opaque)],
    "zeros-for-diffusion": [(implicit, "fill", lambda codes, stored:
        np.where(stored, codes.astype(np.int32) << diffusion.FRACTION_BITS, 0))],
    "no-smoothing": [(diffusion, "SWEEPS", 0)],
    "nearest": [(implicit, "taps", _nearest)],
    "no-octaves": [(network, "encode_features", lambda f, octaves:
        np.tile(f, (1, 2 * octaves + 1)))],
    "no-averaging": [(view.View, "supersampling", (1, 1))],
    "keeps-background": [(pixels, "selected", lambda image, layers, _:
        selected_of(image, layers, True))],
    "ignores-layers": [(pixels, "selected", lambda image, _, background:
        selected_of(image, None, background))],
    "ignores-region": [(decode, "parse_region", lambda text: None)],
    "no-halving": [(arrays, "COUNT_LIMIT", 1 << 30)],
    "nan": [(raster, "write", _writing_nan)],
    "one-row-short": [(raster, "write", lambda path, p, *a: write_of(path, p[:-1], *a))],
    "eight-bit": [(raster, "write", lambda path, p, *a:
        write_of(path, (p >> 8).astype(np.uint8), *a))],
    "writes-nothing": [(raster, "write", lambda *a: None)],
    "writes-rubbish": [(raster, "write", lambda path, *a: Path(path).write_bytes(b"rubbish"))],
    "accepts-bad-crc": [(chunks, "zlib", types.SimpleNamespace(crc32=lambda data: Anything()))],
    "accepts-trailing-bytes": [(file, "read", _no_trailing)],
    "ignores-critical-chunks": [(chunks.Chunk, "critical", False)],
    "accepts-left-over-words": [(rans.Decoder, "finish", lambda self: None)],
    "accepts-any-step": [(implicit, "read_halves", _lenient_halves),
        (network, "read_halves", _lenient_halves)],
    "accepts-any-encoding": [(file, "unpack", _lenient_fields)],
    "accepts-more-values": [(file, "unpack", _ignoring_more)],
    "accepts-any-order-of-keys": [(file, "unpack", _sorting_keys)],
    "refuses-maps": [(file, "unpack", _refusing_maps)],
    "reads-maps-in-all-versions": [(chunks, "MAPS_UNTIL", (0, 99))],
    "exit-code-1": [(decode, "main", _crashing)],
    "exit-code-0": [(decode, "main", _obliging)],
    "hangs": [(decode, "main", _hanging)],
}  # fmt: skip
"""Patches of each decoder with a fault."""

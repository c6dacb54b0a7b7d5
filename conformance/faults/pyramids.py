"""Faults of pyramid textures."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from proxyimg_codec.codec import unpack as unpacking
from proxyimg_codec.entropy import laplace
from proxyimg_codec.geometry.pose import Pose
from proxyimg_codec.native import kernel
from proxyimg_codec.render import compose, neighbours, thumbnail
from proxyimg_codec.texture import (
    completion,
    context,
    grid,
    latents,
    lifts,
    occlusion,
    planes,
    pyramid,
    registered_model,
    sampling,
    synthesis,
    unmix,
)
from proxyimg_codec.texture.context import LevelCoder
from proxyimg_codec.texture.grid import Grid
from proxyimg_codec.texture.lifts import lifts_of
from proxyimg_codec.texture.occlusion import ALL_IN_PLACE, ALL_REMOVED, Moved, Occlusion
from proxyimg_codec.texture.pyramid import PyramidTexture

from .basics import Patch


def _floored(total: Any, bits: int) -> Any:
    total *= np.float32(2.0**-bits)
    return np.floor(total, out=total)


def _truncated(numerator: Any, unit: int) -> Any:
    size = np.minimum(np.abs(numerator), 508 * unit)
    return np.sign(numerator) * (128 * size // (4 * unit + size))


def _chroma_first(
    self: LevelCoder, coder: Any, ahead: Any, around: Any, there: Any, given: Any
) -> Any:
    if self.grey:
        return wave_of(self, coder, ahead, around, there, given)
    w = self.weights
    z = context.scaled(around @ self._causal, -w.causal.exponent - 3)
    z = context.activated(z + ahead, 3)
    z = context.activated(z @ self._mix + context._floats(w.mix_bias), -w.mix.exponent)
    out = np.zeros((len(z), 9), np.int64)
    self._put(coder, z @ self._chroma, w.chroma, w.chroma_bias, 1, there, given, out[:, 3:])
    self._put(coder, z @ self._luma, w.luma, w.luma_bias, 0, there, given, out[:, :3])
    return out


def _waves(slope: int) -> Any:
    """Function that yields wavefronts x + `slope` * y."""

    def waves(support: Any) -> Iterator[context.Wave]:
        rows, columns = np.nonzero(support)
        times = columns + slope * rows
        for t in np.unique(times):
            at = times == t
            yield context.Wave(rows[at], columns[at])

    return waves


def _everywhere(self: Grid, cells: Any, cell: int, level: int) -> Any:
    return bands_of(self, np.ones_like(cells), cell, level)


def _odd_as_even(self: Grid, cells: Any, cell: int, level: int) -> Any:
    return np.where(bands_of(self, cells, cell, level), np.uint8(7), np.uint8(0))


def _clipped(size: int, high: bool) -> Any:
    n = (size + 1) // 2
    return np.clip(np.arange(-2, n + 2), 0, n - 1)


def _low_everywhere(size: int, high: bool) -> Any:
    return np.minimum(mirrored_of(size, False), max((size - int(high) - 1) // 2, 0))


def _mirrored_as_even(size: int, high: bool) -> Any:
    return mirrored_of(size + size % 2, high)


def _without_shifts(self: Any, weights: Any, step: int, grey: bool, shifts: Any) -> None:
    level_of(self, weights, step, grey, (0, 0))


def _all_colour(self: Any, weights: Any, step: int, grey: bool, shifts: Any) -> None:
    level_of(self, weights, step, False, shifts)


def _unsigned(self: Any) -> int:
    return abs(int(escape_of(self)))


def _linear(f: Any) -> Any:
    return 0 * f, 1 - f, f, 0 * f


def _sharp(f: Any) -> Any:
    """Weights of the kernel of Keys with a = -3/4."""
    return (
        -0.75 * f * (1 - f) ** 2,
        (1.25 * f - 2.25) * f * f + 1,
        ((1.5 - 1.25 * f) * f + 0.75) * f,
        0.75 * (f - 1) * f * f,
    )


def _corners(points: Any, start: int, extent: int, samples: int) -> Any:
    at = np.clip((points - start) * ((samples - 1) / extent), 0, samples - 1)
    before = at.astype(np.intp)
    return before, (at - before).astype(np.float32)


def _nearest(points: Any, start: int, extent: int, samples: int) -> Any:
    before, f = position_of(points, start, extent, samples)
    return np.minimum(before + (f >= 0.5), samples - 1), 0 * f


def _straight(self: PyramidTexture, *where: Any) -> Any:
    values = samples_of(self, *where)
    if self.alpha is not None:
        values[:, :3] /= np.maximum(values[:, 3:], 1e-6)
    return values


def _premultiplied(output: Any) -> Any:
    if output.shape[1] == 4:
        output[:, :3] *= output[:, 3:]
    return premultiplied_of(output)


def _whole(*args: Any) -> PyramidTexture:
    found = unpack_of(*args)
    return replace(found, part=(0, 0, *found.planes.size), mask=None, cuts=None)


def _seeing(self: Any, window: Any) -> Any:
    outer = window.grown(context.REACH, self.bands.shape)
    bands = self.bands[outer.at]
    low, parent = self.low[:, *outer.at], self.parent[:, *outer.halved().at]
    return context.Place(self.coder, low, parent, bands), outer


def _tiles_down_first(self: Grid, level: int, tile: int) -> Any:
    return sorted(tiles_of(self, level, tile), key=lambda window: (window.left, window.top))


def _off(start: int, span: float, count: int, level: int, size: int) -> Any:
    return taps_of(start + (1 << level) // 2, span, count, level, size)


def _black(value: Any, known: Any) -> Any:
    return np.where(known, value, 0)


def _opaque(*args: Any) -> PyramidTexture:
    found = unpack_of(*args)
    return found if found.alpha is None else replace(found, alpha=None)


def _unmixed(self: Occlusion) -> Any:
    found = self._left(self.everything)
    return found if found.any() else ~found


def _all_bare(*args: Any) -> Moved:
    found = moved_of(*args)
    return found._replace(behind=ALL_REMOVED) if found.behind else found


def _back_bares(*args: Any) -> Moved:
    found = moved_of(*args)
    return found._replace(behind=tuple((b, s) for b, s in found.behind if not s))


def _only_where(self: Pose, other: Pose) -> bool:
    return (self.matrix, self.shift, self.colour) == (other.matrix, other.shift, other.colour)


def _any_colour(self: Pose, other: Pose) -> bool:
    return still_of(self, replace(other, colour=self.colour))


def _all_drawn(picture: Any, layer: Any, drawn: Any) -> Moved:
    return neighbours_of(picture, layer, frozenset(picture.layers))


def _without(*fields: str) -> Any:
    """Function that unpacks a view without some of its fields."""
    absent: dict[str, Any] = dict.fromkeys(fields)
    return lambda *args: replace(unpack_of(*args), **absent)


def _bare_alone(self: Occlusion, moved: Moved) -> Any:
    return loose_of(self, moved) if self.own is None else self._bared(moved)


def _never_apart(*args: Any) -> Moved:
    return neighbour_of(*args)._replace(apart=False)


def _soft_where_bare(self: PyramidTexture, moved: Moved) -> Any:
    """Soft samples that layers in front hid show as if they were opaque."""
    kept = kept_of(self, moved)
    if self.matte is None or self.cuts is None or moved.behind:
        return kept
    return None if kept is None else kept | self.soft


def _trusting(self: PyramidTexture, trusted: Any) -> Any:
    whole = self._present if self.cuts is None else self.cuts.trusted
    return known_of(self, trusted if self.matte is None else whole)


def _down_first(*args: Any) -> PyramidTexture:
    found = unpack_of(*args)
    copies = found.copies
    turned = copies and replace(copies, offsets=copies.offsets[:, ::-1])
    return replace(found, copies=turned)


def _nearest_cell(count: int, grain: int) -> Any:
    number, weight = weights_of(count, grain)
    return number, np.where(weight * 2 >= 2 << grain, 2 << grain, 0).astype(np.int32)


def _low_sources(self: Any, where: Any) -> Any:
    found = copies_of(self, where)
    return found and replace(found, sources=found.sources & np.uint8(15))


def _over_trusted(self: PyramidTexture, trusted: Any) -> Any:
    return known_of(self, trusted if self.behind is None else np.zeros_like(trusted))


def _everywhere_behind(self: PyramidTexture, trusted: Any) -> Any:
    if self.behind is None:
        return known_of(self, trusted)
    own = planes.Planes(self.behind.packed)
    own.__dict__["samples"] = self.behind.samples
    own.__dict__["support"] = np.ones_like(self.behind.support)
    return known_of(replace(self, behind=own), trusted)


bands_of, mirrored_of, level_of = Grid.bands, grid.mirrored_indices, LevelCoder.__init__
grid_of, wave_of, escape_of = Grid.of, LevelCoder._wave, latents.Decoder._escape
position_of, samples_of = sampling.position, PyramidTexture._samples
unpack_of, premultiplied_of = pyramid.unpack, compose.premultiplied
moved_of, known_of = Occlusion.moved, PyramidTexture.known
still_of, neighbours_of = Pose.still, neighbours.moved_neighbours
tiles_of, taps_of = Grid.tiles, thumbnail._taps
neighbour_of = neighbours._moved
loose_of, kept_of = Occlusion.loose, PyramidTexture.kept
copies_of, weights_of, bases_of = completion.unpack, completion._weights, completion._bases

_FAULTS: dict[str, list[Patch]] = {
    "causal-off-by-one": [(context, "CAUSAL", (*registered_model.CAUSAL[:-1], (-1, 3)))],
    "causal-reversed": [(context, "CAUSAL", registered_model.CAUSAL[::-1])],
    "context-floored": [(context, "scaled", _floored)],
    "features-truncated": [(context, "_squashed", _truncated)],
    "chroma-first": [(LevelCoder, "_wave", _chroma_first)],
    "waves-too-steep": [(context, "waves", _waves(4))],
    "ignores-support": [(Grid, "bands", _everywhere)],
    "codes-bands-that-are-not-there": [(Grid, "bands", _odd_as_even)],
    "support-of-padded-everywhere": [(grid, "_grown", lambda mask: mask)],
    "pads-all-models": [(Grid, "of", classmethod(lambda cls, fields: grid_of(fields)
        ._replace(padded=True)))],
    "pads-no-model": [(Grid, "of", classmethod(lambda cls, fields: grid_of(fields)
        ._replace(padded=False)))],
    "context-not-mirrored": [(context, "mirrored_indices", _clipped)],
    "context-high-mirrored-as-low": [(context, "mirrored_indices", _low_everywhere)],
    "context-odd-mirrored-as-even": [(context, "mirrored_indices", _mirrored_as_even)],
    "synthesis-not-mirrored": [(synthesis, "mirrored_indices", _clipped)],
    "synthesis-odd-mirrored-as-even": [(synthesis, "mirrored_indices", _mirrored_as_even)],
    "ignores-shifts": [(LevelCoder, "__init__", _without_shifts)],
    "ignores-grey-levels": [(LevelCoder, "__init__", _all_colour)],
    "one-level-set": [(registered_model, "LEVEL_SETS", 1)],
    "ignores-step": [(synthesis, "STEP_ORIGIN", 0)],
    "codes-certain-latents": [(laplace, "CERTAIN", -1)],
    "escapes-unsigned": [(latents.Decoder, "_escape", _unsigned)],
    "accepts-left-over-escapes": [(latents.Decoder, "finish", lambda self, where: None)],
    "tiles-see-their-neighbours": [(context.Place, "tile", _seeing)],
    "tiles-down-first": [(Grid, "tiles", _tiles_down_first)],
    "reads-small-tiles": [(planes, "TILE_MIN", 0)],
    "thumbnails-without-too-much": [(thumbnail, "ERROR_MAX", 1e9)],
    "thumbnails-half-a-sample-off": [(thumbnail, "_taps", _off)],
    "thumbnails-without-the-gain-of-levels": [(synthesis, "_evenly", lambda *a: np.eye(3) * 0.5)],
    "accepts-large-latents": [(context, "LIMIT", 1 << 20)],
    "nearest-sample": [(sampling, "position", _nearest)],
    "linear": [(sampling, "weights", _linear)],
    "cubic-sharp": [(sampling, "weights", _sharp)],
    "samples-on-corners": [(sampling, "position", _corners)],
    "interpolates-straight": [(PyramidTexture, "_samples", _straight),
        (compose, "premultiplied", _premultiplied)],
    "ignores-part": [(pyramid, "unpack", _whole)],
    "ignores-alpha-planes": [(pyramid, "unpack", _opaque)],
    "ignores-mask": [(PyramidTexture, "shown", None)],
    "fills-black": [(pyramid, "diffused", _black)],
    "ignores-cuts": [(Occlusion, "of", lambda *a: None)],
    "cuts-mixed-samples": [(Occlusion, "shown", property(_unmixed))],
    "trusts-mixed-samples": [(Occlusion, "trusted", property(lambda self: self.shown))],
    "keeps-rims": [(Occlusion, "moved", lambda *a: ALL_IN_PLACE)],
    "keeps-rims-of-its-own": [(Occlusion, "moved", lambda *a: moved_of(*a)._replace(behind=()))],
    "keeps-mixed-colours": [(unmix, "_own", lambda raster, edge:
        raster.reshape(-1, raster.shape[2])[edge.core])],
    "fills-own-rims": [(pyramid, "rim", lambda *a: None)],
    "unmixes-always": [(unpacking, "replace", lambda cuts, **flags: cuts)],
    "unmixes-by-coverage-alone": [(occlusion, "_smooth", lambda covered: 36 * covered)],
    "unmixes-with-what-is-far": [(unmix, "BEYOND", 4)],
    "keeps-rims-of-what-is-not-drawn": [(compose, "moved_neighbours", _all_drawn)],
    "keeps-rims-of-what-is-bent-or-shines-through": [(Pose, "still", _only_where)],
    "keeps-rims-of-what-is-recoloured": [(Pose, "still", _any_colour)],
    "keeps-rims-of-another-raster": [(neighbours, "place", lambda *a: None)],
    "loses-rims-everywhere": [(Occlusion, "moved", _all_bare)],
    "loses-rims-of-what-moves-together": [(Occlusion, "moved", _back_bares)],
    "ignores-behind": [(pyramid, "unpack", _without("behind", "behind_alpha"))],
    "ignores-alpha-behind": [(pyramid, "unpack", _without("behind_alpha"))],
    "behind-over-trusted": [(PyramidTexture, "known", _over_trusted)],
    "behind-without-cells": [(PyramidTexture, "known", _everywhere_behind)],
    "ignores-mattes": [(pyramid, "unpack", _without("matte"))],
    "mattes-at-rest": [(Occlusion, "loose", lambda self, moved: np.ones(self.box[:1:-1], bool)),
        (PyramidTexture, "shown", property(lambda self: self._present & ~self.soft))],
    "mattes-without-reach": [(Occlusion, "loose", _bare_alone)],
    "mattes-over-what-was-there": [(neighbours, "_moved", _never_apart)],
    "mattes-of-moved-layers-alone": [(PyramidTexture, "kept", _soft_where_bare)],
    "soft-layers-hide": [(Occlusion, "moved", lambda self, *of: moved_of(self, *of[:3]))],
    "trusts-soft-samples": [(PyramidTexture, "known", _trusting)],
    "ignores-references": [(pyramid, "unpack", _without("copies"))],
    "offsets-down-first": [(pyramid, "unpack", _down_first)],
    "sources-without-upper-bits": [(pyramid, "unpacked_copies", _low_sources)],
    "copies-without-overlap": [(completion, "_weights", _nearest_cell)],
    "copies-what-is-not-known": [(completion, "_bases",
        lambda values, known, *how: bases_of(values, np.ones_like(known), *how))],
    "copies-without-lifts": [(completion, "lifts_of", lambda copier: 0 * lifts_of(copier))],
    "copies-lifted-once": [(lifts, "TURNS", 1)],
    "copies-lifted-without-bound": [(lifts, "LIFT", 1 << 20)],
    "copies-linked-though-apart": [(lifts, "APART", 1 << 20)],
    "copies-without-rim": [(completion, "diffused", lambda value, *how: 0 * value)],
    "copies-not-clamped": [(completion, "FILL_ONE", 1 << 30)],
    "trusts-samples-near": [(occlusion, "REACH", 1)],
}  # fmt: skip

# The compiled kernel is switched off, because patches do not reach it.
FAULTS = {name: [(kernel, "available", lambda: False), *own] for name, own in _FAULTS.items()}
"""Patches of each decoder with a fault."""

"""Pyramid texture: a view of a part of a raster, sampled by an interpolating kernel.

Several layers may be views of the same raster. A mask, and boundaries that cut, decide the samples
that show in each. Hidden samples are made when they are first needed: they come from a raster of
the view's own, copy others (`texture.completion`), or are filled smoothly from trusted ones. These
are without cuts all that show, with cuts those that no other layer is mixed into.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ..container import texr
from ..entropy import arrays
from ..errors import FormatError
from ..native import kernel
from . import sampling
from .completion import FILL_ONE, Copies, completed
from .completion import unpack as unpacked_copies
from .diffusion import Values, diffused
from .grid import Window
from .implicit import Box, ImplicitTexture
from .network import Floats, Network
from .occlusion import ALL_IN_PLACE, Moved, Occlusion, Samples
from .planes import Planes
from .unmix import rim


@dataclass(frozen=True, eq=False)
class PyramidTexture:
    """View of the raster of some planes.

    Attributes:
        planes: Planes of the colour, which is straight if there is `alpha`; 1 component is grey.
        alpha: Planes of the alpha, of the same size; None if the view is opaque.
        part: Part of the raster that is stretched over the box of the layer: x, y, width, height in
            samples.
        cell: Base-2 logarithm of the side of a cell of `mask`, in samples.
        mask: bool [rows, columns], True for the cells, from the corner of `part` on, that belong to
            the layer; None = all.
        cuts: Boundaries that cut the view, together with the mask; or None.
        behind: Planes of the view's own, of the size of `part`, with samples for what does not
            show or is not trusted; None if there are none. They have as many components as
            `planes`, or 3.
        behind_alpha: Planes of the alpha of `behind`, of the same size; None if that is opaque, or
            there is no `alpha`.
        copies: References of hidden samples to others that they copy, or None.
        matte: Planes of the alpha that soft samples have where they do not show, of the size of
            `part`; None if there are none. With it, `behind` is not None.
        network: Always None: no network of the file is needed.
    """

    planes: Planes
    alpha: Planes | None
    part: Box
    cell: int = 0
    mask: NDArray[np.bool_] | None = None
    cuts: Occlusion | None = None
    behind: Planes | None = None
    behind_alpha: Planes | None = None
    copies: Copies | None = None
    matte: Planes | None = None
    network: ClassVar[None] = None

    @property
    def arrays(self) -> tuple[NDArray[Any], ...]:
        """Arrays of the texture, without those of its planes."""
        own = () if self.mask is None else (self.mask,)
        return own if self.copies is None else (*own, *self.copies.arrays)

    def channels(self, networks: Sequence[Network]) -> int:
        """Number of channels: 3, or 4 with alpha; `networks` is not used."""
        return 3 if self.alpha is None and self.matte is None else 4

    @property
    def sources(self) -> tuple[Planes, ...]:
        """Planes that the view needs: those of colour, alpha, `behind` and its alpha, the matte."""
        found = (self.planes, self.alpha, self.behind, self.behind_alpha, self.matte)
        return tuple(p for p in found if p is not None)

    def renewed(self, new: Mapping[Planes, Planes]) -> PyramidTexture:
        """View of other planes: those that `new` has for each of `sources`."""
        own = ((name, getattr(self, name)) for name in ("planes", *texr.PLANES))
        changed: dict[str, Any] = {name: new[p] for name, p in own if p is not None}
        return replace(self, **changed)

    @cached_property
    def coded_mask(self) -> bytes:
        """Coded mask: the one that was read, otherwise a newly coded one; empty for all samples."""
        if self.mask is None or self.mask.all():
            return b""
        return arrays.encode(self.mask[None].astype(np.int64), 1, np.ones(self.mask.shape, bool))

    def masked(self, moved: Moved, cuts: Occlusion | None = None) -> PyramidTexture:
        """Replaces cuts by a mask. What is behind is dropped where all samples show.

        The mask has cells of 2x2 samples, and holds those whose samples all show when neighbours
        have moved; if there are none, those of which any sample shows.

        Args:
            moved: Neighbours that count as moved.
            cuts: Cuts that the new view keeps, or None.

        Returns:
            The new view; this view itself if it has no cuts.
        """
        if self.cuts is None:
            return self
        kept = self.cuts.kept(moved)
        height, width = kept.shape
        whole = np.pad(kept, ((0, height % 2), (0, width % 2)), mode="edge")
        corners = [whole[j::2, i::2] for j in (0, 1) for i in (0, 1)]
        mask = np.logical_and.reduce(corners)
        if not mask.any():
            mask = np.logical_or.reduce(corners)
        if mask.all():
            useless = cuts is None and self.matte is None
            gone = ("behind", "behind_alpha", "copies") if useless else ()
            lost: dict[str, Any] = dict.fromkeys(gone)
            return replace(self, cell=0, mask=None, cuts=cuts, **lost)
        if cuts is not None:
            cuts = replace(cuts, within=_samples(mask, 1, self.part))
        return replace(self, cell=1, mask=mask, cuts=cuts)

    def fields(self, numbers: Mapping[Planes, int], cuts: Sequence[int] = ()) -> dict[str, Any]:
        """Encodes the view as the fields of TEXR.

        Args:
            numbers: Numbers of the planes in the file.
            cuts: Ascending numbers of the layers whose boundaries cut the view.
        """
        mask = self.coded_mask
        return {
            "coder": texr.PYRAMID,
            "planes": numbers[self.planes],
            "alpha": 0,
            "part": list(self.part),
            "cell": self.cell if mask else 0,
            "mask": mask,
            "cuts": list(cuts),
            **texr.ABSENT,
            **{k: 1 + numbers[p] for k in texr.PLANES if (p := getattr(self, k)) is not None},
            **({} if self.copies is None else self.copies.fields),
            "unmix": int(bool(cuts and self.cuts and self.cuts.own and self.cuts.unmix)),
        }

    @cached_property
    def shown(self) -> Samples | None:
        """Samples of the part that show if nothing has moved, bool [height, width]; None = all."""
        if self.cuts is None and self.mask is None and self.matte is None:
            return None
        own = self.cuts is not None and self.cuts.own is not None
        shown = self._present if own else self._present & ~self.soft
        return None if shown.all() else shown

    @property
    def _present(self) -> Samples:
        """Samples that show if nothing has moved, whether they are soft or not [PYR-41]."""
        if self.cuts is not None:
            return self.cuts.shown
        if self.mask is not None:
            return _samples(self.mask, self.cell, self.part)
        return np.ones(self.part[:1:-1], np.bool_)

    @cached_property
    def soft(self) -> Samples:
        """Samples that have the alpha of the matte where they do not show, bool [height, width].

        Raises:
            FormatError: The support of the matte is corrupt.
        """
        return np.zeros(self.part[:1:-1], np.bool_) if self.matte is None else self.matte.stored

    def kept(self, moved: Moved) -> Samples | None:
        """Samples of the part that show when neighbours moved, bool [height, width]; None = all.

        Soft ones near others behind which something has moved do not [PYR-53].
        """
        if self.cuts is None or moved == ALL_IN_PLACE:
            return self.shown
        return self.cuts.seen(moved) if self.matte is None else _seen(self, moved)

    @kernel.Computed
    def filled(self) -> NDArray[np.uint16]:
        """Samples of the part: trusted ones, and what is behind, copied or filled for the others.

        uint16 [height * width, C] in 1/`FILL_ONE`, where C counts the components of colour, the
        most that `planes` and `behind` have, and alpha as the last one. Only defined if not all
        samples show.

        Raises:
            FormatError: The planes are corrupt.
        """
        trusted = self._present if self.cuts is None else self.cuts.trusted
        values, known = self.known(trusted & ~self.soft)
        if self.copies is not None:
            values, known = completed(values, known, self.copies)
        out = diffused(values, known).astype(np.uint16)
        return np.ascontiguousarray(np.moveaxis(out, 0, 2)).reshape(-1, len(out))

    def known(self, trusted: Samples) -> tuple[Values, Samples]:
        """Samples that are known before any is copied or filled [PYR-42, PYR-47].

        Args:
            trusted: bool [height, width], True for trusted samples.

        Returns:
            int32 [C, height, width] samples in 0..`FILL_ONE`, and bool [height, width], True for
            known ones.
        """
        x, y, width, height = self.part
        colours = max(p.components for p in (self.planes, self.behind) if p is not None)

        def fixed(colour: Planes, alpha: Planes | None, x: int, y: int) -> Values:
            count = colours + (self.alpha is not None)
            out = np.full((count, height, width), FILL_ONE, np.int32)
            for planes, at in ((colour, slice(colours)), (alpha, slice(colours, count))):
                if planes is not None:
                    part = planes.raster[y : y + height, x : x + width]
                    out[at] = np.rint(np.moveaxis(part, 2, 0) * np.float32(FILL_ONE))
            return out

        values = fixed(self.planes, self.alpha, x, y)
        if self.behind is None:
            return values, trusted
        cells, side = self.behind.support, self.behind.packed["cell"]
        stored = _samples(cells, side, self.part)
        own = fixed(self.behind, self.behind_alpha, 0, 0)
        return np.where(stored & ~trusted, own, values), stored | trusted

    def sample(
        self,
        x: NDArray[np.float64],
        y: NDArray[np.float64],
        box: Box,
        moved: Moved = ALL_IN_PLACE,
        native: bool = False,
        window: Window | None = None,
        seen: bool = False,
    ) -> Floats:
        """Interpolates the texture at points.

        A point that lies on a sample takes its value. Others are interpolated by cubic convolution
        with a = -1/2 (Keys 1981, "Cubic Convolution Interpolation for Digital Image Processing").

        Args:
            x: float64 [N] x of the texture points in canvas pixels.
            y: float64 [N] y of the texture points.
            box: Rectangle of the layer in canvas pixels.
            moved: Neighbours that have moved relative to the layer.
            native: Whether to use the compiled kernel.
            window: Samples of the part that hold all points, and those that points of later calls
                are interpolated from; by default all.
            seen: Whether what hides samples hides these points, too: then all that are asked for
                and lie on samples show.

        Returns:
            float32 [N, `channels`] premultiplied colour, and alpha if there is any, not clamped.

        Raises:
            FormatError: The planes are corrupt.
        """
        column, fx = sampling.position(x, box[0], box[2], self.part[2])
        row, fy = sampling.position(y, box[1], box[3], self.part[3])
        if not (fx.any() or fy.any()):
            return self._samples(row, column, moved, seen)
        window = window or Window.whole((self.part[3], self.part[2]))
        padded = self.padded(moved, window)
        return sampling.interpolated(padded, row - window.top, column - window.left, fx, fy, native)

    def padded(self, moved: Moved, window: Window | None = None) -> Floats:
        """Samples of the part, premultiplied and filled, with a border for interpolation.

        Args:
            moved: Neighbours that have moved relative to the layer.
            window: The samples; by default all of the part.

        Returns:
            float32 [height + 3, width + 3, `channels`] of the window; one sample more before, and
            two behind, where the edge of the part is repeated.

        Raises:
            FormatError: The planes are corrupt.
        """
        _, _, width, height = self.part
        window = window or Window.whole((height, width))
        found = self._last.get((moved, window))
        if found is None:
            rows, columns = (
                np.clip(np.arange(start - 1, stop + 2), 0, n - 1).astype(np.intp)
                for start, stop, n in (
                    (window.top, window.bottom, height), (window.left, window.right, width),
                )
            )  # fmt: skip
            found = np.empty((len(rows), len(columns), self.channels(())), np.float32)
            for row, out in zip(rows, found, strict=True):
                out[:] = self._samples(np.full_like(columns, row), columns, moved)
            # `moved` stays the same while a layer is dragged, so keeping the last one is enough.
            self._last.clear()
            self._last[moved, window] = found
        return found

    @kernel.Computed
    def _last(self) -> dict[tuple[Moved, Window], Floats]:
        return {}

    def _samples(
        self, row: NDArray[np.intp], column: NDArray[np.intp], moved: Moved, seen: bool = False
    ) -> Floats:
        """Premultiplied samples [N, `channels`] at rows and columns [N], filled and unmixed."""
        x, y, width, _ = self.part
        kept, soft = None if seen and self.matte is None else self.kept(moved), None
        window = Window(
            int(row.min()) + y, int(row.max()) + y + 1,
            int(column.min()) + x, int(column.max()) + x + 1,
        )  # fmt: skip
        at = (row + y) * self.planes.size[0] + (column + x)
        colour, alpha = (
            None if p is None else p.samples(window).reshape(-1, p.components).take(at, 0)
            for p in (self.planes, self.alpha)
        )  # fmt: skip
        assert colour is not None
        if colour.shape[1] == 1:
            colour = colour.repeat(3, 1)
        if kept is not None:
            place = row * width + column
            outside = np.flatnonzero(~kept.ravel().take(place))
            if len(outside):
                fill = self.filled.take(place[outside], 0) * np.float32(1 / FILL_ONE)
                colours = fill.shape[1] - (alpha is not None)
                colour[outside] = fill[:, :colours]
                if alpha is not None:
                    alpha[outside] = fill[:, -1:]
                soft = outside[self.soft.ravel().take(place[outside])]
            if self.cuts and (edge := rim(self.planes, self.alpha, self.part, self.cuts, moved)):
                edge.put(place, colour, alpha)
        if self.matte is not None:
            alpha = np.ones((len(colour), 1), np.float32) if alpha is None else alpha
            if soft is not None and len(soft):
                alpha[soft] *= self.matte.raster.reshape(-1, 1).take(place[soft], 0)
        return colour if alpha is None else np.concatenate([colour * alpha, alpha], axis=1)


Texture = ImplicitTexture | PyramidTexture


@lru_cache(maxsize=16)
def _seen(view: PyramidTexture, moved: Moved) -> Samples:
    """Computes `PyramidTexture.kept` of a view with cuts and a matte."""
    assert view.cuts is not None, "other views are simpler"
    return view.cuts.seen(moved) & ~(view.soft & view.cuts.loose(moved))


def _samples(mask: NDArray[np.bool_], cell: int, part: Box) -> Samples:
    """Samples of a part, bool [height, width], that lie in the cells of a mask."""
    _, _, width, height = part
    return mask.repeat(1 << cell, 0)[:height].repeat(1 << cell, 1)[:, :width]


def unpack(
    fields: Mapping[str, Any],
    planes: Sequence[Planes],
    where: str = "chunk TEXR",
    cuts: Occlusion | None = None,
) -> PyramidTexture:
    """Decodes a pyramid texture.

    Args:
        fields: Values of TEXR.
        planes: All planes of the file.
        where: Name of the chunk in error messages.
        cuts: Boundaries that cut the view, without the mask; or None.

    Raises:
        FormatError: The mask or the sources are corrupt; the mask is full or empty.
    """
    x, y, width, height = part = fields["part"]
    mask = None
    if fields["mask"]:
        shape = texr.cells_shape(fields)
        mask = arrays.decode(fields["mask"], (1, *shape), 1, np.ones(shape, bool))[0].astype(bool)
        if mask.all() or not mask.any():
            raise FormatError("the mask of the view is full or empty", where, rule="PYR-39")
        if cuts is not None:
            cuts = replace(cuts, within=_samples(mask, fields["cell"], part))
    alpha, behind, behind_alpha, matte = (
        planes[fields[key] - 1] if fields[key] else None for key in texr.PLANES
    )
    texture = PyramidTexture(
        planes[fields["planes"]], alpha, (x, y, width, height), fields["cell"], mask, cuts,
        behind, behind_alpha, unpacked_copies(fields, where), matte,
    )  # fmt: skip
    texture.__dict__["coded_mask"] = fields["mask"]
    return texture

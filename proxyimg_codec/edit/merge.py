"""Operation that makes one layer of two that show the same planes, or codes of the same grid.

Nothing is encoded anew. Where one layer holds the other, its boundary stays to the bit, so that
merging undoes a cut. Two that lie apart keep the paths of both; otherwise their union is traced.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..errors import UsageError
from ..geometry import coverage as cover
from ..geometry import mesher
from ..geometry.boundary import Boundary
from ..geometry.pose import OPACITY_MAX
from ..model import Layer, Picture
from ..render.neighbours import present_outline
from ..texture.implicit import Box, ImplicitTexture
from ..texture.occlusion import Occlusion
from ..texture.pyramid import PyramidTexture, Texture
from .operations import changed, layer_named, operation
from .regions import Bools, coverage, extent, traced, united, within
from .structure import ONE, check_acyclic

FINE = 4
"""Points across and down a pixel of the grid on which a union is traced."""

FINE_PIXELS = 1 << 20
"""Most pixels of a union that is traced on this grid; larger ones are traced along pixels."""


@operation("merge", layer=ONE, other="layer: the layer that becomes a part of it")
def merge(picture: Picture, layer: str | int, other: str | int) -> Picture:
    """Makes one layer of two that show the same planes or codes; it has the name of the first.

    Raises:
        UsageError: The layers have textures of their own, are not in the same place, or others lie
            between them; the message says what to do.
    """
    one, two = layer_named(picture, layer), layer_named(picture, other)
    if one is two:
        raise UsageError(f"merge: {one.name!r} is given twice; name two layers")
    low, high = sorted((one, two), key=lambda v: _index(picture.layers, v))
    _check(low, high)
    place = _place(picture, low, high)
    rest = [v for v in picture.layers if v not in (one, two)]
    holder, boundary = _union(picture, low, high)
    texture = _joined(low, high, holder, boundary, [v.boundary for v in rest[place:]])
    mesh = holder.mesh if holder else low.mesh or high.mesh
    if mesh is not None and holder is None:
        mesh = mesher.derived(boundary, picture.size)
    merged = replace(
        low,
        name=one.name,
        box=low.box if isinstance(texture, ImplicitTexture) else united(low.box, high.box),
        boundary=boundary,
        texture=texture,
        mesh=mesh,
        parent=two.parent if one.parent == two.name else one.parent,
    )
    gone = [v.boundary for v in (low, high) if v.boundary is not None]
    behind = _recut(rest[:place], gone, boundary)
    layers = [*behind, merged, *_recut(rest[place:], gone, None)]
    if merged.parent == merged.name:
        layers[place] = replace(merged, parent=None)

    def parent(above: str | None) -> str | None:
        return one.name if above == two.name else above

    layers = [v if v.name == one.name else replace(v, parent=parent(v.parent)) for v in layers]
    groups = {name: parent(above) for name, above in picture.groups.items()}
    result = changed(picture, layers, groups=groups)
    check_acyclic(result, "merge")
    return result


def _index(layers: Sequence[Layer], layer: Layer) -> int:
    return next(i for i, v in enumerate(layers) if v is layer)


def _check(low: Layer, high: Layer) -> None:
    """Refuses layers that cannot be drawn as one.

    Raises:
        UsageError: They cannot.
    """
    said = f"merge: {low.name!r} and {high.name!r}"
    group = f"--group NAME={low.name},{high.name} edits them as one"
    for layer in (low, high):
        pose = layer.pose
        if pose.nodes is not None or pose.places is not None or layer.track is not None:
            raise UsageError(f"{said}: {layer.name!r} is bent or moves; {group}")
        if pose.opacity != OPACITY_MAX:
            raise UsageError(f"{said}: {layer.name!r} is translucent; set its opacity after")
        if layer.sampling:
            raise UsageError(f"{said}: {layer.name!r} has its features at its own nodes; {group}")
    one, two = (
        (v.pose.matrix, v.pose.shift, v.pose.hidden, v.pose.colour) for v in (low, high)
    )  # fmt: skip
    if one[:2] != two[:2]:
        raise UsageError(
            f"{said} have been moved apart; move one back (--list shows edits, --undo takes them "
            f"back), or {group}"
        )
    if one != two:
        raise UsageError(f"{said} differ in colour, or one is hidden; make them alike, or {group}")
    if not _alike(low, high):
        raise UsageError(
            f"{said} have textures of their own, which cannot be joined without encoding anew; "
            f"{group}"
        )


def _alike(low: Layer, high: Layer) -> bool:
    """Whether both layers show the same planes in the same place, or codes of the same grid."""
    one, two = low.texture, high.texture
    if isinstance(one, PyramidTexture) and isinstance(two, PyramidTexture):
        start, other = (
            (t.part[0] - v.box[0], t.part[1] - v.box[1]) for t, v in ((one, low), (two, high))
        )
        plain = all(t.part[2:] == v.box[2:] for t, v in ((one, low), (two, high)))
        return one.planes is two.planes and one.alpha is two.alpha and plain and start == other
    if isinstance(one, ImplicitTexture) and isinstance(two, ImplicitTexture):
        same = (one.network, one.bits, one.grid, low.box) == (
            two.network, two.bits, two.grid, high.box
        )  # fmt: skip
        if not same or not np.array_equal(one.steps, two.steps):
            return False
        both = one.stored & two.stored
        return bool((one.codes[:, both] == two.codes[:, both]).all())
    return False


def _place(picture: Picture, low: Layer, high: Layer) -> int:
    """Position of the merged layer among the others.

    It is that of the lower one if nothing in between overlaps the upper one, which sinks; or else
    that of the upper one.

    Raises:
        UsageError: Layers in between overlap both.
    """
    first, last = (_index(picture.layers, v) for v in (low, high))
    between = picture.layers[first + 1 : last]
    canvas = 0, 0, *picture.size

    def shown(layer: Layer) -> Bools:
        return np.asarray(coverage(present_outline(picture, layer), canvas) > 0)

    for layer, place in ((high, first), (low, last - 1)) if between else ():
        own = shown(layer)
        if not any((own & shown(v)).any() for v in between):
            return place
    if between:
        names = ", ".join(repr(v.name) for v in between)
        raise UsageError(
            f"merge: {names} between {low.name!r} and {high.name!r} would be hidden or bared; put "
            "the two next to each other first (--order)"
        )
    return first


def _union(picture: Picture, low: Layer, high: Layer) -> tuple[Layer | None, Boundary | None]:
    """Boundary of two layers together, and the layer whose boundary it is, if it is one's own."""
    box = united(*(extent(v.boundary, picture.size) for v in (low, high)))
    one, two = coverage(low.boundary, box), coverage(high.boundary, box)
    for layer, outer, inner in ((low, one, two), (high, two, one)):
        if (outer[inner > 0] == cover.FULL).all():
            return layer, layer.boundary
    assert low.boundary is not None, "the canvas holds all"
    assert high.boundary is not None, "the canvas holds all"
    if not ((one > 0) & (two > 0)).any():
        unit = max(low.boundary.unit, high.boundary.unit)
        paths = (p << (unit - b.unit) for b in (low.boundary, high.boundary) for p in b.paths)
        return None, Boundary(unit, tuple(paths))
    scale = FINE if box[2] * box[3] <= FINE_PIXELS else 1
    half = cover.FULL // 2
    inside = [coverage(v.boundary, box, scale) >= half for v in (low, high)]
    return None, traced(inside[0] | inside[1], box, scale)


def _joined(
    low: Layer, high: Layer, holder: Layer | None, boundary: Boundary | None,
    fronts: Sequence[Boundary | None],
) -> Texture:  # fmt: skip
    """Texture of the merged layer.

    Args:
        low: The layer behind.
        high: The layer in front.
        holder: That of the two which holds the other, if one does.
        boundary: Boundary of the merged layer.
        fronts: Boundaries of the layers in front of it.
    """
    one, two = low.texture, high.texture
    if isinstance(one, ImplicitTexture):
        assert isinstance(two, ImplicitTexture), "`_alike` says so"
        codes = np.where(two.stored, two.codes, one.codes)
        return replace(one, codes=codes, stored=one.stored | two.stored)
    assert isinstance(two, PyramidTexture), "`_alike` says so"
    box = united(low.box, high.box)
    part = one.part[0] + box[0] - low.box[0], one.part[1] + box[1] - low.box[1], *box[2:]
    cell, mask = _mask(low, high, box)
    cuts = {v: v.texture.cuts for v in (low, high) if isinstance(v.texture, PyramidTexture)}
    known = {front for each in cuts.values() if each for front in each.fronts}
    deciding = [cuts[v] for v in ([holder] if holder else cuts)]
    own = boundary if any(each and each.own for each in deciding) else None
    left = tuple(front for front in dict.fromkeys(fronts) if front in known and front is not None)
    base = two if holder is high else one
    unmix = base.matte is None
    new = Occlusion(own, left, box, within(mask, cell, part), unmix) if own or left else None
    hidden = [(v.behind, v.behind_alpha, v.copies, v.matte) for v in (one, two)]
    if part == base.part and (holder is not None or hidden[0] == hidden[1]):
        return replace(base, cell=cell, mask=mask, cuts=new)
    if any(any(own) for own in hidden):
        raise UsageError(
            f"merge: what others hide of {low.name!r} or {high.name!r} is stored beside the planes "
            f"and cannot be joined; --group NAME={low.name},{high.name} edits them as one"
        )
    return PyramidTexture(one.planes, one.alpha, part, cell, mask, new)


def _mask(low: Layer, high: Layer, box: Box) -> tuple[int, Bools | None]:
    """Cell and mask of the view of two layers: that of the one in front where it has coverage."""
    samples = np.ones((box[3], box[2]), np.bool_)
    over = coverage(high.boundary, box) > 0
    cells = {0}
    for layer, there in ((low, ~over), (high, over)):
        texture = layer.texture
        assert isinstance(texture, PyramidTexture), "`_alike` says so"
        own = within(texture.mask, texture.cell, texture.part)
        if own is not None:
            x, y, w, h = layer.box[0] - box[0], layer.box[1] - box[1], *layer.box[2:]
            at = slice(y, y + h), slice(x, x + w)
            samples[at] &= own | ~there[at]
            cells.add(texture.cell)
    if samples.all():
        return 0, None
    for cell in sorted(cells, reverse=True):
        mask = samples[:: 1 << cell, :: 1 << cell]
        whole = within(mask, cell, (0, 0, *box[2:]))
        if whole is not None and np.array_equal(whole, samples):
            break
    return cell, mask


def _recut(
    layers: Sequence[Layer], gone: Sequence[Boundary], boundary: Boundary | None
) -> list[Layer]:
    """Layers whose views are cut by a new boundary instead of some that are gone.

    Args:
        layers: Layers, all behind or all in front of what is new.
        gone: The boundaries that are gone.
        boundary: The new boundary in front of the layers; None if there is none.
    """
    new: dict[Texture, Texture] = {}
    for layer in layers:
        texture = layer.texture
        if isinstance(texture, PyramidTexture) and texture.cuts is not None:
            cuts = texture.cuts
            kept = [front for front in cuts.fronts if front not in gone]
            if boundary is not None and len(kept) < len(cuts.fronts):
                kept.append(boundary)
            if list(cuts.fronts) != kept:
                left = replace(cuts, fronts=tuple(kept)) if kept or cuts.own else None
                new[texture] = replace(texture, cuts=left)
    return [
        replace(v, texture=new[v.texture]) if v.texture in new else v for v in layers
    ]  # fmt: skip

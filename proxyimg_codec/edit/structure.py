"""Operations on the stack of layers: removal, copies, names, order, groups and parents."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ..errors import UsageError
from ..model import Layer, Picture
from ..texture.implicit import Box
from ..texture.pyramid import PyramidTexture, Texture
from .operations import (
    changed,
    checked_name,
    free_name,
    layer_named,
    operation,
    parents,
    shown_together,
    substituted,
)
from .regions import extent
from .transforms import TARGET

ONE = "layer: a layer's name or position"


@operation("remove", layer=TARGET)
def remove(picture: Picture, layer: str | int) -> Picture:
    """Removes a layer, or a group with its layers; what they hid shows."""
    gone = {v.name for v in shown_together(picture, layer)}
    if isinstance(layer, str) and layer in picture.groups:
        gone |= {name for name in picture.groups if _within(picture, name, layer)}
    return _without(picture, _bared(picture, gone), gone)


def _bared(picture: Picture, gone: set[str]) -> list[Layer]:
    """Layers without those that are gone; soft ones in front of one are soft for ever.

    Their raster at rest has its colours mixed in, and a file does not tell that it was there.
    """
    new: dict[Texture, Texture] = {}
    for i, layer in enumerate(picture.layers):
        view = layer.texture
        if not isinstance(view, PyramidTexture) or view.matte is None or view.cuts is None:
            continue
        behind = (v for v in picture.layers[:i] if v.name in gone)
        if any(_meet(extent(v.boundary, picture.size), view.cuts.box) for v in behind):
            cuts = replace(view.cuts, own=None) if view.cuts.fronts else None
            new[view] = replace(view, cuts=cuts)
    return [
        replace(v, texture=new.get(v.texture, v.texture))
        for v in picture.layers
        if v.name not in gone
    ]


def _meet(one: Box, other: Box) -> bool:
    """Whether two rectangles x, y, width, height have a pixel in common."""
    return all(
        max(one[k], other[k]) < min(one[k] + one[k + 2], other[k] + other[k + 2]) for k in (0, 1)
    )


def _without(picture: Picture, layers: Sequence[Layer], gone: set[str]) -> Picture:
    """Picture without some layers and groups; what followed them follows their parents."""
    above = parents(picture)

    def parent(name: str) -> str | None:
        node = above[name]
        while node in gone:
            node = above[node]
        return node

    groups = {name: parent(name) for name in picture.groups if name not in gone}
    return changed(picture, [replace(v, parent=parent(v.name)) for v in layers], groups=groups)


def _within(picture: Picture, name: str, group: str) -> bool:
    """Whether the group or layer `name` is `group` or lies in it, at any depth."""
    above = parents(picture)
    node: str | None = name
    while node is not None and node != group:
        node = above[node]
    return node == group


@operation("duplicate", layer=ONE, name="text?: the copy's name")
def duplicate(picture: Picture, layer: str | int, name: str | None = None) -> Picture:
    """Copies a layer, in front of it; both share one texture."""
    chosen = layer_named(picture, layer)
    if name is None:
        name = free_name(picture, f"{chosen.name} copy")
    copy = replace(chosen, name=checked_name(picture, name))
    layers = list(picture.layers)
    layers.insert(_position(picture, chosen) + 1, copy)
    return changed(picture, layers)


def _position(picture: Picture, layer: Layer) -> int:
    """Position of a layer from the back."""
    return next(i for i, v in enumerate(picture.layers) if v is layer)


@operation("rename", layer=TARGET, name="text: a name that is free")
def rename(picture: Picture, layer: str | int, name: str) -> Picture:
    """Gives a layer or group another name."""
    old = layer if layer in picture.groups else layer_named(picture, layer).name
    checked_name(picture, name)

    def renamed(value: str | None) -> str | None:
        return name if value == old else value

    layers = [
        replace(v, name=name if v.name == old else v.name, parent=renamed(v.parent))
        for v in picture.layers
    ]
    groups = {name if k == old else k: renamed(v) for k, v in picture.groups.items()}
    return changed(picture, layers, groups=groups)


@operation("order", layer=ONE,
           to="place: a position from the back, or front, back, forward, backward")  # fmt: skip
def order(picture: Picture, layer: str | int, to: int | str) -> Picture:
    """Puts a layer elsewhere in the stack; `back` is just in front of an opaque back layer."""
    chosen = layer_named(picture, layer)
    last, now = len(picture.layers) - 1, _position(picture, chosen)
    bottom = 1 if picture.opaque and now > 0 else 0
    places = {
        "front": last, "back": bottom,
        "forward": min(now + 1, last), "backward": max(now - 1, bottom),
    }  # fmt: skip
    place = to if isinstance(to, int) else places.get(to)
    if place is None or not 0 <= place <= last:
        raise UsageError(f"order: {to!r} is neither 0..{last} nor one of {', '.join(places)}")
    layers = [v for v in picture.layers if v is not chosen]
    layers.insert(place, chosen)
    return changed(picture, layers)


@operation("group", layers="layers: names or positions of layers, or names of groups",
           name="text: the group's name; one that exists grows")  # fmt: skip
def group(picture: Picture, layers: Sequence[str | int], name: str) -> Picture:
    """Puts layers and groups into a group, which is edited as one."""
    groups = dict(picture.groups)
    if name not in groups:
        groups[checked_name(picture, name)] = None
    inner = [v if v in picture.groups else layer_named(picture, v).name for v in layers]
    for each in inner:
        if each in groups:
            if each == name or (name in picture.groups and _within(picture, name, str(each))):
                raise UsageError(f"group: {each!r} would become a part of itself")
            groups[str(each)] = name
    new = [replace(v, parent=name) if v.name in inner else v for v in picture.layers]
    result = changed(picture, new, groups=groups)
    check_acyclic(result, "group")
    return result


@operation("ungroup", name="text: a group")
def ungroup(picture: Picture, name: str) -> Picture:
    """Dissolves a group; its layers stay."""
    if name not in picture.groups:
        raise UsageError(f"ungroup: there is no group {name!r}")
    return _without(picture, list(picture.layers), {name})


@operation("parent", layer=TARGET, to="layer: a layer or group that it follows; empty for none")
def parent(picture: Picture, layer: str | int, to: str) -> Picture:
    """Lets a layer or group follow another one."""
    if to and to not in parents(picture):
        raise UsageError(f"parent: there is no layer or group {to!r}")
    above = to or None
    if layer in picture.groups:
        groups = {**picture.groups, str(layer): above}
        result = changed(picture, list(picture.layers), groups=groups)
    else:
        result = substituted(picture, [replace(layer_named(picture, layer), parent=above)])
    check_acyclic(result, "parent")
    return result


def check_acyclic(picture: Picture, what: str) -> None:
    """Refuses a tree in which a group or layer is part of itself.

    Raises:
        UsageError: There is such a group or layer.
    """
    above = parents(picture)
    for name in above:
        seen, node = set(), above[name]
        while node is not None:
            if node == name or node in seen:
                raise UsageError(f"{what}: {name!r} would become a part of itself")
            seen.add(node)
            node = above[node]

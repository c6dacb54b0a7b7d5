"""Registry of the edit operations, and functions that all of them share.

An operation is data: a JSON object with the key ``op`` and parameters. Its function takes a picture
and returns another; the original is never changed.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..codec.write import state
from ..container.undo import Step
from ..errors import UsageError
from ..geometry.pose import OPACITY_MAX
from ..io import json_schema
from ..model import Layer, Layers, Picture
from ..render.neighbours import settled
from ..texture.network import Network
from .positions import Positions

NAME_MAX = 200

NUMBER_MAX = 1e12
"""Largest magnitude of a number, so that products of a few do not overflow."""

HANDLES_MAX = 500
"""Most handles of a drag; its time grows with their cube, and these take some seconds."""

NUMBER = {"type": "number", "minimum": -NUMBER_MAX, "maximum": NUMBER_MAX}


def _numbers(count: int) -> dict[str, Any]:
    """JSON schema of a list of `count` numbers."""
    return {"type": "array", "items": NUMBER, "minItems": count, "maxItems": count}


KINDS: dict[str, dict[str, Any]] = {
    "layer": {"type": ["string", "integer"]},
    "foreign": {"type": ["string", "integer"]},
    "layers": {"type": "array", "items": {"type": ["string", "integer"]}, "minItems": 1},
    "number": NUMBER,
    "integer": {"type": "integer"},
    "place": {"type": ["integer", "string"]},
    "pair": _numbers(2),
    "pairs": {"type": "array", "items": _numbers(2), "minItems": 1, "maxItems": HANDLES_MAX},
    "matrix": _numbers(6),
    "colours": _numbers(12),
    "handles": {
        "type": "array",
        "items": _numbers(4),
        "minItems": 1,
        "maxItems": HANDLES_MAX,
    },
    "text": {"type": "string", "pattern": r"^[^\0]*$"},
    "flag": {"type": "boolean"},
    "axis": {"enum": ["horizontal", "vertical"]},
    "fit": {"enum": ["box", "shape"]},
    "completion": {"enum": ["exemplar", "smooth"]},
    "weighting": {"enum": ["sds", "uniform"]},
    "precision": {"enum": ["full", "half", "bfloat"]},
    "colour": {"type": "string", "pattern": "^#[0-9a-fA-F]{6}$"},
    "motion": {"type": "object"},
}
"""JSON schema of each kind of parameter, by the name of the kind. A `layer` is one of the picture,
or a group; a `foreign` one is that of another file."""


@dataclass(frozen=True)
class Parameter:
    """Parameter of an operation.

    Attributes:
        kind: Key of `KINDS`.
        needed: Whether it must be given.
        meaning: Description, a phrase.
    """

    kind: str
    needed: bool
    meaning: str


@dataclass(frozen=True)
class Operation:
    """Edit operation.

    Attributes:
        apply: Function from a picture and the parameters to the edited picture.
        parameters: Parameters by name.
        meaning: Description, a sentence.
    """

    apply: Callable[..., Picture]
    parameters: Mapping[str, Parameter]
    meaning: str


OPERATIONS: dict[str, Operation] = {}


def operation(name: str, /, **parameters: str) -> Callable[[Callable[..., Picture]], Any]:
    """Registers a function as operation `name`; the first line of its docstring is its meaning.

    Args:
        name: Name of the operation.
        **parameters: ``kind: meaning`` of each parameter; a kind that ends in ``?`` is optional.
    """
    known = {}
    for key, text in parameters.items():
        kind, _, meaning = text.partition(": ")
        known[key] = Parameter(kind.rstrip("?"), not kind.endswith("?"), meaning)

    def register(function: Callable[..., Picture]) -> Callable[..., Picture]:
        OPERATIONS[name] = Operation(function, known, (function.__doc__ or "").splitlines()[0])
        return function

    return register


def run(
    picture: Picture, values: Mapping[str, Any], positions: Positions
) -> tuple[Picture, Positions]:
    """Applies one operation to a picture, and adds it to the history, with names for positions.

    Args:
        picture: The picture.
        values: The operation: its name under ``op``, and its parameters.
        positions: What positions of layers mean.

    Returns:
        The picture after the operation, and what positions mean in the next one.

    Raises:
        UsageError: The operation is unknown, has wrong parameters, or cannot be done.
    """
    name = values.get("op") if isinstance(values, Mapping) else None
    if not isinstance(name, str) or name not in OPERATIONS:
        raise UsageError(f"operation {name!r} is unknown; there are {', '.join(OPERATIONS)}")
    chosen = OPERATIONS[name]
    given = {k: _plain(v) for k, v in values.items() if k != "op"}
    for key in given:
        if key not in chosen.parameters:
            known = ", ".join(chosen.parameters)
            raise UsageError(f"{name}: parameter {key!r} is unknown; there are {known}")
    for key, parameter in chosen.parameters.items():
        if key in given and not _fits(given[key], parameter.kind):
            value = repr(given[key])
            shown = value if len(value) <= 80 else f"{value[:77]}..."
            raise UsageError(f"{name}: {key} is {shown}; it must be {parameter.meaning}")
        if key not in given and parameter.needed:
            raise UsageError(f"{name}: {key} is missing; it must be {parameter.meaning}")
    for key, value in given.items():
        if chosen.parameters[key].kind == "layer":
            given[key] = positions.name(value)
        elif chosen.parameters[key].kind == "layers":
            given[key] = [positions.name(v) for v in value]
    result = chosen.apply(picture, **given)
    edit = {"op": name, **given}
    text = json.dumps(edit, ensure_ascii=False)
    # Names of files may have surrogates, which UTF-8 cannot encode; as escapes they are valid JSON.
    step = Step(text.encode(errors="backslashreplace").decode(), state(picture))
    result = replace(result, history=(*picture.history, step))
    return result, positions.after(edit, result)


def _plain(value: Any) -> Any:
    """Converts numpy numbers and arrays in a value to Python's."""
    if isinstance(value, (list, tuple)):
        return [_plain(v) for v in value]
    return value.tolist() if isinstance(value, (np.generic, np.ndarray)) else value


def _fits(value: Any, kind: str) -> bool:
    """Whether a value is of a kind; an integer must not be given as floating point, such as 2.0."""
    try:
        json_schema.check(value, KINDS[kind], whole_floats=False)
    except UsageError:
        return False
    return True


def layer_named(picture: Picture, name: str | int) -> Layer:
    """Layer with a name or at a position.

    Raises:
        UsageError: There is no such layer, or it is a group.
    """
    if isinstance(name, str) and name in picture.groups:
        raise UsageError(f"{name!r} is a group; this works on single layers")
    return picture.layers[name]


def members(picture: Picture, name: str | int) -> list[Layer]:
    """Layers of a group, or a layer, and all layers that follow them, back to front.

    Raises:
        UsageError: There is no such layer or group, or the group is empty.
    """
    above = parents(picture)
    root = (
        name
        if isinstance(name, str) and name in picture.groups
        else layer_named(picture, name).name
    )

    def below(node: str | None) -> bool:
        while node is not None and node != root:
            node = above[node]
        return node is not None

    found = [layer for layer in picture.layers if below(layer.name)]
    if not found:
        raise UsageError(f"group {name!r} has no layers")
    return found


def shown_together(picture: Picture, name: str | int) -> list[Layer]:
    """Layers whose appearance changes together: those of a group, or a single layer.

    Raises:
        UsageError: There is no such layer or group, or the group is empty.
    """
    group = isinstance(name, str) and name in picture.groups
    return members(picture, name) if group else [layer_named(picture, name)]


def parents(picture: Picture) -> dict[str, str | None]:
    """Parent of every layer and group, by name; None for none."""
    return {**{layer.name: layer.parent for layer in picture.layers}, **picture.groups}


def substituted(picture: Picture, layers: Iterable[Layer]) -> Picture:
    """Picture in which some layers are replaced by layers of the same names."""
    new = {layer.name: layer for layer in layers}
    return changed(picture, [new.get(layer.name, layer) for layer in picture.layers])


def changed(
    picture: Picture,
    layers: Sequence[Layer],
    *,
    groups: Mapping[str, str | None] | None = None,
    networks: Sequence[Network] | None = None,
) -> Picture:
    """Picture with other layers, groups or networks; everything that depends on them is updated.

    Networks at the end that no layer uses any more are dropped. Ancillary chunks that are not safe
    to copy are dropped, too.

    Args:
        picture: The picture before.
        layers: All layers after, back to front.
        groups: Parents of groups by name; those of `picture` by default.
        networks: Decoder networks; those of `picture` by default.

    Raises:
        UsageError: No layer is left.
    """
    if not layers:
        raise UsageError("this would remove the last layer; a picture needs one")
    kept = list(picture.networks if networks is None else networks)
    used = {layer.texture.network for layer in layers}
    # Networks that no layer used before the edit either are kept: they are not the edit's matter.
    before = {layer.texture.network for layer in picture.layers}
    while (last := len(kept) - 1) not in used and (last in before or last >= len(picture.networks)):
        kept.pop()
    return replace(
        picture,
        layers=Layers(settled(layers)),
        networks=tuple(kept),
        channels=max(picture.channels, *(v.texture.channels(kept) for v in layers)),
        opaque=picture.opaque if layers[0] is picture.layers[0] else _covers(layers[0], kept),
        groups=picture.groups if groups is None else groups,
        timeline=picture.timeline if any(v.track for v in layers) else None,
        info=_info(picture, layers),
        extra=tuple(chunk for chunk in picture.extra if chunk.safe_to_copy),
    )


def _covers(back: Layer, networks: Sequence[Network]) -> bool:
    """Whether a back layer covers the whole canvas and is opaque."""
    still = back.boundary is None and not back.pose.affine and back.pose.nodes is None
    still = still and back.track is None
    visible = back.pose.opacity == OPACITY_MAX and not back.pose.hidden
    return still and visible and back.texture.channels(networks) == 3


def _info(picture: Picture, layers: Sequence[Layer]) -> Mapping[str, Any] | None:
    """Values of iNFO with an area for each layer; a copy of a layer has that of the original."""
    if picture.info is None or not picture.info["areas"]:
        return picture.info
    areas = dict(zip((v.texture for v in picture.layers), picture.info["areas"], strict=True))
    named = dict(zip((v.name for v in picture.layers), picture.info["areas"], strict=True))
    return {
        **picture.info,
        "areas": [named.get(v.name, areas.get(v.texture, 0)) for v in layers],
    }


def free_name(picture: Picture, wanted: str) -> str:
    """Returns `wanted`, with a number appended if a layer or group has that name."""
    taken, name, number = parents(picture), wanted, 2
    while name in taken:
        name = f"{wanted} {number}"
        number += 1
    return name


def checked_name(picture: Picture, name: str) -> str:
    """Checks a new name, and returns it.

    Raises:
        UsageError: The name is taken, empty, too long, or not printable.
    """
    if not 1 <= len(name) <= NAME_MAX or not name.isprintable():
        raise UsageError(f"name {name!r} must have 1..{NAME_MAX} printable characters")
    if name in parents(picture):
        raise UsageError(f"there is a layer or group {name!r} already")
    return name

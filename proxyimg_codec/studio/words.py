"""Edits in words: a label, the flags of pxi-edit, and the line of Python that do the same."""

from __future__ import annotations

import json
import shlex
from collections.abc import Callable, Collection, Mapping
from typing import Any

Edit = Mapping[str, Any]

LABELS = {
    "move": "Move", "rotate": "Turn", "scale": "Scale", "shear": "Shear", "affine": "Transform",
    "flip": "Flip", "drag": "Bend", "point": "Shape", "outlines": "Outlines from a file",
    "remove": "Remove", "duplicate": "Duplicate", "cut": "Cut out of", "merge": "Merge",
    "complete": "Complete", "insert": "Insert", "rename": "Rename", "order": "Reorder",
    "hide": "Hide", "show": "Show", "still": "Still", "opacity": "Opacity of",
    "texture": "Texture of", "generate": "Generate", "recolour": "Recolour", "group": "Group",
    "ungroup": "Ungroup", "parent": "Parent of", "animate": "Animate",
}  # fmt: skip


def label(edit: Any) -> str:
    """Short name of an edit for a list, such as ``Move parrot``."""
    if not isinstance(edit, Mapping):
        return "Edit of another program"
    said = LABELS.get(str(edit.get("op")), str(edit.get("op")))
    about = edit.get("layer", edit.get("name", edit.get("source", "")))
    return f"{said} {about}".strip()


def flags(edit: Any) -> list[str] | None:
    """Words of a command line of pxi-edit for an edit; None if no flag says it."""
    if not isinstance(edit, Mapping):
        return None
    make = _FLAGS.get(str(edit.get("op")))
    try:
        return None if make is None else [f"--{edit['op']}", *make(edit)]
    except (KeyError, TypeError, ValueError, IndexError):
        return None


def command(words: list[str]) -> str:
    """Command line of a shell for words."""
    return shlex.join(words)


def python(edit: Any, groups: Collection[str] = ()) -> str:
    """Python that does an edit, to be written behind the name of an image.

    Args:
        edit: The edit.
        groups: Names of groups, which have no methods.
    """
    make = None
    if isinstance(edit, Mapping) and edit.get("layer") not in groups:
        make = _METHODS.get(str(edit.get("op")))
    try:
        if make is not None:
            return f".layers[{_quoted(edit['layer'])}].{make(edit)}"
    except (KeyError, TypeError, ValueError, IndexError):
        pass
    return f".edited({edit!r})"


def _quoted(text: Any) -> str:
    return json.dumps(text, ensure_ascii=False)


def _number(value: float) -> str:
    """Decimal number that is read as the same floating-point number."""
    return repr(value).removesuffix(".0")


def _numbers(values: Any) -> str:
    return ",".join(map(_number, values))


def _layer(edit: Edit) -> str:
    """Address of a layer on the command line.

    Raises:
        ValueError: A name would be read as something else.
    """
    return _name(edit["layer"])


def _name(name: Any, beside: str = "") -> str:
    """Name on a command line; `beside` are characters that it must not have.

    Raises:
        ValueError: It would be read as something else.
    """
    text = str(name)
    mistaken = text.startswith("-") or (isinstance(name, str) and text.isdecimal())
    if mistaken or any(c in text for c in beside):
        raise ValueError
    return text


def _pivoted(value: str, edit: Edit) -> str:
    return f"{value}@{_numbers(edit['pivot'])}" if "pivot" in edit else value


def _geometry(key: str) -> Callable[[Edit], list[str]]:
    def made(edit: Edit) -> list[str]:
        value = edit[key]
        words = _numbers(value) if isinstance(value, list) else _number(value)
        return [_layer(edit), _pivoted(words, edit)]

    return made


def _flip(edit: Edit) -> list[str]:
    if "pivot" in edit:
        raise ValueError
    return [_layer(edit), edit["axis"]]


def _drag(edit: Edit) -> list[str]:
    return [_layer(edit), *(f"{_numbers(h[:2])}:{_numbers(h[2:])}" for h in edit["handles"])]


def _point(edit: Edit) -> list[str]:
    words = [_layer(edit), f"{edit['path']},{edit['point']}", _numbers(edit["by"])]
    return [*words, "--follow"] if edit.get("follow") else words


def _assigned(key: str) -> Callable[[Edit], list[str]]:
    def made(edit: Edit) -> list[str]:
        value = edit.get(key)
        name = _name(edit["layer"], "=" if value is None else "")
        return [name if value is None else f"{name}={_name(value, '=')}"]

    return made


def _texture(edit: Edit) -> list[str]:
    layer, source = _name(edit["layer"], "="), _name(edit["source"], ":@")
    if edit.get("effort"):
        raise ValueError
    origin = f"{source}:{_name(edit['from_layer'])}" if "from_layer" in edit else source
    return [f"{layer}={origin}" + ("@shape" if edit.get("fit") == "shape" else "")]


def _insert(edit: Edit) -> list[str]:
    if edit.get("effort") or edit.get("name"):
        raise ValueError
    source = _name(edit["source"], ":@=")
    words = f"{source}:{_name(edit['from_layer'], '@')}" if "from_layer" in edit else source
    words += f"@{_numbers(edit['at'])}" if "at" in edit else ""
    if "under" in edit:
        return [f"under:{_name(edit['under'], '=')}={words}"]
    return [f"{_name(edit['over'], '=:')}={words}" if "over" in edit else words]


def _recolour(edit: Edit) -> list[str]:
    if "matrix" in edit:
        raise ValueError
    rest = [k for k in edit if k not in ("op", "layer")]
    changes = [edit[k] if k == "tint" else f"{k}:{_number(edit[k])}" for k in rest]
    return [_layer(edit), ",".join(changes)]


def _cut(edit: Edit) -> list[str]:
    if "name" in edit:
        raise ValueError
    layer = _name(edit["layer"], "=@")
    if "mask" in edit:
        return [f"{layer}={_name(edit['mask'])}"]
    inside = [f"@{_numbers(p)}" for p in edit.get("points", ())]
    return [layer + "".join([*inside, *(f"@!{_numbers(p)}" for p in edit.get("outside", ()))])]


def _group(edit: Edit) -> list[str]:
    names = ",".join(_name(v, ",=") for v in edit["layers"])
    return [f"{_name(edit['name'], '=')}={names}"]


_FLAGS: dict[str, Callable[[Edit], list[str]]] = {
    "move": _geometry("by"), "rotate": _geometry("degrees"), "scale": _geometry("by"),
    "shear": _geometry("by"), "affine": _geometry("matrix"), "opacity": _geometry("value"),
    "flip": _flip,
    "drag": _drag, "point": _point, "outlines": lambda e: [_name(e["source"])],
    "remove": lambda e: [_layer(e)], "complete": _assigned("method"),
    "hide": lambda e: [_layer(e)], "show": lambda e: [_layer(e)], "still": lambda e: [_layer(e)],
    "duplicate": _assigned("name"), "rename": _assigned("name"), "parent": _assigned("to"),
    "cut": _cut, "merge": lambda e: [_layer(e), _name(e["other"])],
    "insert": _insert, "order": lambda e: [_layer(e), str(e["to"])],
    "texture": _texture, "recolour": _recolour, "group": _group,
    "ungroup": lambda e: [_name(e["name"])],
    "animate": lambda e: [json.dumps(e["motion"])],
}  # fmt: skip
"""Words of an edit after its flag; they raise an error where the flag cannot say it."""


def _called(method: str, *keys: str, spread: bool = False) -> Callable[[Edit], str]:
    """Writer of a call with some parameters, and others by name."""

    def made(edit: Edit) -> str:
        values = [edit[k] for k in keys]
        given = [repr(v) for v in (values[0] if spread else values)]
        rest = {k: v for k, v in edit.items() if k not in ("op", "layer", *keys)}
        named = [f"{k}={tuple(v) if k == 'pivot' else v!r}" for k, v in rest.items()]
        return f"{method}({', '.join(given + named)})"

    return made


def _dragged(edit: Edit) -> str:
    handles = {(h[0], h[1]): (h[2], h[3]) for h in edit["handles"]}
    if len(handles) < len(edit["handles"]):
        raise ValueError
    return f"dragged({handles!r})"


def _with_point(edit: Edit) -> str:
    more = ", follow=True" if edit.get("follow") else ""
    return f"with_point({edit['path']}, {edit['point']}, {edit['by'][0]}, {edit['by'][1]}{more})"


_METHODS: dict[str, Callable[[Edit], str]] = {
    "move": _called("moved", "by", spread=True), "rotate": _called("rotated", "degrees"),
    "scale": _called("scaled", "by", spread=True), "shear": _called("sheared", "by", spread=True),
    "affine": _called("transformed", "matrix"), "flip": _called("flipped", "axis"),
    "drag": _dragged, "point": _with_point, "remove": _called("removed"),
    "duplicate": _called("duplicated"), "rename": _called("renamed", "name"),
    "order": _called("reordered", "to"), "hide": _called("hidden"), "show": _called("shown"),
    "still": _called("stilled"), "opacity": _called("with_opacity", "value"),
    "recolour": _called("recoloured"), "merge": _called("merged", "other"),
    "complete": _called("completed"), "cut": _called("cut"),
}  # fmt: skip
"""Writers of the method of a layer that does an edit."""

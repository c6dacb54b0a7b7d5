"""Flags of pxi-edit that are edits: turns words of the command line into operations."""

from __future__ import annotations

import argparse
import json
import re
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from ..errors import UsageError
from .common import key

Values = dict[str, Any]
"""An edit operation, ``{"script": operations}`` or ``{"undo": count}``."""


_GUARD = "\0"
"""Mark before words that are no flags; no word of a command line has this character."""


class Edit(NamedTuple):
    """Edit on the command line.

    Attributes:
        flag: The flag, such as ``--move``.
        parse: Function that turns the words into an operation.
        words: The words after the flag.
    """

    flag: str
    parse: Callable[..., Values]
    words: list[str]

    def values(self) -> Values:
        """Parses the words.

        Raises:
            UsageError: The words cannot be understood.
        """
        try:
            return self.parse(*self.words)
        except (ValueError, TypeError):
            said = f"{self.flag} {' '.join(self.words)}"
            raise UsageError(f"{said}: cannot be understood; see --help") from None


class Flag(NamedTuple):
    """Flag of the command line that is an edit.

    Attributes:
        name: The flag as it is written, such as ``--move``.
        parse: Function that turns the words after the flag into an operation; it raises
            `ValueError` or `TypeError` if it cannot.
        words: Names of the words in the help; a last name that ends in `` ...`` stands for any
            number of words.
        help: Text of the help, a phrase.
    """

    name: str
    parse: Callable[..., Values]
    words: Sequence[str]
    help: str

    def add(self, edits: argparse._ArgumentGroup) -> None:
        """Adds the flag to a parser; its result collects all edits in `edits`, in their order."""
        flag, parse = self.name, self.parse

        class Gather(argparse.Action):
            def __call__(self, parser: Any, space: Any, values: Any, option: Any = None) -> None:
                space.edits = [*space.edits, Edit(flag, parse, unguarded(values))]

        edits.add_argument(
            flag,
            action=Gather,
            nargs="+" if self.words[-1].endswith(" ...") else len(self.words),
            default=argparse.SUPPRESS,
            help=self.help,
            metavar=tuple(word.removesuffix(" ...") for word in self.words),
        )


def add_edits(p: argparse.ArgumentParser) -> None:
    """Adds all flags to a parser; its result has a list of `Edit` in `edits`."""
    p.set_defaults(edits=[])
    group = p.add_argument_group("edits")
    for flag in FLAGS:
        flag.add(group)
    group.add_argument(
        "--follow",
        action=_Follow,
        nargs=0,
        default=argparse.SUPPRESS,
        help="after --point: its inside goes along, the rest of the outline stays",
    )


class _Follow(argparse.Action):
    """Adds `follow` to the `--point` before it."""

    def __call__(self, parser: Any, space: Any, values: Any, option: Any = None) -> None:
        if not space.edits or space.edits[-1].flag != "--point":
            parser.error("--follow belongs right after a --point and its words")
        *before, last = space.edits
        space.edits = [*before, last._replace(parse=_point_followed)]


def guarded(words: Sequence[str]) -> list[str]:
    """Marks words such as -5,3, so that argparse does not take them for flags."""
    return [_GUARD + word if re.match(r"-\.?[0-9]", word) else word for word in words]


def unguarded(words: Sequence[str]) -> list[str]:
    """Takes the marks of `guarded` away."""
    return [word.removeprefix(_GUARD) for word in words]


def _floats(text: str, count: int) -> list[float]:
    """Parses exactly `count` numbers that are separated by commas."""
    values = [float(v) for v in text.split(",")]
    if len(values) != count:
        raise ValueError
    return values


def _pivoted(text: str) -> tuple[str, Values]:
    """Splits VALUE@X,Y into the value and the parameter `pivot`, if there is one."""
    value, at, place = text.partition("@")
    return value, {"pivot": _floats(place, 2)} if at else {}


def _geometry(op: str, **parameter: int) -> Callable[[str, str], Values]:
    """Function that parses NAME and numbers for operation `op`.

    The one keyword argument is the name of the parameter and its count of numbers.
    """
    ((name, count),) = parameter.items()

    def parse(layer: str, value: str) -> Values:
        value, pivot = _pivoted(value)
        numbers = _floats(value, count)
        return {"op": op, "layer": key(layer), name: numbers if count > 1 else numbers[0], **pivot}

    return parse


def _scale(layer: str, value: str) -> Values:
    value, pivot = _pivoted(value)
    by = _floats(value, 2 if "," in value else 1)
    return {"op": "scale", "layer": key(layer), "by": [by[0], by[-1]], **pivot}


def _flip(layer: str, axis: str) -> Values:
    return {"op": "flip", "layer": key(layer), "axis": axis}


def _drag(layer: str, *handles: str) -> Values:
    if not handles:
        raise ValueError
    moves = []
    for handle in handles:
        place, _, by = handle.partition(":")
        moves.append([*_floats(place, 2), *_floats(by, 2)])
    return {"op": "drag", "layer": key(layer), "handles": moves}


def _point(layer: str, which: str, by: str) -> Values:
    path, point = (int(v) for v in which.split(","))
    return {
        "op": "point", "layer": key(layer), "path": path, "point": point, "by": _floats(by, 2)
    }  # fmt: skip


def _point_followed(layer: str, which: str, by: str) -> Values:
    return {**_point(layer, which, by), "follow": True}


def _named(op: str) -> Callable[[str], Values]:
    """Function that parses NAME for operation `op`."""
    return lambda layer: {"op": op, "layer": key(layer)}


def _assigned(
    op: str, name: str, kind: Callable[[str], str | int] = str
) -> Callable[[str], Values]:
    """Function that parses NAME=VALUE, or NAME alone, for operation `op`.

    Args:
        op: The operation.
        name: Its parameter that gets the value.
        kind: Function that parses the value.
    """

    def parse(text: str) -> Values:
        layer, given, value = text.rpartition("=") if "=" in text else (text, "", "")
        return {"op": op, "layer": key(layer), **({name: kind(value)} if given else {})}

    return parse


def _order(layer: str, place: str) -> Values:
    return {"op": "order", "layer": key(layer), "to": key(place)}


def _texture(text: str) -> Values:
    target, given, source = text.partition("=")
    if not given or not source:
        raise ValueError
    fit = {"fit": "shape"} if source.endswith("@shape") else {}
    source = source.removesuffix("@shape")
    file, layer = _foreign(source)
    return {"op": "texture", "layer": key(target), "source": file or key(source), **layer, **fit}


def _generate(layer: str, prompt: str) -> Values:
    return {"op": "generate", "layer": key(layer), "prompt": prompt}


def _foreign(source: str) -> tuple[str, Values]:
    """Splits FILE.pxi:LAYER into the file, or nothing, and the parameter `from_layer`."""
    parts = re.fullmatch(r"(.+?\.pxi):(.+)", source, re.IGNORECASE)
    return (parts[1], {"from_layer": key(parts[2])}) if parts else ("", {})


def _insert(text: str) -> Values:
    beside, given, source = text.partition("=")
    where: Values = {}
    if given:
        side = "under" if beside.startswith("under:") else "over"
        where[side] = key(beside.removeprefix("under:"))
    else:
        source = text
    start, at, place = source.rpartition("@")
    if at and re.fullmatch(r"[-+.,\deE]+", place):
        source, where = start, {"at": _floats(place, 2), **where}
    if not source:
        raise ValueError
    file, layer = _foreign(source)
    return {"op": "insert", "source": file or source, **layer, **where}


def _recolour(layer: str, changes: str) -> Values:
    values: Values = {"op": "recolour", "layer": key(layer)}
    for change in changes.split(","):
        name, colon, value = change.partition(":")
        if colon:
            values[name] = float(value)
        else:
            values["tint"] = name
    return values


def _cut(text: str) -> Values:
    layer, given, mask = text.partition("=")
    if given:
        if not mask:
            raise ValueError
        return {"op": "cut", "layer": key(layer), "mask": mask}
    layer, *places = text.split("@")
    if not places:
        raise ValueError
    points = [_floats(place.removeprefix("!"), 2) for place in places]
    said = [place.startswith("!") for place in places]
    values: Values = {"op": "cut", "layer": key(layer)}
    for name, out in (("points", False), ("outside", True)):
        some = [point for point, no in zip(points, said, strict=True) if no is out]
        values |= {name: some} if some else {}
    return values


def _merge(layer: str, other: str) -> Values:
    return {"op": "merge", "layer": key(layer), "other": key(other)}


def _animate(text: str) -> Values:
    from ..animate.presets import PRESETS
    from ..io.files import read_bytes

    if text in PRESETS:
        return {"op": "animate", "motion": {"version": 1, "preset": text}}
    where, words = ("--animate", text) if text.startswith("{") else (text, None)
    try:
        return {"op": "animate", "motion": json.loads(words or read_bytes(text))}
    except (ValueError, RecursionError) as error:
        raise UsageError(f"{where}: is not valid JSON: {error}") from None


def _group(text: str) -> Values:
    name, given, layers = text.partition("=")
    if not given:
        raise ValueError
    return {"op": "group", "layers": [key(v) for v in layers.split(",")], "name": name}


def _ungroup(name: str) -> Values:
    return {"op": "ungroup", "name": name}


def _outlines(file: str) -> Values:
    return {"op": "outlines", "source": file}


def _script(file: str) -> Values:
    from ..edit.script import parse
    from ..io.files import read_bytes

    try:
        words = read_bytes(file).decode()
    except UnicodeDecodeError:
        raise UsageError(f"{file}: is not UTF-8 text") from None
    return {"script": parse(words, file)}


def _undo(count: str) -> Values:
    return {"undo": int(count)}


FLAGS = (
    Flag("--move", _geometry("move", by=2), ["NAME", "DX,DY"], "move by canvas pixels"),
    Flag("--rotate", _geometry("rotate", degrees=1), ["NAME", "DEG[@X,Y]"],
        "turn clockwise, about the centre or X,Y"),
    Flag("--scale", _scale, ["NAME", "F[,FY][@X,Y]"], "enlarge F times, or F across and FY down"),
    Flag("--shear", _geometry("shear", by=2), ["NAME", "KX,KY[@X,Y]"], "slant"),
    Flag("--affine", _geometry("affine", matrix=6), ["NAME", "A,B,C,D,E,F[@X,Y]"],
        "x' = A x + C y + E, y' = B x + D y + F"),
    Flag("--flip", _flip, ["NAME", "AXIS"], "mirror: horizontal or vertical"),
    Flag("--drag", _drag, ["NAME", "X,Y:DX,DY ..."],
        "bend: points of the layer and where they go; 0,0 pins a point; one point alone moves all, "
        "one outside takes the nearest point along"),
    Flag("--point", _point, ["NAME", "PATH,POINT", "DX,DY"], "move a boundary's control point"),
    Flag("--outlines", _outlines, ["FILE.svg"], "take boundaries from an SVG, by layer name"),
    Flag("--remove", _named("remove"), ["NAME"], "take away: what it hid shows"),
    Flag("--duplicate", _assigned("duplicate", "name"), ["NAME[=COPY]"], "copy"),
    Flag("--cut", _cut, ["NAME=MASK|NAME@X,Y"],
        "make a layer out of a part: what a mask holds, or what is found at points, "
        "more with @X,Y, outside of it @!X,Y"),
    Flag("--merge", _merge, ["NAME", "OTHER"], "make one layer of two that show the same planes"),
    Flag("--complete", _assigned("complete", "method"), ["NAME[=smooth]"],
        "continue what is around the hidden parts of a layer, as of what was cut from it, or fill "
        "them smoothly"),
    Flag("--insert", _insert, ["[NAME=]SOURCE[@X,Y]"],
        "a layer of another file (FILE.pxi:LAYER) or a cut-out picture, in front of all or NAME, "
        "or behind under:NAME; its centre at X,Y"),
    Flag("--rename", _assigned("rename", "name"), ["NAME=NEW"], "give another name"),
    Flag("--order", _order, ["NAME", "PLACE"],
        "front, back, forward, backward, or a position from the back"),
    Flag("--hide", _named("hide"), ["NAME"], "stop drawing"),
    Flag("--show", _named("show"), ["NAME"], "draw again"),
    Flag("--animate", _animate, ["MOTION"],
        "let layers move: a preset of pxi-animate, a motion file, or its JSON"),
    Flag("--still", _named("still"), ["NAME"], "forget the motion"),
    Flag("--opacity", _geometry("opacity", value=1), ["NAME", "0-1"], "set the opacity"),
    Flag("--texture", _texture, ["NAME=SOURCE"],
        "texture of another layer, of a .pxi file (FILE.pxi:LAYER) or of a picture; with @shape by "
        "outlines instead of boxes"),
    Flag("--generate", _generate, ["NAME", "PROMPT"],
        "texture from words, made by the model that --guide names"),
    Flag("--recolour", _recolour, ["NAME", "CHANGE"],
        "hue:DEG, saturation:F, brightness:F, #rrggbb (shades of a colour); several with commas"),
    Flag("--group", _group, ["NAME=A,B,..."], "put layers into a group"),
    Flag("--ungroup", _ungroup, ["NAME"], "dissolve a group"),
    Flag("--parent", _assigned("parent", "to", key), ["NAME=PARENT"],
        "let a layer follow another one"),
    Flag("--script", _script, ["FILE"], "edits from a JSON file"),
    Flag("--undo", _undo, ["N"], "take back the last N edits"),
)  # fmt: skip

"""pxi-edit: change the objects of a .pxi picture; nothing is encoded anew."""

from __future__ import annotations

import argparse
import json
import math
import re
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import UsageError
from .common import add_limits, check_target, limits_of, parser, printable, run
from .decode import key

if TYPE_CHECKING:
    from ..model import Picture

Values = dict[str, Any]


def arguments() -> argparse.ArgumentParser:
    """The command line; edits gather in `edits`, in their order."""
    p = parser(
        "pxi-edit",
        "Edit the layers of a .pxi picture. Edits are repeatable and done in their order; "
        "NAME is a layer's name, or its position from the back (all digits), or a group's name.",
    )
    p.add_argument("input", metavar="IN", help=".pxi file, or - for standard input")
    p.add_argument("output", metavar="OUT", nargs="?", help=".pxi file, - for standard output; "
                   "may be IN with --force")  # fmt: skip
    p.set_defaults(edits=[])
    edits = p.add_argument_group("edits")

    def add(flag: str, parse: Callable[..., Values], *names: str, help: str) -> None:
        class Gather(argparse.Action):
            def __call__(self, parser: Any, space: Any, values: Any, option: Any = None) -> None:
                space.edits = [*space.edits, (flag, parse, list(values))]

        count: int | str = "+" if names[-1].endswith(" ...") else len(names)
        shown = tuple(n.removesuffix(" ...") for n in names)
        edits.add_argument(
            flag, action=Gather, nargs=count, default=argparse.SUPPRESS, help=help,
            metavar=shown,
        )  # fmt: skip

    add("--move", _geometry("move", by=2), "NAME", "DX,DY", help="move by canvas pixels")
    add("--rotate", _geometry("rotate", degrees=1), "NAME", "DEG[@X,Y]",
        help="turn clockwise, about the centre or X,Y")  # fmt: skip
    add("--scale", _scale, "NAME", "F[,FY][@X,Y]", help="enlarge F times, or F across and FY down")
    add("--shear", _geometry("shear", by=2), "NAME", "KX,KY[@X,Y]", help="slant")
    add("--affine", _geometry("affine", matrix=6), "NAME", "A,B,C,D,E,F[@X,Y]",
        help="x' = A x + C y + E, y' = B x + D y + F")  # fmt: skip
    add("--flip", _flip, "NAME", "AXIS", help="mirror: horizontal or vertical")
    add("--drag", _drag, "NAME", "X,Y:DX,DY ...",
        help="bend: points of the layer and where they go; 0,0 pins a point")  # fmt: skip
    add("--point", _point, "NAME", "PATH,POINT", "DX,DY", help="move a boundary's control point")
    add("--outlines", _outlines, "FILE.svg", help="take boundaries from an SVG, by layer name")
    add("--remove", _named("remove"), "NAME", help="take away: what it hid shows")
    add("--duplicate", _assigned("duplicate", "name"), "NAME[=COPY]", help="copy")
    add("--rename", _assigned("rename", "name"), "NAME=NEW", help="give another name")
    add("--order", _order, "NAME", "PLACE",
        help="front, back, forward, backward, or a position from the back")  # fmt: skip
    add("--hide", _named("hide"), "NAME", help="stop drawing")
    add("--show", _named("show"), "NAME", help="draw again")
    add("--still", _named("still"), "NAME", help="forget the motion")
    add("--opacity", _geometry("opacity", value=1), "NAME", "0-1", help="set the opacity")
    add("--texture", _texture, "NAME=SOURCE", help="texture of another layer, of a .pxi file "
        "(FILE.pxi:LAYER) or of a picture; with @shape by outlines instead of boxes")  # fmt: skip
    add("--recolour", _recolour, "NAME", "CHANGE", help="hue:DEG, saturation:F, brightness:F, "
        "#rrggbb (shades of a colour); several with commas")  # fmt: skip
    add("--group", _group, "NAME=A,B,...", help="put layers into a group")
    add("--ungroup", _ungroup, "NAME", help="dissolve a group")
    add("--parent", _assigned("parent", "to"), "NAME=PARENT", help="let a layer follow another one")
    add("--script", _script, "FILE", help="edits from a JSON file")
    add("--undo", _undo, "N", help="take back the last N edits")
    p.add_argument("--bake", action="store_true", help="forget the history of edits")
    p.add_argument("--list", action="store_true", help="print layers, groups and history")
    add_limits(p)
    p.add_argument("-f", "--force", action="store_true", help="replace OUT if it exists")
    p.add_argument("--quiet", action="store_true", help="print nothing but errors")
    p.add_argument("--json", action="store_true", help="print the list or report as JSON")
    return p


def main(argv: list[str] | None = None) -> int:
    """Entry point; returns the exit code."""
    words = sys.argv[1:] if argv is None else argv
    return run("pxi-edit", lambda: edit_file(arguments().parse_intermixed_args(_guarded(words))))


def _guarded(words: list[str]) -> list[str]:
    """Words such as -5,3 with a leading space, so that argparse does not take them for flags."""
    return [f" {w}" if re.match(r"-\.?[0-9]", w) else w for w in words]


def edit_file(args: argparse.Namespace) -> None:
    """Does what the command line asks for."""
    if args.output is None and (args.edits or args.bake or not args.list):
        raise UsageError("OUT is missing; --list alone needs none")
    if args.output == "-" and (args.list or args.json):
        raise UsageError("a list or report and a picture cannot both go to standard output")
    if args.output is not None:
        same = Path(args.output) == Path(args.input)
        check_target(args.output, args.force, None if same and args.force else args.input)
    operations = [_parsed(*edit) for edit in args.edits]

    from ..codec.read import from_file
    from ..codec.write import to_bytes
    from ..edit.history import undone
    from ..edit.script import apply
    from ..io.files import write_atomically

    started = time.perf_counter()
    picture, number = from_file(args.input, limits_of(args)), 1
    for values in operations:
        if "undo" in values:
            picture = undone(picture, values["undo"])
            continue
        edits = values.get("script", [values])
        picture = apply(picture, edits, number)
        number += len(edits)
    if args.bake:
        picture = replace(picture, history=())
    if args.list:
        facts = listing(picture)
        print(json.dumps(facts, indent=2) if args.json else text(facts))
    if args.output is None:
        return
    data = to_bytes(picture)
    write_atomically(args.output, data)
    report = {
        "output": args.output,
        "bytes": len(data),
        "layers": [layer.name for layer in picture.layers],
        "edits": len(picture.history),
        "seconds": round(time.perf_counter() - started, 3),
    }
    if args.json and not args.list:
        print(json.dumps(report))
    elif not args.quiet:
        print(
            f"{args.output}: {len(data)} bytes, {len(picture.layers)} layers, "
            f"{len(picture.history)} edits to undo, {report['seconds']:.2f} s",
            file=sys.stderr,
        )


def _parsed(flag: str, parse: Callable[..., Values], words: list[str]) -> Values:
    try:
        return parse(*(w.strip() if w.startswith(" -") else w for w in words))
    except (ValueError, TypeError):
        raise UsageError(f"{flag} {' '.join(words)}: cannot be understood; see --help") from None


def listing(picture: Picture) -> dict[str, Any]:
    """Layers, groups and history, ready for JSON."""
    from ..edit.transforms import bounds

    layers = []
    for i, layer in enumerate(picture.layers):
        pose = layer.pose
        x0, y0, x1, y1 = bounds(picture, [layer])
        layers.append(
            {
                "position": i,
                "name": layer.name,
                "bounds": [math.floor(x0), math.floor(y0), math.ceil(x1), math.ceil(y1)],
                "paths": [] if layer.boundary is None else layer.boundary.segments,
                "nodes": None if layer.mesh is None else len(layer.mesh.refined.nodes),
                "moved": pose.affine,
                "bent": pose.bent,
                "moves": layer.track is not None,
                "opacity": round(pose.opacity / 65535, 4),
                "hidden": pose.hidden,
                "recoloured": bool(pose.colour),
                "parent": layer.parent,
            }
        )
    return {
        "layers": layers,
        "groups": dict(picture.groups),
        "history": [_recorded(step.operation) for step in picture.history],
    }


def _recorded(operation: str) -> Any:
    """An operation of a history; as it is, if another program wrote it in its own way."""
    try:
        return json.loads(operation)
    except (ValueError, RecursionError):
        return operation


def text(facts: dict[str, Any]) -> str:
    """The facts for people."""
    lines = []
    for v in facts["layers"]:
        x0, y0, x1, y1 = v["bounds"]
        marks = [m for m in ("moved", "bent", "moves", "recoloured", "hidden") if v[m]]
        if v["opacity"] < 1:
            marks.append(f"opacity {v['opacity']:g}")
        if v["parent"]:
            marks.append(f"in {v['parent']!r}")
        nodes = "no mesh" if v["nodes"] is None else f"{v['nodes']} nodes"
        lines.append(
            f"{v['position']} {v['name']!r}: {x1 - x0}x{y1 - y0} at {x0},{y0}, {nodes}"
            + "".join(f", {m}" for m in marks)
        )
    lines += [f"group {n!r}" + (f" in {p!r}" if p else "") for n, p in facts["groups"].items()]
    history = (json.dumps(v, ensure_ascii=False) for v in facts["history"])
    lines += [f"edit {i}: {printable(v)}" for i, v in enumerate(history, 1)]
    return "\n".join(lines)


def _floats(text: str, count: int) -> list[float]:
    values = [float(v) for v in text.split(",")]
    if len(values) != count:
        raise ValueError
    return values


def _pivoted(text: str) -> tuple[str, Values]:
    """What stands before @X,Y, and the pivot if there is one."""
    value, at, place = text.partition("@")
    return value, {"pivot": _floats(place, 2)} if at else {}


def _geometry(op: str, **parameter: int) -> Callable[[str, str], Values]:
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
        place, _, by = handle.strip().partition(":")
        moves.append([*_floats(place, 2), *_floats(by, 2)])
    return {"op": "drag", "layer": key(layer), "handles": moves}


def _point(layer: str, which: str, by: str) -> Values:
    path, point = (int(v) for v in which.split(","))
    return {
        "op": "point", "layer": key(layer), "path": path, "point": point, "by": _floats(by, 2)
    }  # fmt: skip


def _named(op: str) -> Callable[[str], Values]:
    return lambda layer: {"op": op, "layer": key(layer)}


def _assigned(op: str, name: str) -> Callable[[str], Values]:
    def parse(text: str) -> Values:
        layer, given, value = text.rpartition("=") if "=" in text else (text, "", "")
        return {"op": op, "layer": key(layer), **({name: value} if given else {})}

    return parse


def _order(layer: str, place: str) -> Values:
    return {"op": "order", "layer": key(layer), "to": key(place)}


def _texture(text: str) -> Values:
    layer, given, source = text.partition("=")
    if not given or not source:
        raise ValueError
    values: Values = {"op": "texture", "layer": key(layer)}
    if source.endswith("@shape"):
        source, values["fit"] = source.removesuffix("@shape"), "shape"
    if parts := re.fullmatch(r"(.+?\.pxi):(.+)", source, re.IGNORECASE):
        return {**values, "source": parts[1], "from_layer": key(parts[2])}
    return {**values, "source": source}


def _recolour(layer: str, changes: str) -> Values:
    values: Values = {"op": "recolour", "layer": key(layer)}
    for change in changes.split(","):
        name, colon, value = change.partition(":")
        if colon:
            values[name] = float(value)
        else:
            values["tint"] = name
    return values


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


if __name__ == "__main__":
    sys.exit(main())

"""pxi-edit: changes the objects of a .pxi picture without encoding anything anew."""

from __future__ import annotations

import argparse
import json
import math
import re
import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import UsageError
from .common import add_limits, check_target, limits_of, parser, printable, run
from .edit_flags import Values, add_edits

if TYPE_CHECKING:
    from ..model import Picture


def arguments() -> argparse.ArgumentParser:
    """Parser of the command line; its result has a list `edits` in the order of the flags."""
    p = parser(
        "pxi-edit",
        "Edit the layers of a .pxi picture. Edits are repeatable and done in their order; "
        "NAME is a layer's name, or its position from the back (all digits), or a group's name.",
    )
    p.add_argument("input", metavar="IN", help=".pxi file, or - for standard input")
    p.add_argument("output", metavar="OUT", nargs="?", help=".pxi file, - for standard output; "
                   "may be IN with --force")  # fmt: skip
    add_edits(p)
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
    """Puts a space before words such as -5,3, so that argparse does not take them for flags."""
    return [f" {w}" if re.match(r"-\.?[0-9]", w) else w for w in words]


def edit_file(args: argparse.Namespace) -> None:
    """Runs pxi-edit with parsed arguments.

    Raises:
        PxiError: Anything that goes wrong, as the class that decides the exit code.
    """
    _check(args)
    operations = [edit.values() for edit in args.edits]

    from ..codec.read import from_file
    from ..codec.write import to_bytes
    from ..io.files import write_atomically

    started = time.perf_counter()
    picture = _edited(from_file(args.input, limits_of(args)), operations)
    if args.bake:
        picture = replace(picture, history=())
    if args.list:
        facts = listing(picture)
        print(json.dumps(facts, indent=2) if args.json else text(facts))
    if args.output is None:
        return
    data = to_bytes(picture)
    write_atomically(args.output, data)
    _report(args, picture, len(data), time.perf_counter() - started)


def _check(args: argparse.Namespace) -> None:
    """Refuses contradictory arguments before any work is done.

    Raises:
        UsageError: OUT is missing, or standard output is needed twice.
        InputError: OUT exists and --force is not given, or it cannot be written.
    """
    if args.output is None and (args.edits or args.bake or not args.list):
        raise UsageError("OUT is missing; --list alone needs none")
    if args.output == "-" and (args.list or args.json):
        raise UsageError("a list or report and a picture cannot both go to standard output")
    if args.output is not None:
        same = Path(args.output) == Path(args.input)
        check_target(args.output, args.force, None if same and args.force else args.input)


def _edited(picture: Picture, operations: Sequence[Values]) -> Picture:
    """Applies all operations to a picture.

    Error messages count the operations from 1; each operation of a script counts by itself.
    """
    from ..edit.script import Row

    row = Row(picture)
    for values in operations:
        if "undo" in values:
            row.undo(values["undo"])
        else:
            for edit in values.get("script", [values]):
                row.apply(edit)
    return row.picture


def _report(args: argparse.Namespace, picture: Picture, size: int, seconds: float) -> None:
    """Prints a report about the written file, which has `size` bytes."""
    if args.json and not args.list:
        report = {
            "output": args.output,
            "bytes": size,
            "layers": [layer.name for layer in picture.layers],
            "edits": len(picture.history),
            "seconds": round(seconds, 3),
        }
        print(json.dumps(report))
    elif not args.quiet:
        print(
            f"{args.output}: {size} bytes, {len(picture.layers)} layers, "
            f"{len(picture.history)} edits to undo, {round(seconds, 3):.2f} s",
            file=sys.stderr,
        )


def listing(picture: Picture) -> dict[str, Any]:
    """Facts about layers, groups and history, ready for JSON."""
    return {
        "layers": [_layer(picture, i) for i in range(len(picture.layers))],
        "groups": dict(picture.groups),
        "history": [_recorded(step.operation) for step in picture.history],
    }


def _layer(picture: Picture, position: int) -> dict[str, Any]:
    """Facts about the layer at a position."""
    from ..edit.transforms import bounds

    layer = picture.layers[position]
    pose = layer.pose
    x0, y0, x1, y1 = bounds(picture, [layer])
    return {
        "position": position,
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


def _recorded(operation: str) -> Any:
    """Parses an operation of the history; returns the text itself if it is not JSON.

    Another program may have written it in a form of its own.
    """
    try:
        return json.loads(operation)
    except (ValueError, RecursionError):
        return operation


def text(facts: dict[str, Any]) -> str:
    """Formats the facts of `listing` as text."""
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


if __name__ == "__main__":
    sys.exit(main())

"""pxi-edit: changes the objects of a .pxi picture without encoding anything anew."""

from __future__ import annotations

import argparse
import json
import math
import os
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import UsageError
from .common import add_limits, limits_of, parser, printable, run, warnings_shown
from .edit_flags import Values, add_edits, guarded, unguarded
from .generate_flags import add_generate, watched, with_settings
from .places import (
    add_force_suffix,
    check_suffix,
    check_target,
    in_and_out,
    is_stream,
    parse,
    same_file,
)

if TYPE_CHECKING:
    from ..model import Picture

ENCODED = ("texture", "insert", "generate")
"""Operations that may encode a picture file."""


def arguments() -> argparse.ArgumentParser:
    """Parser of the command line; its result has a list `edits` in the order of the flags."""
    p = parser(
        "pxi-edit",
        "Edit the layers of a .pxi picture. Edits are repeatable and done in their order; "
        "NAME is a layer's name, or its position from the back in IN (all digits), or a group's "
        "name.",
    )
    p.usage = "%(prog)s [options] IN [OUT]"
    p.add_argument("files", metavar="IN [OUT]", nargs="*", default=[], help=".pxi file, or - for "
                   "standard input; .pxi file, which may be IN with --force, - for standard "
                   "output, or another picture file, to draw it as pxi-decode does")  # fmt: skip
    add_edits(p)
    add_generate(p)
    p.add_argument(
        "-e",
        "--effort",
        type=int,
        metavar="1-9",
        help="how long to optimize pictures that become textures or layers; default 2",
    )
    p.add_argument("--bake", action="store_true", help="forget the history of edits")
    p.add_argument("--purge", action="store_true", help="after all edits, take out pixels that no "
                   "layer shows, for good; forgets the history too")  # fmt: skip
    p.add_argument("--list", action="store_true", help="print layers, groups and history")
    add_limits(p)
    add_force_suffix(p)
    p.add_argument("-f", "--force", action="store_true", help="replace OUT if it exists")
    p.add_argument("--quiet", action="store_true", help="print nothing but errors")
    p.add_argument("--json", action="store_true", help="print the list or report as JSON")
    return p


def main(argv: list[str] | None = None) -> int:
    """Entry point; returns the exit code."""
    args = parse(arguments(), guarded(sys.argv[1:] if argv is None else argv))
    args.files = unguarded(args.files)
    with warnings_shown("pxi-edit", args.quiet):
        return run("pxi-edit", lambda: edit_file(args))


def edit_file(args: argparse.Namespace) -> None:
    """Runs pxi-edit with parsed arguments.

    Raises:
        PxiError: Anything that goes wrong, as the class that decides the exit code.
    """
    args.input, args.output = in_and_out(args.files)
    operations = with_settings(args, [edit.values() for edit in args.edits])
    _check(args, operations)
    if args.effort is not None:
        operations = [v | {"effort": args.effort} if v.get("op") in ENCODED else v
                      for v in operations]  # fmt: skip

    from ..codec.read import from_file
    from ..codec.write import to_bytes
    from ..io.files import write_atomically

    started = time.perf_counter()
    before = from_file(args.input, limits_of(args))
    with watched(args):
        picture = _edited(before, operations, args.quiet)
    if args.bake:
        picture = replace(picture, history=())
    if args.purge:
        picture = _purged(args, picture)
    if args.list:
        facts = listing(picture)
        print(json.dumps(facts, indent=2) if args.json else text(facts))
    if args.output is None:
        return
    if _drawn(args):
        _draw(args, picture)
        size = os.path.getsize(args.output)
    else:
        data = to_bytes(picture)
        write_atomically(args.output, data)
        size = len(data)
        _say_what_stays(args, before, picture)
    _report(args, picture, size, time.perf_counter() - started)


def _purged(args: argparse.Namespace, picture: Picture) -> Picture:
    """Takes out what no layer shows, and says how much that was."""
    from ..edit.purge import EFFORT, hidden_samples, purged

    if not args.quiet:
        edits = f", and the history of {n} edits" if (n := len(picture.history)) else ""
        gone = hidden_samples(picture)
        print(f"pxi-edit: purged {gone} samples that no layer shows{edits}", file=sys.stderr)
    return purged(picture, args.effort or EFFORT)


def _say_what_stays(args: argparse.Namespace, before: Picture, after: Picture) -> None:
    """Says it if edits left pixels in the written file that no layer shows any more."""
    from ..edit.purge import leaves_pixels

    if not (args.quiet or args.purge) and leaves_pixels(before, after):
        print("pxi-edit: pixels that no layer shows any more stay in the file; --purge takes them "
              "out", file=sys.stderr)  # fmt: skip


def _drawn(args: argparse.Namespace) -> bool:
    """Whether the output is the edited picture as pixels, or as layers or outlines."""
    named = args.output is not None and not is_stream(args.output) and not args.force_suffix
    return named and Path(args.output).suffix.lower() not in ("", ".pxi")


def _draw(args: argparse.Namespace, picture: Picture) -> None:
    """Draws the edited picture as pxi-decode does."""
    from ..api import Image
    from . import decode

    flags = decode.arguments().parse_args([f"--limit={v}" for v in args.limit])
    flags.quiet, flags.prog = args.quiet, "pxi-edit"
    decode.draw(Image(picture), args.output, flags)


def _check(args: argparse.Namespace, operations: Sequence[Values]) -> None:
    """Refuses contradictory arguments before any work is done.

    Raises:
        UsageError: OUT is missing, is another input, or has a doubtful suffix, or standard output
            is needed twice.
        InputError: OUT exists and --force is not given, or it cannot be written.
    """
    if args.output is None and (args.edits or args.bake or args.purge or not args.list):
        raise UsageError("OUT is missing; --list alone needs none")
    if args.output == "-" and (args.list or args.json):
        raise UsageError("a list or report and a picture cannot both go to standard output")
    if args.effort is not None and not 1 <= args.effort <= 9:
        raise UsageError(f"--effort {args.effort}: must be 1..9")
    if args.output is None:
        return
    drawn = _drawn(args)
    if not drawn:
        check_suffix(args.output, args.force_suffix, "name it so, or .png to draw it")
    place = args.force and not drawn and args.output != "-"
    in_place = place and same_file(args.output, args.input)
    others = [None if in_place else args.input, *_files_of(args, operations)]
    check_target(args.output, args.force, *others)


def _files_of(args: argparse.Namespace, operations: Sequence[Values]) -> list[str]:
    """Files that edits read: scripts, masks, guides, and sources of textures and outlines."""
    edits = [edit for values in operations for edit in values.get("script", [values])]
    read = ("source", "mask", "guide")
    sources = [edit.get(key) for edit in edits if isinstance(edit, Mapping) for key in read]
    scripts = [edit.words[0] for edit in args.edits if edit.flag == "--script"]
    kept = [args.resume] if args.resume else []
    return [*scripts, *kept, *(v for v in sources if isinstance(v, str) and "\0" not in v)]


def _edited(picture: Picture, operations: Sequence[Values], quiet: bool) -> Picture:
    """Applies all operations to a picture, and says what a drag of a single point does.

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
                if edit["op"] == "drag" and len(edit["handles"]) == 1 and not quiet:
                    name = json.loads(row.picture.history[-1].operation)["layer"]
                    print(f"pxi-edit: one point moves all of {name!r} and bends nothing; points "
                          "with :0,0 stay", file=sys.stderr)  # fmt: skip
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
            f"{printable(args.output)}: {size} bytes, {len(picture.layers)} layers, "
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

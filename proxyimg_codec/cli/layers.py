"""pxi-layers: finds the layers of a picture, as masks that can be looked at and changed."""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from pathlib import Path
from typing import Any

from .common import jobs_of, parser, printable, run, warnings_shown
from .places import check_names, check_target, in_and_out, parse, same_file
from .prompt_flags import add_prompts, check_prompts, found_layers


def arguments() -> argparse.ArgumentParser:
    """Parser of the command line."""
    p = parser(
        "pxi-layers",
        "Find the layers of a picture, by themselves or where you point, and write them as a\n"
        "folder of masks, which pxi-encode --masks reads, or as a sheet to look at.",
    )
    p.usage = "%(prog)s [options] IN [FOLDER]"
    add = p.add_argument
    add("files", metavar="IN [FOLDER]", nargs="*", default=[], help="picture file, or - for "
        "standard input; folder of masks, which is made")  # fmt: skip
    add("-o", "--out", metavar="FOLDER", help="instead of the second name")
    add("--sheet", metavar="FILE", help="draw all layers beside each other, with names, sizes and "
        "the cost of outlines")  # fmt: skip
    add_prompts(p)
    add("--masks", metavar="PATH", help="layers that there are already: a folder of masks, or one "
        "picture of labels; objects come to lie in front of them")  # fmt: skip
    add("--max-layers", type=int, metavar="N", help="most layers found where nothing is pointed "
        "at; default 4")  # fmt: skip
    add("--segmenter", metavar="NAME", help="who finds layers where nothing is pointed at")
    add("--frame", type=int, metavar="N", help="which picture of an input that holds several, "
        "counted from 0")  # fmt: skip
    add("-j", "--jobs", type=int, metavar="N", help="cores to use; all by default")
    add("-f", "--force", action="store_true", help="replace FILE, and masks that pxi-layers wrote")
    add("--quiet", action="store_true", help="print nothing but errors")
    add("--json", action="store_true", help="print the layers as JSON on standard output")
    return p


def main(argv: list[str] | None = None) -> int:
    """Entry point; returns the exit code."""
    args = parse(arguments(), argv)
    with warnings_shown("pxi-layers", args.quiet):
        return run("pxi-layers", lambda: layers_file(args))


def layers_file(args: argparse.Namespace) -> None:
    """Runs pxi-layers with parsed arguments.

    Raises:
        PxiError: Anything that goes wrong, as the class that decides the exit code.
    """
    source, folder = check(args)

    from ..encoder.settings import Settings
    from ..encoder.shapes.mask_folder import write_masks
    from ..io.raster import read, write

    started = time.perf_counter()
    settings = Settings(jobs=jobs_of(args))
    picture = read(source, frame=args.frame)
    regions = found_layers(picture.pixels, args, settings.jobs)
    if len(regions) == 1 and not args.quiet:
        warn(source, "no object was found: one layer; point at what is to be one (--point)")
    if folder is not None:
        write_masks(Path(folder), regions, args.force)
    if args.sheet is not None:
        from ..encoder.region_sheet import region_sheet

        for note in write(args.sheet, region_sheet(picture.pixels, regions, settings)):
            warn(args.sheet, note)
    facts = [{"name": r.name, "share": round(float(r.mask.mean()), 5)} for r in regions]
    if args.json:
        print(json.dumps({"output": folder, "sheet": args.sheet, "layers": facts}))
    elif not args.quiet:
        names = ", ".join(f"{v['name']} {100 * float(v['share']):.1f} %" for v in facts)
        where = args.sheet if folder is None else folder
        seconds = time.perf_counter() - started
        print(printable(f"{where}: {len(facts)} layers ({names}), {seconds:.1f} s"),
              file=sys.stderr)  # fmt: skip


def check(args: argparse.Namespace) -> tuple[str, str | None]:
    """Refuses what makes no sense, before the picture is read.

    Returns:
        Names of the input, and of the folder or None.

    Raises:
        UsageError: Flags contradict each other, an output is an input, or there is none.
        InputError: An output exists.
    """
    from ..errors import UsageError

    source, folder = in_and_out(args.files, args.out, "pxi-layers takes one picture")
    check_names(args.sheet, args.masks)
    check_prompts(args)
    if folder is None and args.sheet is None:
        raise UsageError("where do the layers go? Give a folder with -o, or a picture with --sheet")
    read = [source, args.masks, args.scribble]
    if folder == "-":
        raise UsageError("-: masks are several files; name a folder")
    if folder is not None:
        if any(path is not None and same_file(folder, path) for path in read):
            raise UsageError(f"{folder}: input and output are the same")
        for path in (args.masks, args.scribble):
            if path is not None and os.path.realpath(folder) == os.path.realpath(path):
                raise UsageError(f"{folder}: is read; write the masks to another folder")
    if args.sheet is not None:
        check_target(args.sheet, args.force, *read)
    return source, folder


def warn(where: str, note: Any) -> None:
    """Prints a warning."""
    print(f"pxi-layers: warning: {printable(f'{where}: {note}')}", file=sys.stderr)


if __name__ == "__main__":
    sys.exit(main())

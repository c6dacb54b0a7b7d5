"""Flags by which a user points at objects, of the tools that make layers."""

from __future__ import annotations

import argparse
import math
from typing import Any

from ..errors import UsageError
from .places import check_names

FLAGS = ("point", "box", "not", "scribble", "refine")
"""Names of the flags that say where an object is."""


def add_prompts(p: argparse.ArgumentParser) -> None:
    """Adds the flags."""
    add = p.add_argument
    add("--point", action="append", metavar="NAME=X,Y", help="a point inside an object, in pixels "
        "of the picture; repeatable: those with one name belong to one object, what is in none is "
        "the back")  # fmt: skip
    add("--box", action="append", metavar="NAME=X,Y,W,H", help="a box that holds an object")
    add("--not", action="append", metavar="NAME=X,Y", help="a point outside of the object")
    add("--scribble", metavar="PATH", help="strokes painted over objects: a picture of labels "
        "(0 or clear: no stroke), or a folder with one picture an object")  # fmt: skip
    add("--refine", action="append", metavar="NAME", help="improve this one of --masks, by points "
        "or without")  # fmt: skip
    add("--prompter", metavar="NAME", help="who finds what is pointed at; default maps, others are "
        "added by plug-in packages")  # fmt: skip


def pointed(args: argparse.Namespace) -> bool:
    """Whether a command line points at something."""
    return any(getattr(args, name) for name in FLAGS)


def check_prompts(args: argparse.Namespace) -> None:
    """Refuses flags that contradict each other, before any picture is read.

    Raises:
        UsageError: A flag cannot be read, is of no use, or contradicts another.
    """
    check_names(args.scribble)
    places_of(args)
    if args.refine and args.masks is None:
        raise UsageError("--refine: --masks says where the mask is that is to be improved")
    if args.prompter is not None and not pointed(args):
        raise UsageError("--prompter: nothing is pointed at; give --point, --box or --scribble")
    for name in ("segmenter", "max_layers"):
        if getattr(args, name) is not None and (args.masks is not None or pointed(args)):
            flag = next((f for f in FLAGS if getattr(args, f)), "masks")
            raise UsageError(f"--{name.replace('_', '-')} and --{flag} contradict each other")


def places_of(args: argparse.Namespace) -> dict[str, dict[str, Any]]:
    """The arguments `points`, `boxes` and `negatives` of `find_layers`.

    Raises:
        UsageError: A flag cannot be read, or an object has two boxes.
    """
    points: dict[str, list[tuple[float, ...]]] = {}
    outside: dict[str, list[tuple[float, ...]]] = {}
    boxes: dict[str, tuple[float, ...]] = {}
    for flag, found in (("point", points), ("not", outside)):
        for text in getattr(args, flag) or ():
            name, numbers = _read(flag, text, 2, "NAME=X,Y, such as cat=120,80")
            found.setdefault(name, []).append(numbers)
    for text in args.box or ():
        name, numbers = _read("box", text, 4, "NAME=X,Y,WIDTH,HEIGHT, such as cat=10,20,200,180")
        if name in boxes:
            raise UsageError(f'--box {text}: "{name}" has a box already')
        boxes[name] = numbers
    return {"points": points, "boxes": boxes, "negatives": outside}


def _read(flag: str, text: str, count: int, form: str) -> tuple[str, tuple[float, ...]]:
    """Name and numbers of a flag."""
    name, _, rest = text.rpartition("=")
    try:
        numbers = tuple(float(part) for part in rest.split(","))
    except ValueError:
        numbers = ()
    if len(numbers) != count or not all(math.isfinite(v) for v in numbers):
        raise UsageError(f"--{flag} {text}: must be {form}")
    if not (1 <= len(name) <= 200 and name.isprintable()):
        raise UsageError(f"--{flag} {text}: a name has 1 to 200 printable characters")
    return name, numbers


def found_layers(pixels: Any, args: argparse.Namespace, jobs: int) -> list[Any]:
    """Regions of a picture by the flags, by --masks, or else by the segmenter.

    Args:
        pixels: [H, W, C], the picture.
        args: The parsed command line.
        jobs: Threads to use.
    """
    from ..encoder.shapes.find import find_layers
    from ..encoder.shapes.mask_files import load_masks

    height, width = pixels.shape[:2]
    given: dict[str, Any] = {
        key: None if path is None else load_masks(path, width, height)
        for key, path in (("masks", args.masks), ("scribbles", args.scribble))
    }
    return find_layers(
        pixels, **given, **places_of(args), refine=args.refine or (), max_layers=args.max_layers,
        segmenter=args.segmenter, prompter=args.prompter, jobs=jobs,
    )  # fmt: skip

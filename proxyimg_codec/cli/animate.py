"""pxi-animate: moves the layers of a .pxi picture.

The result is a clip, or a .pxi file that carries the motion.
"""

from __future__ import annotations

import argparse
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..animate.presets import PRESETS
from ..errors import FormatError, UsageError
from .common import EXIT_CODES, Bar, add_limits, key, limits_of, parser, printable, run
from .places import check_target

if TYPE_CHECKING:
    from ..animate.motion import Motion
    from ..api import Image

TARGETS = """OUT: .mp4, .webm, .webp, .gif or .apng; a folder/ or name-%04d.png for a file a frame;
.png with --sheet for a sprite sheet and its .json; .pxi for a picture that carries the motion.
Transparency is kept by all but .mp4; .gif knows clear and opaque only.

"""


def arguments() -> argparse.ArgumentParser:
    """Parser of the command line."""
    p = parser(
        "pxi-animate",
        "Let layers of a .pxi picture move: by a preset, by a motion file, or as the picture "
        "itself says.",
    )
    p.epilog = TARGETS + EXIT_CODES
    add = p.add_argument
    add("input", metavar="IN", help=".pxi file, or - for standard input")
    add("output", metavar="OUT", help="where the clip goes, type by suffix")
    add("--preset", choices=list(PRESETS), help="a motion that suits any picture")
    add("--motion", metavar="FILE", help="a motion file, JSON")
    add("--layer", action="append", metavar="NAME|INDEX", help="let only this layer move; "
        "repeatable; with --preset")  # fmt: skip
    add("--pin", action="append", metavar="SPOT", help="what stays, instead of what the preset "
        "pins: top, bottom, left, right, border, centre, X,Y,RADIUS or X,Y,W,H; repeatable",
        )  # fmt: skip
    add("--separate", action="store_true", help="layers that touch need not move as one; with "
        "--preset")  # fmt: skip
    add("--duration", type=float, metavar="S", help="seconds; 4 by default")
    add("--fps", type=int, help="frames a second; 24 by default")
    add("--seed", type=int, help="another wind")
    add("--loop", action=argparse.BooleanOptionalAction, help="whether the end leads to the "
        "beginning; it does by default")  # fmt: skip
    add("--size", metavar="W[xH]", help="frames of that size in pixels, instead of the canvas's")
    add("--background", metavar="RRGGBB", help="what transparent pixels become where OUT has no "
        "transparency; white by default")  # fmt: skip
    add("--quality", type=int, metavar="0-100", help="of .mp4, .webm and .webp; 90 by default")
    add("--sheet", action="store_true", help="OUT.png is a sprite sheet")
    add("--engine", choices=["auto", "numpy", "native", "ort"], default="auto",
        help="who draws, as for pxi-decode")  # fmt: skip
    add("-j", "--jobs", type=int, default=2, metavar="N", help="cores to use, by threads; 2 by "
        "default")  # fmt: skip
    add_limits(p)
    add("-f", "--force", action="store_true", help="replace files that exist")
    add("--quiet", action="store_true", help="print nothing but errors")
    return p


def main(argv: list[str] | None = None) -> int:
    """Entry point; returns the exit code."""
    args = arguments().parse_args(argv)
    return run("pxi-animate", lambda: animate_file(args))


def animate_file(args: argparse.Namespace) -> None:
    """Runs pxi-animate with parsed arguments.

    Raises:
        PxiError: Anything that goes wrong, as the class that decides the exit code.
    """
    clip = Path(args.output).suffix.lower() != ".pxi"
    check(args, clip)

    from ..api import open_image
    from ..io.files import naming
    from ..native import kernel

    started = time.perf_counter()
    with kernel.for_engine(args.engine), naming(args.input, FormatError):
        image = open_image(args.input, limits_of(args))
        if args.preset or args.motion:
            image = moving(image, args)
        elif image.timeline is None:
            raise UsageError(f"{args.input} does not move by itself; give --preset or --motion")
        elif not clip:
            raise UsageError("the picture moves already; give another --preset or --motion")
        said = write_clip(image, args) if clip else write_picture(image, args)
    if not args.quiet:
        seconds = time.perf_counter() - started
        print(f"{printable(args.output)}: {said}, {seconds:.1f} s", file=sys.stderr)


def check(args: argparse.Namespace, clip: bool) -> None:
    """Refuses contradictory arguments before any work is done.

    Args:
        args: The parsed command line.
        clip: Whether the output is a clip rather than a .pxi file.

    Raises:
        UsageError: A flag would have no effect, or the kind of the target is unknown.
        InputError: The target exists and --force is not given, or it cannot be written.
    """
    if args.preset and args.motion:
        raise UsageError("give --preset or --motion, not both")
    for name in ("layer", "pin", "separate"):
        if getattr(args, name) and not args.preset:
            raise UsageError(f"--{name} needs --preset; a motion file names layers and pins itself")
    if args.seed is not None and not (args.preset or args.motion):
        raise UsageError("--seed needs --preset or --motion")
    if args.jobs < 1:
        raise UsageError(f"--jobs {args.jobs}: at least 1")
    if not clip:
        for name in ("size", "background", "quality", "sheet"):
            if getattr(args, name) not in (None, False):
                raise UsageError(f"--{name} makes no sense for a .pxi file")
        check_target(args.output, args.force, args.input, args.motion)
        return
    from ..export.clip_target import target_of

    target = target_of(args.output, args.sheet)
    if target.kind != "frames":
        check_target(str(target.path), args.force, args.input, args.motion)
        if target.kind == "sheet":
            check_target(str(target.sidecar), args.force, args.input, args.motion)
    elif target.first.exists() and not args.force:
        raise UsageError(f"{target.first}: exists already; use --force to replace the frames")


def moving(image: Image, args: argparse.Namespace) -> Image:
    """Returns the image with the motion that the command line asks for."""
    motion = motion_of(image, args)
    bar: Any = None

    def progress(done: int, total: int) -> None:
        nonlocal bar
        bar = bar or Bar(total, "simulating", args.quiet)
        bar.advance(1)

    try:
        return image.animated(motion, progress=progress)
    finally:
        if bar:
            bar.close()


def motion_of(image: Image, args: argparse.Namespace) -> Motion:
    """Motion of the preset or the motion file, as changed by the flags."""
    from ..animate.animate import boxes, preset
    from ..animate.motion import Motion

    given = {
        name: getattr(args, name)
        for name in ("duration", "fps", "seed", "loop")
        if getattr(args, name) is not None
    }
    if args.motion:
        return replace(Motion.read(args.motion, boxes(image), image.picture.size), **given)
    names = [key(n) for n in args.layer] if args.layer else None
    pins = [spot(text) for text in args.pin] if args.pin else None
    return preset(image, args.preset, names, together=not args.separate, **given, pins=pins)


def spot(text: str) -> Any:
    """Parses a value of --pin: a named side, a disc or a rectangle.

    Returns:
        The name of the side, a `Disc` or a `Rectangle`.

    Raises:
        UsageError: The text is none of these.
    """
    from ..animate.motion import Disc, Rectangle

    if text in ("top", "bottom", "left", "right", "border", "centre"):
        return text
    try:
        numbers = [float(part) for part in text.split(",")]
        if len(numbers) == 3:
            return Disc((numbers[0], numbers[1]), numbers[2])
        x, y, w, h = numbers
        return Rectangle((x, y, w, h))
    except ValueError:
        raise UsageError(
            f"--pin {text}: give top, bottom, left, right, border, centre, X,Y,RADIUS or X,Y,W,H"
        ) from None


def write_picture(image: Image, args: argparse.Namespace) -> str:
    """Writes the picture with its motion; returns a sentence about it for the user."""
    from ..animate.animate import amplitude
    from ..codec.write import to_bytes
    from ..io.files import write_atomically

    data = image.to_bytes()
    write_atomically(args.output, data)
    extra = len(data) - len(to_bytes(replace(image.picture, timeline=None)))
    assert image.timeline is not None, "it was given a motion"
    return (
        f"{len(data)} bytes, {extra} of them motion of {image.timeline.seconds:g} s, nodes "
        f"displaced by {amplitude(image):.1f} px in the mean"
    )


def write_clip(image: Image, args: argparse.Namespace) -> str:
    """Renders and writes the clip; returns a sentence about it for the user."""
    from ..animate.sequence import frames, times
    from ..export import clip
    from ..io.color import is_srgb, to_srgb
    from ..io.samples import rounded

    assert image.timeline is not None, "it moves, or was given a motion"
    playing = not (args.preset or args.motion)
    at = times(image, duration=args.duration if playing else None, fps=args.fps)
    width, height = size_of(args.size, image)
    bar = Bar(len(at), "rendering", args.quiet)
    srgb = is_srgb(image.blocks)

    def shown() -> Any:
        for frame in frames(
            image, at, jobs=args.jobs, width=width, height=height, engine=args.engine
        ):
            # No player looks for a profile in a clip.
            yield frame if srgb else rounded(to_srgb(frame, image.blocks), "uint8")
            bar.advance(1)

    try:
        count = clip.write_clip(
            args.output,
            shown(),
            fps=args.fps or image.timeline.fps,
            size=(width, height),
            alpha=not image.opaque,
            loop=image.timeline.loop if args.loop is None else args.loop,
            sheet=args.sheet,
            quality=args.quality,
            background=colour(args.background),
        )
    finally:
        bar.close()
    return f"{len(at)} frames of {width}x{height}, {count} bytes"


def size_of(text: str | None, image: Image) -> tuple[int, int]:
    """Parses --size: width and height of the frames in pixels; the canvas's by default.

    If only a width is given, the height follows from the aspect ratio of the canvas.

    Raises:
        UsageError: The text is not a size.
    """
    from ..render.view import make_view

    if text is None:
        return image.width, image.height
    try:
        numbers = [int(part) for part in text.lower().split("x")]
        width, height = numbers if len(numbers) == 2 else (*numbers, None)
    except ValueError:
        raise UsageError(f"--size {text}: give a width, or WIDTHxHEIGHT in pixels") from None
    view = make_view((image.width, image.height), width, height)
    return view.width, view.height


def colour(text: str | None) -> tuple[int, int, int]:
    """Parses --background: red, green and blue, 0 to 255; white by default.

    Raises:
        UsageError: The text does not have six hexadecimal digits.
    """
    if text is None:
        return (255, 255, 255)
    try:
        red, green, blue = bytes.fromhex(text.removeprefix("#"))
    except ValueError:
        raise UsageError(f"--background {text}: give six hexadecimal digits, RRGGBB") from None
    return red, green, blue


if __name__ == "__main__":
    sys.exit(main())

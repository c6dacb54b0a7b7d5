"""pxi-encode: turns a picture, flat or in layers, into a .pxi file."""

from __future__ import annotations

import argparse
import json
import logging
import os
import sys
import time
from collections.abc import Callable
from dataclasses import fields
from typing import Any

from ..io.names import is_picture
from .batch.each import each
from .batch.tool import Tool, add_batch
from .common import Bar, jobs_of, parser, printable
from .layered_input import encoded_layers, layered_input
from .places import (
    add_files,
    add_force_suffix,
    check_names,
    check_suffix,
    check_target,
    default_target,
    parse,
)
from .prompt_flags import FLAGS, add_prompts, check_prompts, found_layers, pointed

PRESET_NAMES = ("fast", "default", "best", "paper")


def arguments() -> argparse.ArgumentParser:
    """Parser of the command line."""
    p = parser(
        "pxi-encode", "Encode a picture as .pxi: layers, Bezier boundaries, fitted textures."
    )
    add_files(
        p,
        "picture file, .ora or .psd file whose layers become those of OUT, -: standard input, or "
        "with --stack a folder",
        ".pxi file, - for standard output; IN with the suffix .pxi by default",
    )
    _add_aims(p)
    _add_decomposition(p)
    _add_details(p)
    _add_reading(p)
    add_batch(p)
    p.add_argument("-f", "--force", action="store_true", help="replace OUT if it exists")
    add_force_suffix(p)
    p.add_argument("--quiet", action="store_true", help="print nothing but errors")
    p.add_argument(
        "--json",
        action="store_true",
        help="print the report as JSON on standard output, a line for each picture",
    )
    return p


def _add_aims(p: argparse.ArgumentParser) -> None:
    """Adds the flags for quality, size and effort."""
    add = p.add_argument
    add("-q", "--quality", type=float, metavar="0-100", help="default 50")
    add("--target-bpp", type=float, metavar="B", help="most bits a pixel of the whole file, "
        "and 2 %% less at the least, instead of -q")  # fmt: skip
    add("--target-size", type=float, metavar="BYTES", help="most bytes of the whole file, "
        "and 2 %% less at the least, instead of -q")  # fmt: skip
    add("--target-psnr", type=float, metavar="DB", help="PSNR of the decoded picture, within 0.1, "
        "instead of -q")  # fmt: skip
    add("--tune", choices=["mse", "ms-ssim"], default="mse", help="what to be good at: PSNR "
        "(default), or MS-SSIM; texture pyramid")  # fmt: skip
    add("--texture", choices=["auto", "implicit", "pyramid"], default="auto", help="coder: pyramid "
        "(the smallest files), implicit (the paper's: a network in the file, resolution-free), or "
        "auto: pyramid unless another flag needs implicit (default)")  # fmt: skip
    add("-e", "--effort", type=int, metavar="1-9", help="how long to optimize; default 5, for a "
        "picture of 8 megapixels or more 4")  # fmt: skip
    add("--preset", choices=PRESET_NAMES, default="default",
        help="effort 2, 5 or 8; paper: the literal method of ProxyImg, 4-bit codes and network, "
        "Chamfer boundaries. Other flags go before it")  # fmt: skip


def _add_decomposition(p: argparse.ArgumentParser) -> None:
    """Adds the flags that decide about layers, boundaries and meshes."""
    add = p.add_argument
    add(
        "--masks",
        metavar="PATH",
        help="the layers to make: a folder of masks (cat/eye.png: a part that follows cat.png), or "
        "one picture of labels (palette or grey: 0 is the back, 1, 2, ... are objects)",
    )
    add("--max-layers", type=int, metavar="N", help="most layers found; default 4")
    add("--layers", type=int, choices=[1], help="1: one layer, no decomposition")
    add("--segmenter", metavar="NAME", help="who finds layers; default figures, others are added "
        "by plug-in packages; or a model: an ONNX file, or a name of pxi-models")  # fmt: skip
    add("--depth", metavar="NAME", help="model of depth that puts found layers in order: an ONNX "
        "file, or a name of pxi-models")  # fmt: skip
    add_prompts(p)
    add("--boundary", choices=["lsq", "chamfer"], help="boundary fit: least squares "
        "(default), or the slower adaptive Chamfer fit of the paper")  # fmt: skip
    add("--background", metavar="HOW", default="auto", help="hidden parts of layers: smooth (also "
        "diffuse); exemplar: copied from what is around (pyramid); auto: the better one (default); "
        "complete: optimized and stored (implicit); none: nothing is stored; or a model that "
        "inpaints: an ONNX file, or a name of pxi-models")  # fmt: skip
    add("--behind", metavar="FILE", help="the picture without its objects, of the same size: what "
        "the back layer shows where they were; pyramid")  # fmt: skip
    add("--matte", choices=["auto", "hard", "soft"], help="soft masks, as of hair: "
        "auto keeps their alpha where they have soft rims (default), hard cuts them at one half, "
        "soft also finds that of hard masks by the colours along outlines; pyramid")  # fmt: skip
    add("--mesh", metavar="NAME", help="who makes proxy nodes: delaunay (default with texture "
        "implicit), triwild, ftetwild, or none (default with pyramid: edits make "
        "them)")  # fmt: skip


def _add_details(p: argparse.ArgumentParser) -> None:
    """Adds the flags for the storage of codes, for threads and for the device."""
    add = p.add_argument
    add("--feature-bits", type=int, metavar="2-8", help="bits a code; from quality by default")
    add("--net-bits", type=int, metavar="2-8", help="bits a network weight; default 8; "
        "like --feature-bits for texture implicit")  # fmt: skip
    add("--tiles", choices=["auto", "always", "never"], default="auto", help="tiles, by which a "
        "region is decoded without the rest: auto has them where a picture is large and they cost "
        "0.5 %% at most (default); pyramid")  # fmt: skip
    add("--seed", type=int, default=0, help="seed of everything random; default 0")
    add("-j", "--jobs", type=int, metavar="N", help="cores to use, all by default: of several "
        "pictures so many at once, for one by threads, of which 4 are of use")  # fmt: skip
    add("--device", choices=["cpu", "cuda"], default="cpu", help="where to fit; default cpu")


def _add_reading(p: argparse.ArgumentParser) -> None:
    """Adds the flags that say what is taken from the input."""
    add = p.add_argument
    add("--stack", action="store_true", help="IN is a folder of pictures of one size, one a layer, "
        "in the order of their names from back to front; folders within are groups")  # fmt: skip
    add("--blend", choices=["flatten", "refuse"], default="flatten", help="layers of IN with a "
        "blending mode, and adjustment layers: flatten makes one layer of them and what lies "
        "behind (default), refuse refuses IN")  # fmt: skip
    add("--frame", type=int, metavar="N", help="which picture of an input that holds several, "
        "counted from 0; by default the first, or the largest of an icon")  # fmt: skip
    add("--tone", choices=["clip"], help="clip: what is darker or brighter than 0..1 of sRGB is "
        "cut off there; by default it is refused")  # fmt: skip
    add("--strip", action="store_true", help="leave out EXIF and XMP, and convert to sRGB what has "
        "another colour")  # fmt: skip


def main(argv: list[str] | None = None) -> int:
    """Entry point; returns the exit code."""
    args = parse(arguments(), argv)
    tool = Tool("pxi-encode", ".pxi", takes, check, encode_file, tell, hush=True)
    return each(tool, args)


def takes(name: str) -> bool:
    """Whether a file in a folder is a picture to encode."""
    return is_picture(name) and not name.lower().endswith((".pxi", ".svg"))


def check(args: argparse.Namespace) -> None:
    """Refuses what makes no sense for any input.

    Raises:
        UsageError: A setting is out of range, flags contradict each other, or masks are given for
            several pictures or have no name.
    """
    from ..errors import UsageError

    check_names(args.masks, args.behind, args.background)
    one = [name for name in ("masks", "behind", *FLAGS) if getattr(args, name) is not None]
    if one and len(args.inputs) > 1:
        raise UsageError(f"--{one[0]}: belongs to one picture; encode each by itself")
    settings_from(args)
    check_prompts(args)


def encode_file(args: argparse.Namespace) -> dict[str, Any]:
    """Runs pxi-encode with parsed arguments for one input.

    Returns:
        The report of the output, as --json prints it.

    Raises:
        PxiError: Anything that goes wrong, as the class that decides the exit code.
    """
    from ..errors import UsageError

    output = target(args)
    if output == "-" and args.json:
        raise UsageError("--json and a picture cannot both go to standard output")
    check_suffix(output, args.force_suffix, "name it so, give several pictures a folder with -o")
    beside = [*files_in(args.masks), *(files_in(args.input) if args.stack else ())]
    check_target(output, args.force, *args.inputs, *beside, args.scribble, args.behind)
    settings = settings_from(args)

    from ..codec.read import from_bytes
    from ..codec.write import to_bytes
    from ..errors import InputError
    from ..io.files import read_bytes, write_atomically
    from ..render.quality import psnr

    started, cpu = time.perf_counter(), time.process_time()
    if not args.stack and os.path.isdir(args.input):
        raise InputError(f"{args.input}: is a folder; -o FOLDER/ encodes the pictures in it, "
                         "--stack makes layers of them")  # fmt: skip
    source = b"" if args.stack else read_bytes(args.input)
    bar = Bar(settings.steps, "fitting", args.quiet or args.json or args.batch)
    try:
        image, original = encoded(source, args, settings, bar)
    finally:
        bar.close()
    data = to_bytes(image)

    # The file is decoded again before it replaces an older one, so that a file that cannot be read
    # replaces nothing.
    quality = psnr(original, from_bytes(data))
    write_atomically(output, data)
    return {
        "output": output,
        "width": image.width,
        "height": image.height,
        "bytes": len(data),
        "bpp": round(8 * len(data) / (image.width * image.height), 4),
        "psnr": None if quality is None else round(quality, 3),
        "layers": [layer.name for layer in image.layers],
        "texture": "implicit" if image.networks else "pyramid",
        "seconds": round(time.perf_counter() - started, 2),
        "cpu_seconds": round(time.process_time() - cpu, 2),
    }


def tell(report: dict[str, Any], args: argparse.Namespace, say: Callable[[str], None]) -> None:
    """Tells of an output."""
    if args.json:
        print(json.dumps(report), flush=True)
    elif not args.quiet:
        say(printable(describe(report)))


def files_in(path: str | None) -> list[str]:
    """Files of a folder and those within, as far as they can be listed; or the one file."""
    if path is None:
        return []
    return [os.path.join(at, name) for at, _, names in os.walk(path) for name in names] or [path]


def encoded(source: bytes, args: argparse.Namespace, settings: Any, bar: Bar) -> tuple[Any, Any]:
    """Encodes a picture file.

    Args:
        source: Bytes of the file; none of a folder.
        args: The parsed command line.
        settings: `Settings` of the encoder.
        bar: Progress bar.

    Returns:
        The encoded picture, and the original pixels [H, W, C] to compare it with.
    """
    from ..encoder.encode import encode
    from ..encoder.settings import EFFORT
    from ..encoder.shapes.mask_files import load_masks
    from ..io.raster import parse, stripped

    seen = 0

    def progress(stage: str, done: int, total: int) -> None:
        nonlocal seen
        reached = done * settings.steps // total
        if stage == "texture" and reached > seen:
            bar.advance(reached - seen)
            seen = reached

    name = "standard input" if args.input == "-" else args.input
    layered = layered_input(source, name, args)
    if layered is not None:
        return encoded_layers(layered, name, args, settings, progress)
    picture = parse(source, name, frame=args.frame, clip=args.tone == "clip")
    picture = stripped(picture) if args.strip else picture
    height, width = picture.pixels.shape[:2]
    masks = None if args.masks is None else load_masks(args.masks, width, height)
    if pointed(args):
        masks = found_layers(picture.pixels, args, settings.jobs)
    behind = None if args.behind is None else picture_behind(args, picture)
    image = encode(
        picture.pixels, settings, masks=masks, blocks=picture.blocks,
        behind=None if behind is None else behind.pixels, progress=progress,
    )  # fmt: skip
    notes = [*picture.notes]
    if settings.effort is None and (effort := settings.effort_for(height * width)) != EFFORT:
        notes.append(f"a large picture: effort {effort} instead of {EFFORT}; -e chooses another")
    notes += [] if behind is None else [f"{args.behind}: {note}" for note in behind.notes]
    if masks is None and settings.max_layers > 1 and len(image.layers) == 1:
        notes.append("no object was found: one layer; point at what is to be one (--point)")
    for note in () if args.quiet else notes:
        logging.getLogger(__name__).warning("%s: %s", name, note)
    return image, picture.pixels


def picture_behind(args: argparse.Namespace, picture: Any) -> Any:
    """Reads the picture of --behind, in the colours of the input.

    Args:
        args: The parsed command line.
        picture: The input, a `raster.Picture`.

    Raises:
        PxiError: It cannot be read, or its colours cannot be converted.
    """
    from ..errors import UnsupportedError
    from ..io.raster import matched, read

    behind = read(args.behind, clip=args.tone == "clip")
    try:
        return matched(behind, picture.blocks)
    except UnsupportedError as error:
        raise UnsupportedError(f"{args.behind}: {error}") from None


def target(args: argparse.Namespace) -> str:
    """Name of the output file."""
    return default_target(args.input, ".pxi") if args.output is None else str(args.output)


def settings_from(args: argparse.Namespace) -> Any:
    """`Settings` of the encoder for a command line.

    Raises:
        UsageError: A value is out of range, or flags contradict each other.
    """
    from ..encoder.settings import PRESETS, Settings
    from ..errors import UsageError

    if args.behind is not None and args.background != "auto":
        raise UsageError("--behind and --background contradict each other")
    if args.quality is not None:
        aims = [n for n in ("target_bpp", "target_size", "target_psnr") if getattr(args, n)]
        if aims:
            raise UsageError(f"--quality and --{aims[0].replace('_', '-')} contradict each other")
    rivals = [n for n in ("layers", "masks", "max_layers") if getattr(args, n) is not None]
    if args.layers and pointed(args):
        rivals.append(next(n for n in FLAGS if getattr(args, n)))
    if args.layers or args.masks:
        rivals += [n for n in ("segmenter", "depth") if getattr(args, n) is not None]
    if len(rivals) > 1:
        names = " and ".join(f"--{n.replace('_', '-')}" for n in rivals)
        raise UsageError(f"{names} contradict each other")
    names_of_settings = {f.name for f in fields(Settings)}
    given = {k: v for k, v in vars(args).items() if k in names_of_settings and v is not None}
    values = PRESETS[args.preset] | given
    values["jobs"] = jobs_of(args)
    if args.layers:
        values["max_layers"] = 1
    return Settings(**values)


def describe(report: dict[str, Any]) -> str:
    """Formats the report as one line."""
    names = ", ".join(report["layers"])
    quality = "exact" if report["psnr"] is None else f"{report['psnr']:.2f} dB"
    return (
        f"{report['output']}: {report['width']}x{report['height']}, {report['bytes']} bytes, "
        f"{report['bpp']:.3f} bpp, PSNR {quality}, {len(report['layers'])} layers ({names}), "
        f"{report['texture']}, "
        f"{report['seconds']:.1f} s"
    )


if __name__ == "__main__":
    sys.exit(main())

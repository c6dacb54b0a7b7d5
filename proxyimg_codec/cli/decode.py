"""pxi-decode: turns a .pxi file into a picture of any size, layers, outlines or an ONNX model."""

from __future__ import annotations

import argparse
import logging
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from ..errors import FormatError, UsageError
from .batch.each import each
from .batch.tool import Tool, add_batch
from .common import (
    EXIT_CODES,
    Bar,
    add_limits,
    key,
    limits_of,
    parser,
    printable,
)  # fmt: skip
from .places import add_files, check_target, default_target, is_stream, parse, same_file

LAYERED = (".ora", ".psd", ".svg")
"""Suffixes of output files that hold layers instead of one flat picture."""

SIGNATURE = "CON-2"
"""Rule that what is no `.pxi` file breaks: of that nothing can be decoded."""

DAMAGED = 7
"""Exit code if a damaged file could be decoded only in part."""


def arguments() -> argparse.ArgumentParser:
    """Parser of the command line."""
    p = parser("pxi-decode", "Render a .pxi file at any size and region.")
    p.epilog = f"{EXIT_CODES}  {DAMAGED} damaged, but decoded as far as it goes (--tolerant)\n"
    add_files(p, ".pxi file, or - for standard input", "picture file, type by suffix; .ora and "
              ".psd hold the layers, .svg their outlines; - writes PNG to standard output; IN with "
              "the suffix .png by default")  # fmt: skip
    add = p.add_argument
    size = p.add_mutually_exclusive_group()
    size.add_argument("--scale", type=float, help="output pixels a canvas pixel")
    size.add_argument("--fit", type=int, metavar="N", help="reduce to at most N pixels a side")
    add("--width", type=int, help="output width; the height follows")
    add("--height", type=int, help="output height; the width follows")
    add("--region", metavar="X,Y,W,H", help="part of the canvas, in its pixels")
    add("--time", type=float, metavar="S", help="the picture at S seconds of its motion; by "
        "default the still")  # fmt: skip
    add("--layer", action="append", metavar="NAME|INDEX", help="draw only this layer; repeatable")
    add("--no-background", action="store_true", help="leave out the back layer")
    add("--bit-depth", type=int, choices=[8, 16, 32], help="bits a sample, 32 = floating point; "
        "8 by default, for types of linear light 16")  # fmt: skip
    add("--srgb", action="store_true", help="convert to sRGB; by default the colours are those of "
        "the file, and OUT says what they are if it can")  # fmt: skip
    add("--engine", choices=["auto", "numpy", "native", "ort"], default="auto",
        help="who decodes; auto is the fastest that is built in, numpy is numpy alone")  # fmt: skip
    add("--tolerant", action="store_true", help="of a file that is cut off or damaged, make the "
        "picture from the levels that can be decoded, say so, and exit with 7")  # fmt: skip
    add("--export-onnx", metavar="FILE", help="write the decoder network as ONNX; of a pyramid "
        "texture the synthesis of its colours")  # fmt: skip
    add("--graph", choices=["network", "full"], help="what --export-onnx writes: that (default), "
        "or the whole renderer, from points of the canvas to colour")  # fmt: skip
    add("--sheet", metavar="FILE", help="draw all layers beside each other, with names, sizes and "
        "the cost of outlines")  # fmt: skip
    add("-j", "--jobs", type=int, metavar="N", help="of several pictures so many at once; as many "
        "as there are cores by default")  # fmt: skip
    add_limits(p)
    add_batch(p)
    add("-f", "--force", action="store_true", help="replace files that exist")
    add("--quiet", action="store_true", help="print nothing but errors")
    return p


def main(argv: list[str] | None = None) -> int:
    """Entry point; returns the exit code."""
    args = parse(arguments(), argv)
    damage: list[str] = []

    def told(report: dict[str, Any], args: argparse.Namespace, say: Callable[[str], None]) -> None:
        damage.extend(report["damage"])
        if report["seconds"] is not None and not args.quiet:
            say(f"{printable(report['output'])}: {report['seconds']:.2f} s")

    code = each(Tool("pxi-decode", ".png", takes, check, decode_file, told, hush=False), args)
    return code or (DAMAGED if damage else 0)


def takes(name: str) -> bool:
    """Whether a file in a folder is one to decode."""
    return name.lower().endswith(".pxi")


def check(args: argparse.Namespace) -> None:
    """Refuses what makes no sense for any input.

    Raises:
        UsageError: Flags need each other, or one file is to come from several inputs.
    """
    if args.graph is not None and args.export_onnx is None:
        raise UsageError("--graph needs --export-onnx")
    if args.export_onnx is not None and len(args.inputs) > 1:
        raise UsageError("--export-onnx: of several pictures, export each by itself")
    if args.sheet is not None and len(args.inputs) > 1:
        raise UsageError("--sheet: of several pictures, draw that of each by itself")


def decode_file(args: argparse.Namespace) -> dict[str, Any]:
    """Runs pxi-decode with parsed arguments for one input.

    Returns:
        ``output``; ``seconds`` of drawing it, None if nothing was drawn; and descriptions of the
        ``damage`` in the input, none for a file that is intact.

    Raises:
        PxiError: Anything that goes wrong, as the class that decides the exit code.
    """
    beside = [name for name in (args.export_onnx, args.sheet) if name is not None]
    rendering = args.output is not None or not beside
    output = target(args) if rendering else ""
    kind = Path(output).suffix.lower()
    if kind == ".pxi":
        raise UsageError(f"{output}: this draws pictures; pxi-edit writes .pxi files, and several "
                         "inputs need -o FOLDER/")  # fmt: skip
    if rendering:
        refuse_for_layers(args, kind)
        check_target(output, args.force, *args.inputs)
    else:
        refuse_render_flags(args)
    for name in beside:
        check_target(name, args.force, args.input)
    files = [*beside, *([output] if rendering else [])]
    for k, name in enumerate(files):
        if any(name == other or same_file(name, other) for other in files[:k]):
            raise UsageError(f"{name}: the picture, the sheet and the ONNX model need a file each")

    from ..api import open_image
    from ..native import kernel

    started = time.perf_counter()
    with kernel.for_engine(args.engine), about_input(args):
        image = open_image(args.input, limits_of(args), tolerant=args.tolerant)
        if args.time is not None:
            image = image.at(args.time)
        if args.export_onnx is not None:
            export(image, args)
        if args.sheet is not None:
            write_sheet(image, args)
        if rendering:
            draw(image, output, args)
    seconds = round(time.perf_counter() - started, 3) if rendering else None
    return {"output": output, "seconds": seconds, "damage": list(image.damage)}


def draw(image: Any, output: str, args: argparse.Namespace) -> None:
    """Draws an image to a file, whose suffix says whether it holds layers, outlines or pixels."""
    kind = Path(output).suffix.lower()
    if kind in LAYERED:
        layered(image, output, kind, args)
    else:
        render(image, output, args)


@contextmanager
def about_input(args: argparse.Namespace) -> Iterator[None]:
    """Context in which errors of the format name the input, and the flag that may help.

    They are found when the file is opened, or when its textures are decoded.
    """
    from ..io.files import naming

    with naming(args.input, FormatError):
        try:
            yield
        except FormatError as error:
            if not args.tolerant and error.rule != SIGNATURE:
                error.args = (f"{error}; --tolerant decodes as much as is left",)
            raise


def refuse_render_flags(args: argparse.Namespace) -> None:
    """Refuses flags that have no effect because no picture is rendered.

    Raises:
        UsageError: A rendering flag is given.
    """
    chosen = ["time", "no_background"] if args.graph == "full" else []
    chosen += ["time"] if args.sheet is not None else []
    flags = ("scale", "fit", "width", "height", "region", "time", "no_background", "bit_depth",
             "srgb")  # fmt: skip
    for name in flags:
        value = getattr(args, name)
        if value is not None and value is not False and name not in chosen:
            raise UsageError(f"--{name.replace('_', '-')} needs an output picture")
    if args.engine != "auto" and args.sheet is None:
        raise UsageError("--engine needs an output picture")


def refuse_for_layers(args: argparse.Namespace, kind: str) -> None:
    """Refuses flags that a file of layers cannot follow; such files have the size of the canvas.

    Args:
        args: The parsed command line.
        kind: Suffix of the output in lower case.

    Raises:
        UsageError: Such a flag is given.
    """
    if kind not in LAYERED:
        return
    for name in ("scale", "fit", "width", "height", "region"):
        if getattr(args, name) is not None:
            raise UsageError(f"--{name}: a {kind} file has the size of the canvas")
    if args.srgb:
        has = "is sRGB" if kind == ".svg" else "has the colours of the input"
        raise UsageError(f"--srgb: a {kind} file {has}")
    if args.time is not None and kind == ".svg":
        raise UsageError("--time: a .svg file has the outlines of the still")
    if args.bit_depth is not None and (kind == ".svg" or args.bit_depth == 32):
        raise UsageError(f"--bit-depth {args.bit_depth} makes no sense for a {kind} file")


def target(args: argparse.Namespace) -> str:
    """Name of the output picture."""
    return default_target(args.input, ".png") if args.output is None else str(args.output)


def export(image: Any, args: argparse.Namespace) -> None:
    """Writes an ONNX model of the picture.

    Raises:
        UsageError: The picture has no such model.
    """
    from ..io.files import write_atomically

    if args.graph == "full":
        from ..export import onnx_renderer

        layers = [key(n) for n in args.layer] if args.layer else None
        model = onnx_renderer.build(image, layers, not args.no_background)
    else:
        model = texture_model(image, args)
    write_atomically(args.export_onnx, model.SerializeToString())
    if not args.quiet:
        print(f"{args.export_onnx}: ONNX opset {model.opset_import[0].version}", file=sys.stderr)


def write_sheet(image: Any, args: argparse.Namespace) -> None:
    """Draws all layers beside each other."""
    from ..export.sheet import sheet_of
    from ..io.color import COLOUR
    from ..io.raster import write

    colours = {k: v for k, v in image.blocks.items() if k in COLOUR}
    sheet = sheet_of(image, args.engine, limits_of(args))
    remark(args, args.sheet, write(args.sheet, sheet, colours))
    if not args.quiet:
        print(f"{printable(args.sheet)}: {len(image.layers)} layers", file=sys.stderr)


def texture_model(image: Any, args: argparse.Namespace) -> Any:
    """ONNX model of the one decoder network, or of the one synthesis, of the chosen layers.

    Raises:
        UsageError: The layers have several networks or planes.
    """
    from ..export import onnx_network, onnx_synthesis

    layers = selected(image, args.layer)
    networks = {layer.network for layer in layers} - {None}
    planes = {layer.texture.planes for layer in layers if layer.network is None}
    if len(networks) + len(planes) > 1:
        raise UsageError(
            "the layers have several networks or planes; choose one layer with --layer"
        )
    return onnx_synthesis.build(*planes) if planes else onnx_network.build(*networks)


def selected(image: Any, names: list[str] | None) -> list[Any]:
    """Layers that --layer names; all by default."""
    return [image.layers[key(n)] for n in names] if names else list(image.layers)


def render(image: Any, output: str, args: argparse.Namespace) -> None:
    """Renders and writes the picture."""
    import numpy as np

    from ..io.color import COLOUR, is_srgb, to_srgb
    from ..io.oiio import LINEAR
    from ..io.raster import write
    from ..io.samples import rounded
    from ..render.view import make_view

    region = parse_region(args.region)
    scale = args.scale
    if args.fit is not None:
        if args.fit < 1:
            raise UsageError(f"--fit {args.fit}: must be at least 1")
        sides = region[2:] if region else (image.width, image.height)
        scale = min(1.0, args.fit / max(1, *sides))
    view = make_view((image.width, image.height), args.width, args.height, scale, region)
    bar = Bar(view.width * view.height, "rendering", args.quiet or args.batch)
    depth = args.bit_depth or (16 if Path(output).suffix.lower() in LINEAR else 8)
    dtype = {8: np.uint8, 16: np.uint16, 32: np.float32}[depth]
    converted = args.srgb and not is_srgb(image.blocks)
    try:
        pixels = image.render(
            width=view.width,
            height=view.height,
            region=region,
            layers=[key(n) for n in args.layer] if args.layer else None,
            background=not args.no_background,
            dtype=np.float32 if converted else dtype,
            engine=args.engine,
            limits=limits_of(args),
            progress=bar.advance,
        )
    finally:
        bar.close()
    blocks = image.blocks
    if converted:
        pixels = rounded(to_srgb(pixels, blocks), dtype)
        blocks = {k: v for k, v in blocks.items() if k not in COLOUR}
    nameless = is_stream(output) and not Path(output).suffix
    remark(args, output, write(output, pixels, blocks, ".png" if nameless else None))


def remark(args: argparse.Namespace, output: str, notes: Iterable[str]) -> None:
    """Warns about an output, unless --quiet."""
    for note in () if args.quiet else notes:
        logging.getLogger(__name__).warning("%s: %s", output, note)


def layered(image: Any, output: str, kind: str, args: argparse.Namespace) -> None:
    """Writes the layers as OpenRaster or for Photoshop, or their outlines as SVG."""
    from ..io.color import COLOUR
    from ..io.files import write_atomically
    from ..io.raster import losses

    layers = [key(n) for n in args.layer] if args.layer else None
    wanted = {"layers": layers, "background": not args.no_background, "engine": args.engine}
    lost = [name for name in image.blocks if name not in COLOUR]
    if kind == ".svg":
        from ..export.svg import build as build_svg

        write_atomically(output, build_svg(image, **wanted))
        remark(args, output, losses(kind, lost))
        return
    from ..export import openraster, photoshop

    build = photoshop.build if kind == ".psd" else openraster.build
    bar = Bar(len(selected(image, args.layer)), "layers", args.quiet or args.batch)
    try:
        dtype = "uint16" if args.bit_depth == 16 else "uint8"
        limits = limits_of(args)
        data = build(image, **wanted, dtype=dtype, limits=limits, progress=bar.advance)
    finally:
        bar.close()
    write_atomically(output, data)
    remark(args, output, losses(kind, lost))


def parse_region(text: str | None) -> tuple[int, int, int, int] | None:
    """Parses --region: x, y, width and height in canvas pixels, or None.

    Raises:
        UsageError: The text is not four integers.
    """
    if text is None:
        return None
    try:
        x, y, w, h = (int(part) for part in text.split(","))
    except ValueError:
        raise UsageError(f"--region {text}: must be X,Y,W,H in whole canvas pixels") from None
    return x, y, w, h


if __name__ == "__main__":
    sys.exit(main())

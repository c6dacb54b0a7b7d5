"""Inputs of pxi-encode that have layers of their own."""

from __future__ import annotations

import argparse
import logging
import os
from dataclasses import replace
from pathlib import Path
from typing import Any

from .prompt_flags import FLAGS

DECOMPOSITION = (
    "masks", *FLAGS, "layers", "max_layers", "segmenter", "depth", "matte", "frame", "tone",
)  # fmt: skip
"""Flags that make layers of a flat picture, or choose one of several."""


def layered_input(source: bytes, name: str, args: argparse.Namespace) -> Any:
    """Reads an input in layers.

    Args:
        source: Bytes of the file; none of a folder.
        name: Name of the input in messages.
        args: The parsed command line.

    Returns:
        The `LayeredPicture`; None if the input is a flat picture, or is to be taken as one.

    Raises:
        PxiError: It cannot be read, or flags make no sense for it.
    """
    from ..encoder.layered.folder import read_folder
    from ..encoder.layered.openraster import is_openraster, read_openraster
    from ..encoder.layered.photoshop import has_reader, is_photoshop, read_photoshop
    from ..errors import UsageError

    if args.stack:
        if not os.path.isdir(args.input):
            raise UsageError(f"{name}: --stack takes a folder of pictures, one a layer")
        refuse_for_layers(args)
        return read_folder(Path(args.input))
    if is_openraster(source) or Path(args.input).suffix.lower() == ".ora":
        refuse_for_layers(args)
        return read_openraster(source, name, blend=args.blend)
    flat = args.background != "auto" or given(args)
    if not is_photoshop(source) or flat:
        return None
    if args.behind is not None:
        refuse_for_layers(args)
    if not has_reader():
        warn(args, name, "it is taken flat; pip install 'proxyimg-codec[psd]' to keep its layers")
        return None
    return read_photoshop(source, name, blend=args.blend)


def given(args: argparse.Namespace) -> list[str]:
    """Flags of the command line that are for flat pictures."""
    found = [name for name in DECOMPOSITION if getattr(args, name) is not None]
    return [f"--{name.replace('_', '-')}" for name in found]


def refuse_for_layers(args: argparse.Namespace) -> None:
    """Refuses flags about decomposition, which an input in layers does not need.

    Its layers are kept, and they hide nothing that would have to be completed.

    Raises:
        UsageError: Such a flag is given.
    """
    from ..errors import UsageError

    for flag in given(args):
        raise UsageError(f"{flag}: the input has layers of its own, which are kept")
    for name in ("background", "behind"):
        if getattr(args, name) not in ("auto", None):
            raise UsageError(f"--{name}: the layers of the input hide nothing unknown")


def encoded_layers(
    layered: Any, name: str, args: argparse.Namespace, settings: Any, progress: Any
) -> tuple[Any, Any]:
    """Encodes a `LayeredPicture`, and warns of what is different from the input.

    Returns:
        The encoded picture, and the original pixels [H, W, 4] of all layers together.
    """
    from ..encoder.import_layers import composite, encode_layers
    from ..io.color import is_srgb

    if args.strip:
        if not is_srgb(layered.blocks):
            warn(args, name, "without its profile its colours look wrong")
        layered = replace(layered, blocks={})
    for note in layered.notes:
        warn(args, name, note)
    image, kept = encode_layers(layered, settings, progress)
    for layer in kept.left_out:
        warn(args, name, f"layer {layer!r} has nothing to be seen; left out")
    return image, composite(layered)


def warn(args: argparse.Namespace, name: str, text: str) -> None:
    """Warns about an input, unless --quiet is given."""
    if not args.quiet:
        logging.getLogger(__name__).warning("%s: %s", name, text)

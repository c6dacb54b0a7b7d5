"""Contents as files in the folder of a session, and back."""

from __future__ import annotations

import io
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from ..codec.write import serialized
from ..encoder.shapes.masks import Region
from ..errors import PxiError
from ..io import raster
from ..limits import Limits
from .autosave import Folder
from .content import Content
from .document import Document
from .pointing import Hints, Pointing

PICTURE, SOURCE, REGIONS = "picture.pxi", "source.npz", "regions.npz"


def written(folder: Folder, content: Content, more: Mapping[str, Any]) -> None:
    """Writes a content to the folder of its session.

    Args:
        folder: The folder.
        content: The content.
        more: More values of the state, such as the path of the file.

    Raises:
        InputError: It cannot be written.
    """
    state: dict[str, Any] = {
        **more, "version": 1, "file": content.file, "origin": content.path,
        "base": content.base, "kept": content.kept,
        "settings": None if content.settings is None else dict(content.settings),
    }  # fmt: skip
    parts: dict[str, bytes] = {}
    if content.document is not None:
        state["at"] = content.document.at
        parts[PICTURE] = serialized(content.document.last)
    if content.pointing is not None:
        pointing = content.pointing
        state["regions"] = [region.name for region in pointing.regions]
        state["found"] = pointing.found
        state["hints"] = {
            name: {"inside": told.inside, "outside": told.outside, "box": told.box}
            for name, told in pointing.hints.items()
        }
        state["source"] = True
        if folder.held is not pointing.raster:
            parts[SOURCE] = _packed(
                pixels=pointing.raster.pixels,
                **{k: np.frombuffer(v, np.uint8) for k, v in pointing.raster.blocks.items()},
            )
        parts[REGIONS] = _packed(**_masks(pointing))
    folder.write(state, parts)
    folder.held = None if content.pointing is None else content.pointing.raster


def _packed(**arrays: Any) -> bytes:
    out = io.BytesIO()
    np.savez(out, **arrays)
    return out.getvalue()


def _masks(pointing: Pointing) -> dict[str, Any]:
    """Masks of regions and hints, as bits."""
    found: dict[str, Any] = {}
    for k, region in enumerate(pointing.regions):
        found[f"region{k}"] = np.packbits(region.mask)
    for k, told in enumerate(pointing.hints.values()):
        for name, mask in (("strokes", told.strokes), ("mask", told.mask)):
            if mask is not None:
                found[f"{name}{k}"] = np.packbits(mask)
    return found


def recovered(folder: Folder, limits: Limits) -> Content | None:
    """Reads the content that was written last to a folder; None if there is none."""
    state = folder.state()
    if state is None or state.get("version") != 1:
        return None
    try:
        content = Content(
            str(state["file"]), state["origin"], settings=state["settings"],
            base=int(state["base"]), kept=int(state["kept"]),
        )  # fmt: skip
        if state.get("source"):
            content = replace(content, pointing=_pointing(folder, state))
        if "at" in state:
            document = Document.parsed(folder.read(PICTURE), limits, int(state["at"]))
            content = replace(content, document=document)
    except (PxiError, KeyError, TypeError, ValueError, OSError):
        return None
    return None if content.stage == "empty" else content


def _pointing(folder: Folder, state: Mapping[str, Any]) -> Pointing:
    with np.load(io.BytesIO(folder.read(SOURCE)), allow_pickle=False) as source:
        pixels = source["pixels"]
        blocks = {k: source[k].tobytes() for k in source.files if k != "pixels"}
    height, width = pixels.shape[:2]
    with np.load(io.BytesIO(folder.read(REGIONS)), allow_pickle=False) as masks:

        def mask(name: str) -> Any:
            if name not in masks.files:
                return None
            bits = np.unpackbits(masks[name], count=height * width)
            return bits.astype(bool).reshape(height, width)

        regions = tuple(Region(n, mask(f"region{k}")) for k, n in enumerate(state["regions"]))
        hints = {
            name: Hints(
                tuple(map(tuple, told["inside"])), tuple(map(tuple, told["outside"])),
                None if told["box"] is None else tuple(told["box"]),
                mask(f"strokes{k}"), mask(f"mask{k}"),
            )
            for k, (name, told) in enumerate(state["hints"].items())
        }  # fmt: skip
    return Pointing(raster.Picture(pixels, blocks, ()), regions, hints, bool(state["found"]))

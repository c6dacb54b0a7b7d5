"""State of a session as the page sees it: JSON values, see `README.md`."""

from __future__ import annotations

import json
import math
from typing import Any

from ..edit.transforms import bounds
from ..geometry.pose import COLOUR_BITS, OPACITY_MAX
from ..model import Layer, Picture
from ..texture.pyramid import PyramidTexture
from . import words
from .content import Content
from .drawing import mesh_key, rest_box, texture_key
from .pointing import prompter

Numbers = dict[int, tuple[Any, int]]


def described(content: Content, numbers: Numbers, prefix: str) -> dict[str, Any]:
    """Describes a content.

    Args:
        content: The content.
        numbers: Numbers of textures, as for `drawing.texture_key`; grows.
        prefix: Beginning of the keys of textures, different for each session.
    """
    facts = {
        "stage": content.stage, "name": content.name, "file": content.file,
        "recovered": content.recovered,
    }  # fmt: skip
    if content.stage == "pointing":
        return facts | _pointing(content)
    if content.stage == "editing":
        return facts | _editing(content, numbers, prefix)
    return facts


def _pointing(content: Content) -> dict[str, Any]:
    pointing = content.pointed
    python = (
        "import proxyimg_codec as pxi\n"
        f"# masks: arrays by name, back to front\nimage = pxi.encode(pixels, masks=masks)\n"
        f"image.save({content.name + '.pxi'!r})\n"
    )
    return {
        "size": list(pointing.size), "regions": pointing.described(), "prompter": prompter(),
        "found": pointing.found, "can_undo": bool(content.past),
        "can_redo": bool(content.future),
        "command": encode_line(content), "python": python,
    }  # fmt: skip


def encode_line(content: Content) -> str:
    """Command line of pxi-encode that makes the document of the file that was opened."""
    flags = [
        word for key, value in {"effort": 2, **(content.settings or {})}.items()
        for word in (f"--{key.replace('_', '-')}", str(value))
    ]  # fmt: skip
    masks = [] if content.pointing is None else ["--masks", f"{content.name}-masks"]
    return words.command(["pxi-encode", content.file, f"{content.name}.pxi", *masks, *flags])


def _editing(content: Content, numbers: Numbers, prefix: str) -> dict[str, Any]:
    document = content.edited
    picture = document.picture
    groups = tuple(picture.groups)
    history = [_step(edit, groups) for edit in document.edits]
    return {
        "size": list(picture.size), "opaque": picture.opaque,
        "layers": [
            _layer(picture, k, numbers, prefix) for k in range(len(picture.layers))
        ],
        "groups": [{"name": n, "parent": p} for n, p in picture.groups.items()],
        "timeline": _timeline(picture), "history": history, "at": document.at,
        "raster": content.pointing is not None,
        "command": _command(content), "python": _python(content, groups),
    }  # fmt: skip


def _step(edit: Any, groups: tuple[str, ...]) -> dict[str, Any]:
    flags = words.flags(edit)
    return {
        "op": edit, "label": words.label(edit),
        "flags": None if flags is None else words.command(flags),
        "python": words.python(edit, groups),
    }  # fmt: skip


def _layer(picture: Picture, index: int, numbers: Numbers, prefix: str) -> dict[str, Any]:
    layer = picture.layers[index]
    pose = layer.pose
    x0, y0, x1, y1 = bounds(picture, [layer])
    return {
        "index": index, "name": layer.name, "parent": layer.parent, "hidden": pose.hidden,
        "opacity": round(pose.opacity / OPACITY_MAX, 4), "recoloured": bool(pose.colour),
        "bounds": [math.floor(x0), math.floor(y0), math.ceil(x1), math.ceil(y1)],
        "box": list(rest_box(picture, layer)), "matrix": list(pose.floats),
        "colour": [v / (1 << COLOUR_BITS) for v in pose.colour] or None,
        "bent": pose.bent, "moves": layer.track is not None,
        "nodes": 0 if layer.mesh is None else len(layer.mesh.refined.nodes),
        "paths": [] if layer.boundary is None else layer.boundary.segments,
        "texture": f"{prefix}-{texture_key(layer, numbers)}", "mesh": mesh_key(picture, layer),
        "can_complete": _can_complete(layer),
    }  # fmt: skip


def _can_complete(layer: Layer) -> bool:
    """Whether something of the layer is hidden, which `complete` can continue."""
    texture = layer.texture
    if not isinstance(texture, PyramidTexture) or texture.shown is None:
        return False
    return not texture.cuts or bool(texture.cuts.fronts)


def _timeline(picture: Picture) -> dict[str, Any] | None:
    line = picture.timeline
    if line is None:
        return None
    return {
        "seconds": line.seconds, "fps": line.fps, "loop": line.loop,
        "motion": json.loads(line.script) if line.script else None,
    }  # fmt: skip


def _command(content: Content) -> str:
    """Command lines that make the picture as it is now of the file that was opened."""
    document, name = content.edited, f"{content.name}.pxi"
    kept = min(content.kept, document.at)
    flags = ["--undo", str(content.base - kept)] if content.base > kept else []
    for edit in document.edits[kept : document.at]:
        said = words.flags(edit)
        if said is None:
            flags = ["--script", f"{content.name}.json"]
            break
        flags += said
    lines = [] if content.file.lower().endswith(".pxi") else [encode_line(content)]
    if flags:
        lines.append(words.command(["pxi-edit", name, "edited.pxi", *flags]))
    return "\n".join(lines)


def _python(content: Content, groups: tuple[str, ...]) -> str:
    document = content.edited
    kept = min(content.kept, document.at)
    lines = ["import proxyimg_codec as pxi", f"image = pxi.open({content.name + '.pxi'!r})"]
    if content.base > kept:
        lines.append(f"image = image.undone({content.base - kept})")
    lines += [
        f"image = image{words.python(edit, groups)}"
        for edit in document.edits[kept : document.at]
    ]  # fmt: skip
    return "\n".join([*lines, "image.save('edited.pxi')", ""])

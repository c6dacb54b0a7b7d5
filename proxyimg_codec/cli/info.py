"""pxi-info: describes a .pxi file. It needs neither numpy nor the pixels."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Mapping
from typing import Any

from ..container import texr
from ..container.chunks import VERSION
from ..container.content import Container
from ..container.file import parse
from ..io.files import naming, read_bytes
from ..native import levels
from .common import add_limits, limits_of, parser, printable, run

CODERS = {texr.IMPLICIT: "implicit", texr.PYRAMID: "pyramid"}
VIEWED = ("grid", "bits", "network", "planes", "part", "cuts", "grain")
"""Fields of textures that are printed unchanged; each coder has only some of them."""

SAMPLINGS = ("direct", "node", "node, local only", "node, global only")


def arguments() -> argparse.ArgumentParser:
    """Parser of the command line."""
    p = parser("pxi-info", "Describe a .pxi file.", str(levels.chosen()))
    p.add_argument("input", metavar="IN", help=".pxi file, or - for standard input")
    add_limits(p)
    p.add_argument("--json", action="store_true", help="print JSON")
    return p


def main(argv: list[str] | None = None) -> int:
    """Entry point; returns the exit code."""
    args = arguments().parse_args(argv)
    return run("pxi-info", lambda: show(args))


def show(args: argparse.Namespace) -> None:
    """Prints the description of a file.

    Raises:
        PxiError: The file cannot be read.
    """
    limits = limits_of(args)
    with naming(args.input):
        data = read_bytes(args.input)
        facts = describe(parse(data, limits), len(data))
    print(json.dumps(facts, indent=2) if args.json else text(facts))


def describe(c: Container, size: int) -> dict[str, Any]:
    """Facts about a file, ready for JSON.

    Args:
        c: The parsed file.
        size: Its size in bytes.
    """
    width, height = c.head["size"]
    return {
        "version": f"{VERSION[0]}.{VERSION[1]}",
        "bytes": size,
        "bpp": round(8 * size / (width * height), 4),
        "width": width,
        "height": height,
        "alpha": not c.head["opaque"],
        "depth": c.head["depth"],
        "layers": _layers(c),
        "networks": [_network(n) for n in c.networks],
        "planes": [_planes(p) for p in c.planes],
        "motion": _motion(c),
        "groups": c.tree["groups"] if c.tree else [],
        "edits": [step.operation for step in c.history],
        "metadata": {name: len(block) for name, block in c.blocks.items()},
        "cicp": dict(c.cicp) if c.cicp else None,
        "chunk_bytes": dict(c.sizes),
        "encoder": (c.info or {}).get("encoder"),
        "settings": settings(c),
    }


def _layers(c: Container) -> list[dict[str, Any]]:
    """Facts about each layer."""
    areas = (c.info or {}).get("areas") or [None] * len(c.layers)
    meshes = {m["layer"]: m for m in c.meshes}
    poses = {p["layer"]: p for p in c.poses}
    moving = c.motion["layers"] if c.motion else []
    return [
        {
            "name": layer["name"],
            "box": list(layer["box"]),
            "area": area,
            "segments": sum(layer["segments"]),
            **_texture(c, i),
            "vertices": meshes[i]["vertices"] if i in meshes else None,
            "pose": _pose(poses[i]) if i in poses else None,
            "boundary_bytes": len(layer["classes"]) + len(layer["deltas"]),
            "moves": i in moving,
            "mesh_bytes": _bytes(meshes.get(i)),
            "pose_bytes": _bytes(poses.get(i)),
            "texture_bytes": _texture_bytes(c, i),
        }
        for i, (layer, area) in enumerate(zip(c.layers, areas, strict=True))
    ]


def _texture(c: Container, i: int) -> dict[str, Any]:
    """Facts about the texture of layer `i`."""
    texture = c.texture_of(i)
    return {
        "coder": CODERS[texture["coder"]],
        **{k: texture.get(k) for k in VIEWED},
        **{k: texture[k] - 1 if texture.get(k) else None for k in texr.PLANES},
        "offsets": len(texture["offsets"]) // 2 if "offsets" in texture else None,
        "sampling": SAMPLINGS[c.layers[i]["sampling"]],
        "shares": c.textures[i].get("texture"),
    }


def _texture_bytes(c: Container, i: int) -> int:
    """Bytes of the coded parts of the texture of layer `i`; 0 if it is that of another layer."""
    texture = c.texture_of(i)
    if texture is not c.textures[i]:
        return 0
    return sum(len(texture.get(k, b"")) for k in ("codes", "stored", "mask", "sources"))


def _network(n: Mapping[str, Any]) -> dict[str, Any]:
    """Facts about a network."""
    told = {k: n[k] for k in ("dim", "octaves", "hidden", "depth", "channels", "bits")}
    return {**told, "bytes": len(n["weights"]) + len(n["steps"]) + len(n["biases"])}


def _planes(p: Mapping[str, Any]) -> dict[str, Any]:
    """Facts about planes."""
    told = {k: p[k] for k in ("model", "size", "components", "levels")}
    return {**told, "q": round(2 ** (p["step"] / 64), 3), "bytes": _bytes(p)}


def _bytes(fields: Mapping[str, Any] | None) -> int:
    """Bytes of the coded parts of a chunk."""
    return sum(len(v) for v in (fields or {}).values() if isinstance(v, bytes))


def _motion(c: Container) -> dict[str, Any] | None:
    """Facts about the motion of a picture without its curves; None if it has no motion."""
    m = c.motion
    if m is None:
        return None
    return {
        "seconds": m["duration"] / 1000,
        "loop": bool(m["loop"]),
        "fps": m["fps"],
        "layers": [c.layers[i]["name"] for i in m["layers"]],
        "bodies": list(m["bodies"]),
        "intervals": m["intervals"],
        "modes": m["modes"],
        "script_bytes": m["size"],
        "bytes": _bytes(m),
    }


def _pose(fields: Mapping[str, Any]) -> list[str]:
    """Words for what a pose changes, such as ``moved`` and ``bent``."""
    return [
        name
        for name, done in (
            ("moved", fields["matrix"] != [1 << 24, 0, 0, 1 << 24] or fields["shift"] != [0, 0]),
            ("bent", bool(fields["node_classes"])),
            ("retextured", bool(fields["place_classes"])),
            ("translucent", fields["opacity"] < 65535),
            ("hidden", bool(fields["hidden"])),
            ("recoloured", bool(fields["colour"])),
        )
        if done
    ]


def settings(c: Container) -> Any:
    """Settings of the encoder; None if the file has none, or they are not valid JSON."""
    try:
        return json.loads(c.info["settings"]) if c.info else None
    except (ValueError, RecursionError):
        return None


def text(f: dict[str, Any]) -> str:
    """Formats the facts of `describe` as text."""
    alpha = "with transparency" if f["alpha"] else "opaque"
    chunks = ", ".join(f"{name} {size}" for name, size in f["chunk_bytes"].items())
    lines = [
        f"pxi {f['version']}, {f['width']}x{f['height']}, {alpha}, {f['depth']}-bit original",
        f"{f['bytes']} bytes, {f['bpp']:.3f} bpp: {chunks}",
    ]
    lines += [f"layer {i} {_layer_text(v)}" for i, v in enumerate(f["layers"])]
    lines += [f"network {i}: {_network_text(n)}" for i, n in enumerate(f["networks"])]
    lines += [f"planes {i}: {_planes_text(p)}" for i, p in enumerate(f["planes"])]
    if f["motion"]:
        lines.append(f"motion: {_motion_text(f['motion'])}")
    if f["groups"]:
        lines.append(f"groups: {', '.join(map(repr, f['groups']))}")
    lines += [f"edit {i}: {printable(v)}" for i, v in enumerate(f["edits"], 1)]
    if f["cicp"]:
        two = f["cicp"]
        lines.append(f"colour: primaries {two['primaries']}, transfer {two['transfer']} of H.273")
    lines += [f"{name}: {size} bytes" for name, size in f["metadata"].items()]
    if f["encoder"]:
        lines.append(f"made by {f['encoder']!r}, {json.dumps(f['settings'])}")
    return "\n".join(lines)


def _layer_text(v: dict[str, Any]) -> str:
    x, y, w, h = v["box"]
    area = "" if v["area"] is None else f", {v['area']} px visible"
    outline = f"{v['segments']} segments" if v["segments"] else "whole canvas"
    mesh = "" if v["vertices"] is None else f", {v['vertices']} vertices"
    sampling = "" if v["sampling"] == "direct" else f" ({v['sampling']})"
    shares = "" if v["shares"] is None else f" shared with layer {v['shares']}"
    pose = "" if v["pose"] is None else f", {' and '.join(v['pose'])}"
    sizes = [v[f"{part}_bytes"] for part in ("boundary", "mesh", "pose", "texture")]
    return (
        f"{v['name']!r}: {w}x{h} at {x},{y}{area}, {outline}{mesh}{pose}, "
        f"{v['coder']}{sampling} {_texture_text(v)}"
        f"{shares}, {' + '.join(str(n) for n in sizes if n) or 0} bytes"
    )


def _texture_text(layer: dict[str, Any]) -> str:
    if layer["part"] is None:
        return f"{layer['grid'][0]}x{layer['grid'][1]} codes of {layer['bits']} bits"
    x, y, width, height = layer["part"]
    alpha = "" if layer["alpha"] is None else f" with alpha of planes {layer['alpha']}"
    outlines = ", ".join(str(n) for n in layer["cuts"])
    cuts = f" cut by layer{'s' * (len(layer['cuts']) > 1)} {outlines}" if outlines else ""
    own = "" if layer["behind"] is None else f", planes {layer['behind']} behind"
    if layer["behind_alpha"] is not None:
        own += f" with alpha of planes {layer['behind_alpha']}"
    if layer["matte"] is not None:
        own += f", soft by planes {layer['matte']}"
    if layer["offsets"]:
        own += f", {layer['offsets']} offsets for cells of {1 << layer['grain']} samples"
    return f"{width}x{height} samples at {x},{y} of planes {layer['planes']}{alpha}{cuts}{own}"


def _network_text(n: dict[str, Any]) -> str:
    return (
        f"{n['dim']} features, {n['octaves']} octaves, {n['depth']} hidden layers "
        f"of {n['hidden']}, {n['channels']} outputs, {n['bits']} bits, {n['bytes']} bytes"
    )


def _planes_text(p: dict[str, Any]) -> str:
    columns, rows = p["size"]
    colours = "grey" if p["components"] == 1 else "RGB"
    return (
        f"{columns}x{rows} {colours} samples, {p['levels']} levels, step {p['q']:g}, "
        f"model {p['model']}, {p['bytes']} bytes"
    )


def _motion_text(m: dict[str, Any]) -> str:
    loop = ", in a loop" if m["loop"] else ""
    return (
        f"{', '.join(map(repr, m['layers']))} for {m['seconds']:g} s{loop}, made for "
        f"{m['fps']} frames a second, {m['modes']} shapes, {m['intervals']} intervals, "
        f"{m['bytes']} bytes"
    )


if __name__ == "__main__":
    sys.exit(main())

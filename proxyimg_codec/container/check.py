"""What chunks must agree on, and the budget that all of them share."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..errors import FormatError, UnsupportedError
from ..limits import Limits
from . import mesh, pose, texr

if TYPE_CHECKING:
    from .file import Container


def check(c: Container, limits: Limits) -> None:
    """Checks a parsed file.

    Raises:
        FormatError: They contradict each other.
        UnsupportedError: They need a newer reader.
        LimitError: They exceed `limits`.
    """
    for name in ("layers", "networks"):
        limits.check(name, c.head[name])
    limits.check("side", max(c.head["size"]))
    counts = {"layers": len(c.layers), "networks": len(c.networks)}
    for name, count in counts.items():
        if count != c.head[name]:
            raise FormatError(f"HEAD announces {c.head[name]} {name}, the file has {count}")
    if len(c.textures) != len(c.layers):
        raise FormatError(f"{len(c.layers)} layers, but {len(c.textures)} textures")
    if c.head["depth"] not in (8, 16):
        raise FormatError("depth is neither 8 nor 16", "chunk HEAD")
    if len({layer["name"] for layer in c.layers}) < len(c.layers):
        raise FormatError("two layers have the same name", "chunk LAYR")
    if c.info and len(c.info["areas"]) not in (0, len(c.layers)):
        raise FormatError("the number of areas is not that of the layers", "chunk iNFO")
    limits.check("segments", sum(sum(layer["segments"]) for layer in c.layers))
    limits.check("gates", sum(values["gates"] for values in c.meshes))
    _check_layers(c)
    _check_tree(c)
    parameters = 0
    for net in c.networks:
        if net["channels"] > c.head["channels"]:
            raise FormatError("more channels than HEAD has", "chunk NETW")
        width = net["hidden"]
        encoded = net["dim"] * (2 * net["octaves"] + 1)
        parameters += (encoded + 1) * width + (net["depth"] - 1) * (width + 1) * width
        parameters += (width + 1) * net["channels"]
    limits.check("parameters", parameters)
    codes = 0
    for i, (layer, own) in enumerate(zip(c.layers, c.textures, strict=True)):
        if min(layer["box"][2:]) < 1:
            raise FormatError("the box is empty", "chunk LAYR")
        if own["coder"] == texr.SHARED and own["texture"] >= i:
            raise FormatError("a shared texture is not that of an earlier layer", "chunk TEXR")
        texture = c.texture_of(i)
        node = (layer["sampling"] == 1, c.layers[own.get("texture", i)]["sampling"] == 1)
        if node[0] != node[1]:
            raise FormatError("a shared texture has another number of features", "chunk TEXR")
        if texture["coder"] == texr.SHARED:
            raise FormatError("a shared texture is shared itself", "chunk TEXR")
        if texture["network"] >= len(c.networks):
            raise FormatError(f"network {texture['network']} does not exist", "chunk TEXR")
        net = c.networks[texture["network"]]
        if layer["sampling"] == 1 and net["dim"] % 2:
            raise FormatError("node sampling needs an even number of features", "chunk LAYR")
        if i == 0 and c.head["opaque"] and net["channels"] != 3:
            raise FormatError("the back layer of an opaque file gives alpha", "chunk TEXR")
        if own is texture:
            columns, rows = texture["grid"]
            limits.check("wavefronts", columns + 2 * rows)
            codes += columns * rows * int(net["dim"])
    limits.check("codes", codes)


def _check_layers(c: Container) -> None:
    """Checks what MESH, POSE and LAYR must agree on."""
    for type_, values in ((mesh.TYPE, c.meshes), (pose.TYPE, c.poses)):
        numbers = [v["layer"] for v in values]
        if numbers != sorted(set(numbers)) or (numbers and numbers[-1] >= len(c.layers)):
            raise FormatError("layers do not ascend, or do not exist", f"chunk {type_}")
    meshed = {v["layer"] for v in c.meshes}
    for i, layer in enumerate(c.layers):
        if layer["sampling"] > 3:
            raise UnsupportedError(f"chunk LAYR: sampling {layer['sampling']} is not known")
        if layer["sampling"] in (1, 2) and i not in meshed:
            raise FormatError("node sampling needs a mesh", "chunk LAYR")
    if c.head["opaque"]:
        back = c.poses[0] if c.poses and c.poses[0]["layer"] == 0 else None
        still = back is None or (
            back["matrix"] == [1 << 24, 0, 0, 1 << 24]
            and back["shift"] == [0, 0]
            and back["opacity"] == 65535
            and not back["hidden"]
            and not back["node_classes"]
        )
        if c.layers[0]["segments"] or not still:
            raise FormatError("the back layer of an opaque file does not cover the canvas")


def _check_tree(c: Container) -> None:
    if c.tree is None:
        return
    groups, parents = c.tree["groups"], c.tree["parents"]
    if len({*groups, *(v["name"] for v in c.layers)}) < len(groups) + len(c.layers):
        raise FormatError("a group has the name of another group or a layer", "chunk tREE")
    if len(parents) != len(c.layers) + len(groups) or max(parents) > len(parents):
        raise FormatError("the parents do not fit the layers and groups", "chunk tREE")
    # Each walk upwards ends where another has been: the time is linear in the nodes.
    walked = [0] * (len(parents) + 1)
    for start in range(1, len(walked)):
        node = start
        while node and not walked[node]:
            walked[node] = start
            node = parents[node - 1]
        if node and walked[node] == start:
            raise FormatError("a group or layer is part of itself", "chunk tREE")

"""Checks across chunks: their agreement with each other, and the budget that they share."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from math import prod

from ..errors import FormatError, UnsupportedError
from ..limits import Budget
from . import mesh, pose, texr
from .content import Container, Values


def check(c: Container, budget: Budget) -> None:
    """Checks that the chunks of a parsed file agree, and spends what they will cost to decode.

    Args:
        c: The parsed file.
        budget: The running budget of this file.

    Raises:
        FormatError: Two chunks contradict each other, or a chunk breaks a rule.
        UnsupportedError: A chunk needs a newer reader.
        LimitError: The chunks exceed `budget`.
    """
    for name in ("layers", "networks"):
        budget.check(name, c.head[name])
    budget.check("side", max(c.head["size"]))
    counts = {"layers": len(c.layers), "networks": len(c.networks)}
    for name, count in counts.items():
        if count != c.head[name]:
            raise FormatError(
                f"HEAD announces {c.head[name]} {name}, the file has {count}", rule="CHK-4"
            )
    if len(c.textures) != len(c.layers):
        raise FormatError(f"{len(c.layers)} layers, but {len(c.textures)} textures", rule="CHK-4")
    if c.head["depth"] not in (8, 16):
        raise FormatError("depth is neither 8 nor 16", "chunk HEAD", rule="CHK-2")
    if len({layer["name"] for layer in c.layers}) < len(c.layers):
        raise FormatError("two layers have the same name", "chunk LAYR", rule="CHK-5")
    if c.info and len(c.info["areas"]) not in (0, len(c.layers)):
        raise FormatError(
            "the number of areas is not that of the layers", "chunk iNFO", rule="CHK-17"
        )
    budget.check("metadata_bytes", decompressed(c))
    budget.spend("segments", sum(sum(layer["segments"]) for layer in c.layers))
    budget.spend("gates", sum(values["gates"] for values in c.meshes))
    _check_layers(c)
    _check_tree(c)
    _check_motion(c, budget)
    _check_networks(c, budget)
    _check_planes(c, budget)
    _check_textures(c, budget)


def decompressed(c: Container) -> int:
    """Size in bytes of the metadata blocks and the motion script, decompressed."""
    return sum(map(len, c.blocks.values())) + (c.motion["size"] if c.motion else 0)


def _check_motion(c: Container, budget: Budget) -> None:
    """Checks mOTN against the layers and meshes."""
    if c.motion is None:
        return
    numbers, meshed = c.motion["layers"], {values["layer"] for values in c.meshes}
    if not numbers or any(b <= a for a, b in pairwise(numbers)):
        raise FormatError(
            "the layers that move are none or not ascending", "chunk mOTN", rule="MOT-1"
        )
    for number in numbers:
        if number not in meshed:
            raise FormatError(f"layer {number} moves, but has no mesh", "chunk mOTN", rule="MOT-1")
    if len(c.motion["bodies"]) != len(numbers):
        raise FormatError(
            "the number of bodies is not that of the layers", "chunk mOTN", rule="MOT-1"
        )
    if c.head["opaque"] and numbers[0] == 0:
        raise FormatError("the back layer of an opaque file moves", "chunk mOTN", rule="MOT-1")
    if bool(c.motion["size"]) != bool(c.motion["script"]):
        raise FormatError("the script and its size do not fit", "chunk mOTN", rule="MOT-1")
    # Only a lower bound is checked here: what nodes cost is known, and all of it is spent, once the
    # meshes are decoded.
    coefficients = len(numbers) * (c.motion["intervals"] + (0 if c.motion["loop"] else 3))
    budget.check("wavefronts", coefficients + 2)
    budget.check("motion", c.motion["modes"] * coefficients)


def _check_networks(c: Container, budget: Budget) -> None:
    for net in c.networks:
        if net["channels"] > c.head["channels"]:
            raise FormatError("more channels than HEAD has", "chunk NETW", rule="CHK-12")
        width = net["hidden"]
        encoded = net["dim"] * (2 * net["octaves"] + 1)
        parameters = (encoded + 1) * width + (net["depth"] - 1) * (width + 1) * width
        budget.spend("parameters", parameters + (width + 1) * net["channels"])


def _check_planes(c: Container, budget: Budget) -> None:
    """Checks that textures use every PLAN, and spends what decoding them costs."""
    for planes in c.planes:
        columns, rows = (-(-n >> planes["levels"]) << planes["levels"] for n in planes["size"])
        budget.spend("wavefronts", columns + 3 * rows)
        budget.spend("samples", columns * rows)
    unused = set(range(len(c.planes)))
    for texture in c.textures:
        if texture["coder"] == texr.PYRAMID:
            for number in texr.planes_of(texture):
                if number >= len(c.planes):
                    raise FormatError(f"planes {number} do not exist", "chunk TEXR", rule="PYR-3")
                unused.discard(number)
    if unused:
        raise FormatError(f"planes {min(unused)} are not used", "chunk PLAN", rule="PYR-3")


def _check_textures(c: Container, budget: Budget) -> None:
    for i, (layer, own) in enumerate(zip(c.layers, c.textures, strict=True)):
        if min(layer["box"][2:]) < 1:
            raise FormatError("the box is empty", "chunk LAYR", rule="CHK-6")
        if own["coder"] == texr.SHARED and own["texture"] >= i:
            raise FormatError(
                "a shared texture is not that of an earlier layer", "chunk TEXR", rule="CHK-15"
            )
        texture = c.texture_of(i)
        node = (layer["sampling"] == 1, c.layers[own.get("texture", i)]["sampling"] == 1)
        if node[0] != node[1]:
            raise FormatError(
                "a shared texture has another number of features", "chunk TEXR", rule="CHK-15"
            )
        if texture["coder"] == texr.SHARED:
            raise FormatError("a shared texture is shared itself", "chunk TEXR", rule="CHK-15")
        pyramid = texture["coder"] == texr.PYRAMID
        channels = _check_view(c, layer, texture) if pyramid else _check_implicit(c, layer, texture)
        if i == 0 and c.head["opaque"] and channels != 3:
            raise FormatError(
                "the back layer of an opaque file gives alpha", "chunk TEXR", rule="CHK-3"
            )
        if own is not texture:
            continue
        if pyramid:
            _check_cuts(c, i)
            _check_behind(c, own)
            _check_copies(own)
            _spend_view(i, own, budget)
        else:
            _spend_array(budget, own["grid"][::-1], c.networks[own["network"]]["dim"])


def _spend_view(number: int, own: Values, budget: Budget) -> None:
    """Spends what decoding and filling the view of TEXR `number` costs, without its planes."""
    area = own["part"][2] * own["part"][3]
    if own["mask"] or own["cuts"] or own["matte"]:
        # Where samples are copied, how they differ from what lies beside them is filled, too.
        budget.spend("filled", 2 * area if own["sources"] else area)
    # Where a layer is cut by its own boundary, the coverage of every layer behind it may be needed
    # too [PYR-46].
    budget.spend("covered", area * (len(own["cuts"]) + (number if number in own["cuts"] else 0)))
    if own["mask"]:
        _spend_array(budget, texr.cells_shape(own), 1)
    if own["sources"]:
        channels, _ = texr.sources_bits(len(own["offsets"]) // 2)
        _spend_array(budget, texr.cells_shape(own, "grain"), channels)


def _spend_array(budget: Budget, shape: Sequence[int], channels: int) -> None:
    """Spends what decoding a coded array costs."""
    rows, columns = shape
    budget.spend("wavefronts", columns + 2 * rows)
    budget.spend("codes", columns * rows * channels)


def _check_implicit(c: Container, layer: Values, texture: Values) -> int:
    """Checks an implicit texture, and returns its number of channels."""
    if texture["network"] >= len(c.networks):
        raise FormatError(
            f"network {texture['network']} does not exist", "chunk TEXR", rule="CHK-14"
        )
    net = c.networks[texture["network"]]
    if layer["sampling"] == 1 and net["dim"] % 2:
        raise FormatError(
            "node sampling needs an even number of features", "chunk LAYR", rule="CHK-7"
        )
    return int(net["channels"])


def _check_view(c: Container, layer: Values, texture: Values) -> int:
    """Checks a pyramid texture whose planes exist, and returns its number of channels."""
    if layer["sampling"]:
        raise FormatError("node sampling needs an implicit texture", "chunk LAYR", rule="CHK-7")
    columns, rows = c.planes[texture["planes"]]["size"]
    x, y, width, height = texture["part"]
    if min(width, height) < 1 or x + width > columns or y + height > rows:
        raise FormatError("the part is empty or leaves the planes", "chunk TEXR", rule="PYR-38")
    if texture["cell"] and not texture["mask"]:
        raise FormatError("cells without a mask", "chunk TEXR", rule="PYR-39")
    for key, size, rule in (
        ("alpha", [columns, rows], "PYR-38"), ("matte", [width, height], "PYR-53"),
    ):  # fmt: skip
        own = c.planes[texture[key] - 1] if texture[key] else None
        if own and (own["components"] != 1 or own["size"] != size):
            raise FormatError(
                f"planes of {key} are not grey, or of another size", "chunk TEXR", rule=rule
            )
        if own and c.head["channels"] != 4:
            raise FormatError("more channels than HEAD has", "chunk TEXR", rule=rule)
    return 4 if texture["alpha"] or texture["matte"] else 3


def _check_behind(c: Container, texture: Values) -> None:
    """Checks `behind` and `behind_alpha` of a pyramid texture, and what a matte needs of it."""
    if texture["matte"] and (texture["unmix"] or not texture["behind"]):
        raise FormatError("a matte without behind, or with unmix", "chunk TEXR", rule="PYR-53")
    if texture["behind_alpha"] and not (texture["behind"] and texture["alpha"]):
        raise FormatError(
            "behind_alpha without behind, or without alpha", "chunk TEXR", rule="PYR-47"
        )
    colour = {c.planes[texture["planes"]]["components"], 3}
    for key, components in (("behind", colour), ("behind_alpha", {1})):
        own = c.planes[texture[key] - 1] if texture[key] else None
        if own and (own["size"] != texture["part"][2:] or own["components"] not in components):
            raise FormatError(
                f"planes of {key} have not the size of the part, or wrong components",
                "chunk TEXR",
                rule="PYR-47",
            )


def _check_copies(texture: Values) -> None:
    """Checks `grain`, `offsets` and `sources` of a pyramid texture."""
    offsets = texture["offsets"]
    if bool(offsets) != bool(texture["sources"]):
        raise FormatError(
            "offsets without sources, or sources without offsets", "chunk TEXR", rule="PYR-48"
        )
    if texture["grain"] and not offsets:
        raise FormatError("a grain without sources", "chunk TEXR", rule="PYR-48")
    if len(offsets) % 2 or len(offsets) > 2 * texr.OFFSETS_MAX:
        raise FormatError(
            f"offsets are not pairs, or more than {texr.OFFSETS_MAX}", "chunk TEXR", rule="PYR-48"
        )
    if offsets and prod(texr.cells_shape(texture, "grain")) > texr.CELLS_MAX:
        raise FormatError(
            f"sources have more than {texr.CELLS_MAX} cells", "chunk TEXR", rule="PYR-48"
        )


def _check_cuts(c: Container, number: int) -> None:
    """Checks `cuts` in the pyramid texture of layer `number`."""
    texture = c.textures[number]
    cuts = texture["cuts"]
    if not cuts:
        return
    if texture["part"][2:] != c.layers[number]["box"][2:]:
        raise FormatError(
            "a part with cuts has not the size of the box", "chunk TEXR", rule="PYR-40"
        )
    if cuts != sorted(set(cuts)) or cuts[0] < number or cuts[-1] >= len(c.layers):
        raise FormatError(
            "cuts do not ascend, lie behind, or do not exist", "chunk TEXR", rule="PYR-40"
        )
    if not all(c.layers[k]["segments"] for k in cuts):
        raise FormatError("a layer that cuts has no boundary", "chunk TEXR", rule="PYR-40")


def _check_layers(c: Container) -> None:
    """Checks LAYR against MESH and POSE, and the back layer against HEAD."""
    for type_, values, rule in (
        (mesh.TYPE, c.meshes, "CHK-9"), (pose.TYPE, c.poses, "CHK-10"),
    ):  # fmt: skip
        numbers = [v["layer"] for v in values]
        if numbers != sorted(set(numbers)) or (numbers and numbers[-1] >= len(c.layers)):
            raise FormatError("layers do not ascend, or do not exist", f"chunk {type_}", rule=rule)
    meshed = {v["layer"] for v in c.meshes}
    for i, layer in enumerate(c.layers):
        if layer["sampling"] > 3:
            raise UnsupportedError(
                f"chunk LAYR: sampling {layer['sampling']} is not known", rule="CHK-7"
            )
        if layer["sampling"] in (1, 2) and i not in meshed:
            raise FormatError("node sampling needs a mesh", "chunk LAYR", rule="CHK-7")
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
            raise FormatError(
                "the back layer of an opaque file does not cover the canvas", rule="CHK-3"
            )


def _check_tree(c: Container) -> None:
    if c.tree is None:
        return
    groups, parents = c.tree["groups"], c.tree["parents"]
    if len({*groups, *(v["name"] for v in c.layers)}) < len(groups) + len(c.layers):
        raise FormatError(
            "a group has the name of another group or a layer", "chunk tREE", rule="CHK-18"
        )
    if len(parents) != len(c.layers) + len(groups) or max(parents) > len(parents):
        raise FormatError(
            "the parents do not fit the layers and groups", "chunk tREE", rule="CHK-18"
        )
    # Each walk to the root ends at the first node that an earlier walk has visited, so the time is
    # linear in the number of nodes.
    walked = [0] * (len(parents) + 1)
    for start in range(1, len(walked)):
        node = start
        while node and not walked[node]:
            walked[node] = start
            node = parents[node - 1]
        if node and walked[node] == start:
            raise FormatError("a group or layer is part of itself", "chunk tREE", rule="CHK-19")

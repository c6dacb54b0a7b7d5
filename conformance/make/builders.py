"""Builders of parts of pictures: reproducible numbers, networks, textures, paths, meshes."""

from __future__ import annotations

import math
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import msgpack
import numpy as np
from numpy.typing import NDArray

from proxyimg_codec.container.chunks import Chunk, read, write
from proxyimg_codec.container.fields import unpack
from proxyimg_codec.container.file import fields_of
from proxyimg_codec.geometry.boundary import Boundary
from proxyimg_codec.geometry.mesh import Base, Mesh
from proxyimg_codec.geometry.pose import REST, Pose
from proxyimg_codec.model import Layer, Layers, Picture
from proxyimg_codec.texture.implicit import Box, ImplicitTexture
from proxyimg_codec.texture.network import NetShape, Network
from proxyimg_codec.texture.pyramid import Texture

Path = NDArray[np.int64]
Point = tuple[float, float]

_ARC = 0.5523
"""Distance of the inner control points of a Bézier circle from the ends of segments, in radii."""


class Numbers:
    """Random integers from a generator whose stream numpy guarantees for all versions."""

    def __init__(self, name: str) -> None:
        self.seed = zlib.crc32(name.encode())
        self._bits = np.random.PCG64(self.seed)

    def integers(self, low: int, high: int, shape: Sequence[int]) -> NDArray[np.int64]:
        """Random int64 array of a shape, with values in low..high."""
        raw = np.asarray(self._bits.random_raw(math.prod(shape)), np.uint64)
        return (raw % np.uint64(high - low + 1)).astype(np.int64).reshape(shape) + low


def network(
    numbers: Numbers,
    *,
    dim: int = 3,
    octaves: int = 1,
    hidden: int = 6,
    depth: int = 1,
    channels: int = 3,
    bits: int = 8,
    contrast: float = 0.6,
) -> Network:
    """Network with random weights, scaled so that at contrast 0.6 most outputs are in 0..1.

    Args:
        numbers: Source of random numbers.
        dim: Number of features.
        octaves: Octaves of the frequency encoding.
        hidden: Width of the hidden layers.
        depth: Number of hidden layers.
        channels: Number of outputs.
        bits: Bits a weight.
        contrast: Scale of the outputs.
    """
    shape = NetShape(dim, octaves, hidden, depth, channels)
    top = 1 << (bits - 1)
    weights = tuple(
        numbers.integers(-top, top - 1, (o, i)).astype(np.int8) for i, o in shape.layers
    )
    gain = [1.5] * depth + [contrast]
    steps = [
        np.full(o, g / (top * math.sqrt(i))) for (i, o), g in zip(shape.layers, gain, strict=True)
    ]
    biases = numbers.integers(-32, 32, (shape.rows,)) / 128
    biases[-channels:] += 0.5
    return Network(
        shape, bits, weights,
        np.concatenate(steps).astype(np.float16), biases.astype(np.float16),
    )  # fmt: skip


def texture(
    numbers: Numbers,
    *,
    dim: int = 3,
    grid: tuple[int, int] = (5, 4),
    bits: int = 4,
    network: int = 0,
    stored: NDArray[np.bool_] | None = None,
    reach: float = 0.6,
) -> ImplicitTexture:
    """Texture of random codes, whose features are in about -reach..reach.

    Args:
        numbers: Source of random numbers.
        dim: Number of features, that of the network.
        grid: Columns and rows.
        bits: Bits a code.
        network: Number of the network.
        stored: bool [rows, columns] positions whose codes are stored; all by default.
        reach: Largest magnitude of feature 0; the step of feature d is 1 + d / 8 times that of
            feature 0.
    """
    columns, rows = grid
    top = 1 << (bits - 1)
    codes = numbers.integers(-top, top - 1, (dim, rows, columns)).astype(np.int8)
    known = np.ones((rows, columns), bool) if stored is None else stored
    steps = (reach / top * (1 + np.arange(dim) / 8)).astype(np.float16)
    return ImplicitTexture(network, bits, steps, np.where(known, codes, np.int8(0)), known)


def ellipse(centre: Point, radii: Point, *, unit: int = 4, reverse: bool = False) -> Path:
    """Control points int64 [12, 2] of an ellipse of four segments, in 2**-unit pixel."""
    turns = [(1, 0), (0, 1), (-1, 0), (0, -1)]
    points: list[Point] = []
    for (ax, ay), (bx, by) in zip(turns, turns[1:] + turns[:1], strict=True):
        points += [(ax, ay), (ax + _ARC * bx, ay + _ARC * by), (bx + _ARC * ax, by + _ARC * ay)]
    return _snapped(
        [(centre[0] + x * radii[0], centre[1] + y * radii[1]) for x, y in points], unit, reverse
    )


def polygon(*corners: Point, unit: int = 4, reverse: bool = False) -> Path:
    """Control points int64 [3 m, 2] of a polygon with m straight sides, in 2**-unit pixel."""
    points: list[Point] = []
    for (ax, ay), (bx, by) in zip(corners, [*corners[1:], corners[0]], strict=True):
        points += [(ax + (bx - ax) * k / 3, ay + (by - ay) * k / 3) for k in range(3)]
    return _snapped(points, unit, reverse)


def _snapped(points: Sequence[Point], unit: int, reverse: bool) -> Path:
    """Rounds points in pixels to 2**-unit pixel; `reverse` runs the path the other way."""
    path = np.floor(np.array(points) * (1 << unit) + 0.5).astype(np.int64)
    return np.roll(path[::-1], 1, axis=0) if reverse else path


def grid_mesh(
    origin: tuple[int, int],
    columns: int,
    rows: int,
    *,
    step: tuple[int, int] = (256, 256),
    cell: int = 16,
    keep: Sequence[int] | None = None,
    split: Sequence[Sequence[int]] = (),
) -> Mesh:
    """Mesh of square cells of two triangles each, by default of 4 pixels a side.

    Args:
        origin: Canvas pixel of its upper left corner.
        columns: Cells across.
        rows: Cells down.
        step: Lattice spacing in 1/1024 pixel.
        cell: Side of a cell in lattice units.
        keep: Numbers of its triangles, two for each cell in raster order; all by default.
        split: Numbers of the triangles that each refinement splits.
    """
    triangles = []
    for k in range(columns * rows):
        a = k // columns * (columns + 1) + k % columns
        triangles += [(a, a + 1, a + columns + 1), (a + 1, a + columns + 2, a + columns + 1)]
    chosen = np.array(triangles)[slice(None) if keep is None else list(keep)]
    used, corners = np.unique(chosen, return_inverse=True)
    points = np.stack([used % (columns + 1), used // (columns + 1)], axis=1) * cell
    base = Base(origin, step, points.astype(np.uint8), corners.reshape(-1, 3).astype(np.int32))
    flags, count = [], len(chosen)
    for numbers in split:
        flags.append(np.isin(np.arange(count), numbers))
        count = 4 * len(numbers)
    return Mesh.build(base).split(flags)


def bend(numbers: Numbers, mesh: Mesh, reach: int = 24) -> NDArray[np.int64]:
    """Random displacements int64 [N, 2] of all nodes, in -reach..reach, in 1/16 pixel."""
    return numbers.integers(-reach, reach, mesh.refined.nodes.shape)


def layer(
    name: str,
    box: Box,
    texture: Texture,
    *paths: Path,
    unit: int = 4,
    mesh: Mesh | None = None,
    pose: Pose = REST,
    sampling: int = 0,
) -> Layer:
    """Layer of a picture; without paths it covers the whole canvas."""
    boundary = Boundary(unit, paths) if paths else None
    return Layer(name, box, boundary, texture, mesh, sampling, pose)


def picture(
    size: tuple[int, int],
    layers: Sequence[Layer],
    *networks: Network,
    opaque: bool = True,
    extra: Sequence[Chunk] = (),
) -> Picture:
    """Picture of layers, back to front."""
    channels = max(v.texture.channels(networks) for v in layers)
    return Picture(*size, channels, opaque, 8, Layers(layers), networks, extra=tuple(extra))


def layered(n: Numbers, channels: int = 3) -> Picture:
    """Picture of three layers that overlap: a back, an ellipse and a triangle."""
    w, h = 32, 24
    return picture(
        (w, h),
        [
            layer("back", (0, 0, w, h), texture(n)),
            layer("disc", (4, 3, 18, 16), texture(n), ellipse((13, 11), (8.5, 7.25))),
            layer(
                "triangle", (10, 6, 20, 17), texture(n), polygon((28.5, 7), (25, 22.25), (11, 14))
            ),
        ],
        network(n, channels=channels, contrast=0.6 if channels == 3 else 1.5),
        opaque=channels == 3,
    )


SIZE = 24, 18
"""Width and height of the canvas of `on_back`."""


def disc(n: Numbers, mesh: Mesh | None = None, **pose: Any) -> Layer:
    """Layer of a disc with a fine texture, in a pose."""
    plane = texture(n, grid=(9, 8))
    shape = ellipse((12, 9), (7, 5.5))
    return layer("disc", (4, 3, 16, 12), plane, shape, mesh=mesh, pose=Pose(**pose))


def on_back(n: Numbers, *layers: Layer, channels: int = 3) -> Picture:
    """Picture of `SIZE` with one network, and a back layer behind `layers`."""
    back = layer("back", (0, 0, *SIZE), texture(n))
    net = network(n, channels=channels, contrast=0.6 if channels == 3 else 1.5)
    return picture(SIZE, [back, *layers], net, opaque=channels == 3)


def values(chunk: Chunk) -> dict[str, Any]:
    """Values of a chunk by key."""
    return unpack(fields_of(chunk), chunk.payload, "")


def changed(chunk: Chunk, new: Mapping[str, Any], *, in_map: bool = False) -> Chunk:
    """Chunk with changed, added or (if None) removed values, which need not be valid.

    Args:
        chunk: The chunk to change.
        new: The changes, by key.
        in_map: Whether it holds a map, as versions 0.1 and 0.2 wrote it.
    """
    content = {k: v for k, v in (values(chunk) | dict(new)).items() if v is not None}
    return replace(chunk, payload=msgpack.packb(content if in_map else list(content.values())))


def with_maps(data: bytes, version: tuple[int, int], without: Sequence[str] = ()) -> bytes:
    """File of another version, with maps in all chunks except those of the types `without`."""
    return write(
        [
            changed(c, {}, in_map=True) if fields_of(c) and c.type not in without else c
            for c in read(data)
        ],
        version,
    )

"""The decoded model: an immutable `Image` of layers that renders and saves itself."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .container import file as container
from .container.chunks import Chunk
from .errors import PxiError, UsageError
from .files import read_bytes, write_atomically
from .geometry import boundary as boundaries
from .geometry.boundary import Boundary
from .limits import DEFAULT_LIMITS, Limits
from .render import engines
from .render.compose import render
from .render.view import make_view
from .texture import implicit, network
from .texture.implicit import Box, ImplicitTexture
from .texture.network import Network


@dataclass(frozen=True, eq=False)
class Layer:
    """One layer.

    Attributes:
        name: Unique in the image.
        box: x, y, width, height of the texture's rectangle in canvas pixels.
        boundary: Closed paths, or None for the whole canvas.
        texture: Codes and the index of their network.
    """

    name: str
    box: Box
    boundary: Boundary | None
    texture: ImplicitTexture


class Layers(Sequence[Layer]):
    """Layers back to front, addressed by position or by name."""

    def __init__(self, layers: Iterable[Layer]) -> None:
        self._layers = tuple(layers)

    def __len__(self) -> int:
        return len(self._layers)

    def __iter__(self) -> Iterator[Layer]:
        return iter(self._layers)

    def __getitem__(self, key: Any) -> Any:
        """The layer at a position or with a name.

        Raises:
            UsageError: There is no such layer.
        """
        if isinstance(key, slice):
            return self._layers[key]
        if isinstance(key, str):
            for layer in self._layers:
                if layer.name == key:
                    return layer
        elif -len(self) <= key < len(self):
            return self._layers[key]
        names = ", ".join(repr(layer.name) for layer in self._layers)
        raise UsageError(f"there is no layer {key!r}; the picture has {names}")


@dataclass(frozen=True, eq=False)
class Image:
    """A `.pxi` picture in memory.

    Attributes:
        width: Canvas width in pixels.
        height: Canvas height.
        channels: 3, or 4 if textures also give alpha.
        opaque: Whether the back layer covers the whole canvas, so that output has no alpha.
        depth: Bits a sample of the original, 8 or 16.
        layers: Layers back to front.
        networks: Decoder networks.
        blocks: Metadata blocks ``icc``, ``exif``, ``xmp``.
        info: Encoder, settings and areas, as in the iNFO chunk, or None.
        extra: Unknown ancillary chunks, carried along.
    """

    width: int
    height: int
    channels: int
    opaque: bool
    depth: int
    layers: Layers
    networks: tuple[Network, ...]
    blocks: Mapping[str, bytes] = field(default_factory=dict)
    info: Mapping[str, Any] | None = None
    extra: tuple[Chunk, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "blocks", MappingProxyType(dict(self.blocks)))
        if self.info is not None:
            object.__setattr__(self, "info", MappingProxyType(dict(self.info)))
        for layer in self.layers:
            layer.texture.codes.flags.writeable = False
            layer.texture.stored.flags.writeable = False

    def render(
        self,
        *,
        width: int | None = None,
        height: int | None = None,
        scale: float | None = None,
        region: tuple[int, int, int, int] | None = None,
        layers: Sequence[str | int] | None = None,
        background: bool = True,
        dtype: Any = np.uint8,
        engine: str = "auto",
        limits: Limits = DEFAULT_LIMITS,
        progress: Callable[[int], None] | None = None,
    ) -> NDArray[Any]:
        """Renders the picture, or part of it, at any size.

        Args:
            width: Output columns; with `height` left out, the aspect is kept.
            height: Output rows.
            scale: Output pixels a canvas pixel, instead of width and height.
            region: x, y, width, height in canvas pixels.
            layers: Names or positions of the layers to draw; all by default.
            background: Whether to draw the back layer of an opaque picture.
            dtype: uint8 or uint16 (rounded), or float32 in 0..1.
            engine: ``auto``, ``numpy``, ``native`` or ``ort``.
            limits: Bounds the output.
            progress: Called with the number of pixels after each tile.

        Returns:
            [height, width, 3] if the result is opaque by construction, otherwise
            [height, width, 4] with straight alpha.

        Raises:
            UsageError: A request that makes no sense, or an unknown layer.
            UnsupportedError: The engine is not installed.
            LimitError: The output is too large.
        """
        try:
            dtype = np.dtype(dtype)
        except TypeError:
            raise UsageError(f"dtype {dtype!r} is not known to numpy") from None
        if dtype not in (np.uint8, np.uint16, np.float32):
            raise UsageError(f"dtype {dtype} is not uint8, uint16 or float32")
        chosen = self._select(layers, background)
        view = make_view((self.width, self.height), width, height, scale, region)
        limits.check("output_pixels", view.width * view.height)
        solid = self.opaque and bool(chosen) and chosen[0] is self.layers[0]
        result = np.empty((view.height, view.width, 3 if solid else 4), dtype)

        def put(row: int, column: int, tile: NDArray[np.float32]) -> None:
            h, w = tile.shape[:2]
            result[row : row + h, column : column + w] = _finish(tile, solid, dtype)
            if progress:
                progress(h * w)

        render(self, view, chosen, engines.find(engine), put)
        return result

    def _select(self, layers: Sequence[str | int] | None, background: bool) -> list[Layer]:
        wanted = list(self.layers) if layers is None else [self.layers[k] for k in layers]
        chosen = [
            layer
            for i, layer in enumerate(self.layers)
            if any(layer is w for w in wanted) and (background or i > 0 or not self.opaque)
        ]
        if not chosen:
            raise UsageError("no layer is left to draw")
        return chosen

    def to_bytes(self) -> bytes:
        """The picture as a `.pxi` file.

        Raises:
            LimitError: It is larger than readers accept by default.
        """
        file = container.Container(
            {
                "size": [self.width, self.height],
                "channels": self.channels,
                "opaque": int(self.opaque),
                "depth": self.depth,
                "layers": len(self.layers),
                "networks": len(self.networks),
            },
            tuple(
                {"name": v.name, "box": list(v.box), "sampling": 0, **boundaries.encode(v.boundary)}
                for v in self.layers
            ),
            tuple(network.pack(n) for n in self.networks),
            tuple(implicit.pack(v.texture) for v in self.layers),
            self.blocks,
            self.info,
            self.extra,
        )
        container.check(file, DEFAULT_LIMITS)
        return container.serialize(file)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes the picture to `path`, replacing it in one step.

        Raises:
            InputError: The file cannot be written.
        """
        write_atomically(path, self.to_bytes())


def _finish(tile: NDArray[np.float32], solid: bool, dtype: np.dtype[Any]) -> NDArray[Any]:
    """Premultiplied [h, w, 4] -> straight alpha or opaque output samples."""
    if solid:
        tile = tile[..., :3]
    else:
        tile = tile.copy()
        tile[..., :3] /= np.maximum(tile[..., 3:], np.float32(1e-6))
    tile = np.clip(tile, 0, 1)
    if dtype == np.float32:
        return tile
    return np.rint(tile * np.iinfo(dtype).max).astype(dtype)


def from_bytes(data: bytes, limits: Limits = DEFAULT_LIMITS) -> Image:
    """Decodes a `.pxi` file held in memory.

    Raises:
        FormatError: The file breaks the format.
        UnsupportedError: It needs a newer reader.
        LimitError: It exceeds `limits`.
    """
    c = container.parse(data, limits)
    networks = tuple(network.unpack(v, f"chunk NETW {i}") for i, v in enumerate(c.networks))
    layers = [
        Layer(
            v["name"],
            (v["box"][0], v["box"][1], v["box"][2], v["box"][3]),
            boundaries.decode(v, f"chunk LAYR {i}"),
            implicit.unpack(t, networks, f"chunk TEXR {i}"),
        )
        for i, (v, t) in enumerate(zip(c.layers, c.textures, strict=True))
    ]
    width, height = c.head["size"]
    return Image(
        width, height, c.head["channels"], bool(c.head["opaque"]), c.head["depth"],
        Layers(layers), networks, c.blocks, c.info, c.extra,
    )  # fmt: skip


def open_image(path: str | os.PathLike[str], limits: Limits = DEFAULT_LIMITS) -> Image:
    """Reads a `.pxi` file.

    Raises:
        InputError: The file cannot be read.
        FormatError, UnsupportedError, LimitError: As `from_bytes`.
    """
    data = read_bytes(path)
    try:
        return from_bytes(data, limits)
    except PxiError as error:
        error.args = (f"{os.fspath(path)}: {error}",)
        raise

"""The decoded model: an immutable `Image` of layers that renders and saves itself."""

from __future__ import annotations

import os
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .container import file as container
from .container import texr
from .container.check import check
from .container.chunks import Chunk, write
from .container.fields import pack
from .container.undo import Step
from .editable import Editable
from .errors import PxiError, UsageError
from .files import read_bytes, write_atomically
from .geometry import boundary as boundaries
from .geometry import pose as posing
from .geometry import warp
from .geometry.boundary import Boundary
from .geometry.mesh import Mesh
from .geometry.pose import REST, Pose
from .limits import DEFAULT_LIMITS, Limits
from .render.cache import Cache
from .render.compose import render
from .render.view import make_view
from .texture import implicit, network, planes, pyramid
from .texture.cuts import Cuts
from .texture.implicit import Box, ImplicitTexture
from .texture.network import Network
from .texture.planes import Planes
from .texture.pyramid import PyramidTexture, Texture


@dataclass(frozen=True, eq=False)
class Layer(Editable):
    """One layer. Its methods edit: each returns a new image.

    Attributes:
        name: Unique in the image.
        box: x, y, width, height of the texture's rectangle in canvas pixels.
        boundary: Closed paths at rest, or None for the whole canvas.
        texture: Codes and the index of their network, or a view of planes.
        mesh: Proxy nodes, or None.
        sampling: How features are found: 0 direct, 1 to 3 at the proxy nodes.
        pose: What edits have done to it.
        parent: Name of the layer or group that it follows, or None.
        image: The image it belongs to.
    """

    name: str
    box: Box
    boundary: Boundary | None
    texture: Texture
    mesh: Mesh | None = None
    sampling: int = 0
    pose: Pose = REST
    parent: str | None = None
    image: Image | None = field(default=None, repr=False)

    @property
    def network(self) -> Network | None:
        """What decodes its texture; None where that is no network of the file."""
        number = self.texture.network
        assert self.image is not None, "a layer of no image has no networks"
        return None if number is None else self.image.networks[number]

    @cached_property
    def outline(self) -> Boundary | None:
        """The boundary in its present place; None for the whole canvas."""
        assert self.image is not None, "a layer of no image has no canvas"
        size = (self.image.width, self.image.height)
        return warp.outline(self.boundary, self.pose, self.mesh, size)


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


def _settled(layers: Sequence[Layer]) -> list[Layer]:
    """Layers whose views have a mask where a boundary that cuts them is not in its place."""
    boundaries = [layer.boundary for layer in layers]
    shown: dict[Texture, Texture] = {}
    for i, layer in enumerate(layers):
        view = layer.texture
        if view in shown:
            continue
        shown[view] = view
        if isinstance(view, PyramidTexture) and view.cuts is not None:
            sharing = (k for k, v in enumerate(layers) if v.texture is view)
            home = next((k for k in sharing if layers[k].box == view.cuts.box), None)
            if home is None:
                shown[view] = view.masked()
            elif home > i or view.cuts.numbers(i, boundaries) is None:
                shown[view] = view.masked(boundaries[home], boundaries[home + 1 :])
    return [replace(layer, texture=shown[layer.texture]) for layer in layers]


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
        groups: Parent of each group of layers, a name or None, by the group's name.
        history: The edits that led here, oldest first, each with the state before it.
        cache: Colours that were computed, shared with the images made from this one.
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
    groups: Mapping[str, str | None] = field(default_factory=dict)
    history: tuple[Step, ...] = ()
    cache: Cache = field(default_factory=Cache, repr=False)

    def __post_init__(self) -> None:
        bound = Layers(replace(layer, image=self) for layer in _settled(self.layers))
        object.__setattr__(self, "layers", bound)
        object.__setattr__(self, "blocks", MappingProxyType(dict(self.blocks)))
        object.__setattr__(self, "groups", MappingProxyType(dict(self.groups)))
        if self.info is not None:
            object.__setattr__(self, "info", MappingProxyType(dict(self.info)))
        for layer in self.layers:
            for array in layer.texture.arrays:
                array.flags.writeable = False

    def edited(self, *operations: Mapping[str, Any]) -> Image:
        """The picture after `operations`, in order; each can be undone.

        Args:
            operations: As in an edit script, such as
                ``{"op": "move", "layer": "cat", "by": [40, -10]}``.

        Raises:
            UsageError: An operation is unknown, or cannot be done.
        """
        from .edit.script import apply

        return apply(self, operations)

    def undone(self, steps: int = 1) -> Image:
        """The picture before its last `steps` edits.

        Raises:
            UsageError: There are not as many.
        """
        if not 1 <= steps <= len(self.history):
            raise UsageError(f"cannot undo {steps} edits: the picture has {len(self.history)}")
        past = self.history[len(self.history) - steps]
        image = from_bytes(write([*past.chunks, Chunk("TAIL", b"")]))
        return replace(image, history=self.history[: len(self.history) - steps])

    def baked(self) -> Image:
        """The same picture without its history.

        Pixels of a layer that was removed stay in planes that other layers show parts of.
        """
        return replace(self, history=())

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
            layers: Names or positions of the layers to draw; all that are not hidden by default.
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

        render(self, view, chosen, engine, put, limits)
        return result

    def _select(self, layers: Sequence[str | int] | None, background: bool) -> list[Layer]:
        if layers is None:
            wanted = [layer for layer in self.layers if not layer.pose.hidden]
        else:
            wanted = [self.layers[k] for k in layers]
        chosen = [
            layer
            for i, layer in enumerate(self.layers)
            if any(layer is w for w in wanted) and (background or i > 0 or not self.opaque)
        ]
        if not chosen and (layers is not None or not background):
            raise UsageError("no layer is left to draw")
        return chosen

    def to_bytes(self) -> bytes:
        """The picture as a `.pxi` file.

        Raises:
            LimitError: It is larger than readers accept by default.
        """
        content = self._container()
        check(content, DEFAULT_LIMITS)
        return container.serialize(content)

    @cached_property
    def chunks(self) -> tuple[Chunk, ...]:
        """The chunks of its file but uNDO and TAIL."""
        return tuple(container.present(self._container()))

    def _container(self) -> container.Container:
        meshes = [(i, v.mesh) for i, v in enumerate(self.layers) if v.mesh is not None]
        poses = [(i, v) for i, v in enumerate(self.layers) if not v.pose.at_rest]
        return container.Container(
            {
                "size": [self.width, self.height],
                "channels": self.channels,
                "opaque": int(self.opaque),
                "depth": self.depth,
                "layers": len(self.layers),
                "networks": len(self.networks),
            },
            tuple(
                {
                    "name": v.name,
                    "box": list(v.box),
                    "sampling": v.sampling,
                    **boundaries.encode(v.boundary),
                }
                for v in self.layers
            ),
            tuple(n.packed for n in self.networks),
            self._textures(),
            tuple(p.packed for p in self._planes()),
            tuple({"layer": i, **m.fields} for i, m in meshes),
            tuple({"layer": i, **posing.encode(v.pose, v.mesh)} for i, v in poses),
            self._tree(),
            self.history,
            self.blocks,
            self.info,
            self.extra,
        )

    def _planes(self) -> list[Planes]:
        """The planes that textures show, in the order of their first use."""
        views = (v.texture for v in self.layers if isinstance(v.texture, PyramidTexture))
        return list(dict.fromkeys(source for view in views for source in view.sources))

    def _textures(self) -> tuple[Mapping[str, Any], ...]:
        """Fields of each TEXR; what is equal to an earlier one refers to it."""
        first: dict[Hashable, int] = {}
        numbers = {p: k for k, p in enumerate(self._planes())}
        out: list[Mapping[str, Any]] = []
        for i, layer in enumerate(self.layers):
            at = first.get(layer.texture)
            if at is None:
                fields, meaning = self._texture(i, numbers)
                key = (pack(texr.CODERS[fields["coder"]], fields), meaning)
                at = first[layer.texture] = first.setdefault(key, i)
            out.append(fields if at == i else {"coder": texr.SHARED, "texture": at})
        return tuple(out)

    def _texture(
        self, number: int, planes: Mapping[Planes, int]
    ) -> tuple[Mapping[str, Any], Hashable]:
        """Fields of a layer's TEXR, and what else they depend on for their meaning."""
        shown = self.layers[number].texture
        if isinstance(shown, ImplicitTexture):
            return shown.packed, None
        if shown.cuts is None:
            return shown.fields(planes), None
        cuts = shown.cuts.numbers(number, [v.boundary for v in self.layers])
        assert cuts is not None, "views whose cuts are gone have a mask"
        return shown.fields(planes, cuts), (shown.cuts.box, number in cuts)

    def _tree(self) -> dict[str, Any] | None:
        above = [layer.parent for layer in self.layers] + list(self.groups.values())
        if not self.groups and not any(above):
            return None
        number = {n: i + 1 for i, n in enumerate([*(v.name for v in self.layers), *self.groups])}
        return {
            "groups": list(self.groups),
            "parents": [0 if name is None else number[name] for name in above],
        }

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes the picture to `path`, replacing it in one step.

        Raises:
            InputError: The file cannot be written.
        """
        write_atomically(path, self.to_bytes())


def _finish(tile: NDArray[np.float32], solid: bool, dtype: np.dtype[Any]) -> NDArray[Any]:
    """Premultiplied [h, w, 4] -> straight alpha or opaque output samples."""
    if not solid:
        tile = tile.copy()
        tile[..., :3] /= np.maximum(tile[..., 3:], np.float32(1e-6))
    tile = np.clip(tile, 0, 1)
    if dtype != np.float32:
        tile = np.rint(tile * np.iinfo(dtype).max).astype(dtype)
    return tile[..., :3] if solid else tile


def from_bytes(data: bytes, limits: Limits = DEFAULT_LIMITS) -> Image:
    """Decodes a `.pxi` file held in memory.

    Raises:
        FormatError: The file breaks the format.
        UnsupportedError: It needs a newer reader.
        LimitError: It exceeds `limits`.
    """
    c = container.parse(data, limits)
    networks = tuple(network.unpack(v, f"chunk NETW {i}") for i, v in enumerate(c.networks))
    meshes = {
        v["layer"]: Mesh({k: w for k, w in v.items() if k != "layer"}, f"chunk MESH {i}", limits)
        for i, v in enumerate(c.meshes)
    }
    poses = {
        v["layer"]: posing.decode(v, meshes.get(v["layer"]), f"chunk POSE {i}")
        for i, v in enumerate(c.poses)
    }
    groups = c.tree["groups"] if c.tree else []
    nodes = [None, *(v["name"] for v in c.layers), *groups]
    parents = [nodes[k] for k in c.tree["parents"]] if c.tree else [None] * len(c.layers)
    sources = [planes.unpack(v, f"chunk PLAN {i}") for i, v in enumerate(c.planes)]
    outlines = [boundaries.decode(v, f"chunk LAYR {i}") for i, v in enumerate(c.layers)]
    boxes = [(v["box"][0], v["box"][1], v["box"][2], v["box"][3]) for v in c.layers]
    textures: list[Texture] = []
    for i, (v, t) in enumerate(zip(c.layers, c.textures, strict=True)):
        if t["coder"] == texr.SHARED:
            textures.append(textures[t["texture"]])
        elif t["coder"] == texr.PYRAMID:
            cuts = Cuts.of(t["cuts"], i, outlines, boxes[i])
            textures.append(pyramid.unpack(t, sources, f"chunk TEXR {i}", cuts))
        else:
            textures.append(implicit.unpack(t, networks, f"chunk TEXR {i}", v["sampling"]))
    layers = [
        Layer(
            v["name"],
            box,
            outline,
            texture,
            meshes.get(i),
            v["sampling"],
            poses.get(i, REST),
            parent,
        )
        for i, (v, box, outline, texture, parent) in enumerate(
            zip(c.layers, boxes, outlines, textures, parents[: len(c.layers)], strict=True)
        )
    ]
    width, height = c.head["size"]
    return Image(
        width, height, c.head["channels"], bool(c.head["opaque"]), c.head["depth"],
        Layers(layers), networks, c.blocks, c.info, c.extra,
        dict(zip(groups, parents[len(c.layers) :], strict=True)), c.history,
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

"""The decoded model: an immutable `Image` of layers that renders and saves itself."""

from __future__ import annotations

import logging
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from .codec import salvage
from .container import file as container
from .container.check import check
from .container.chunks import Chunk, write
from .container.undo import Step
from .editable import Editable
from .errors import LimitError, PxiError, UsageError
from .geometry import warp
from .geometry.boundary import Boundary
from .geometry.mesh import Mesh
from .geometry.pose import REST, Pose
from .geometry.track import Timeline, Track
from .io.files import read_bytes, write_atomically
from .limits import DEFAULT_LIMITS, SMALL_FILE, Limits
from .render.cache import Cache
from .render.compose import render
from .render.view import make_view
from .texture.cuts import NOTHING, Apart
from .texture.implicit import Box
from .texture.network import Network
from .texture.planes import Planes
from .texture.pyramid import PyramidTexture, Texture

if TYPE_CHECKING:
    from .animate.motion import Motion


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
        track: How its nodes move over the timeline of the image, or None.
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
    track: Track | None = None
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

    @cached_property
    def apart(self) -> Apart:
        """What no longer lies to the layer as it did when the samples of its view were mixed."""
        assert self.image is not None, "a layer of no image has none beside it"
        layers = self.image.layers
        home = next(k for k, v in enumerate(layers) if v.texture is self.texture)
        return _apart(self.texture, self.pose, layers, home)


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


def _apart(view: Texture, pose: Pose, layers: Sequence[Layer], home: int) -> Apart:
    """What is apart from a view, cut for layer `home`, that a layer in a pose shows."""
    if not isinstance(view, PyramidTexture) or view.cuts is None:
        return NOTHING
    boundaries = [v.boundary for v in layers]
    still = [v.pose.still(pose) for v in layers]
    raster = [
        isinstance(v.texture, PyramidTexture) and v.texture.planes is view.planes for v in layers
    ]
    return view.cuts.apart(home, boundaries, still, raster)


def _settled(layers: Sequence[Layer]) -> list[Layer]:
    """Layers whose views have a mask for each boundary that cut them and is gone."""
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
                shown[view] = view.masked(view.cuts.everything)
            elif home > i:
                shown[view] = view.masked(_apart(view, layers[home].pose, layers, home))
            elif view.cuts.numbers(i, boundaries) is None:
                shown[view] = view.masked(*view.cuts.gone(i, boundaries))
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
        timeline: When layers that have a track move, or None.
        history: The edits that led here, oldest first, each with the state before it.
        damage: What was wrong with the file it was read from, where that was tolerated.
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
    timeline: Timeline | None = None
    history: tuple[Step, ...] = ()
    damage: tuple[str, ...] = ()
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

    def at(self, t: float) -> Image:
        """The still that a picture that moves is at a time in seconds.

        Before and after its timeline a picture stays as it is at its ends, unless it loops.

        Raises:
            UsageError: The picture has no timeline, or the time is not a number.
        """
        if self.timeline is None:
            raise UsageError("the picture does not move; give it a motion first (pxi-animate)")
        moved = [
            layer
            if layer.track is None
            else replace(
                layer,
                pose=replace(
                    layer.pose,
                    sway=layer.track.at(self.timeline, t),
                    body=layer.track.body,
                ),
                track=None,
            )
            for layer in self.layers
        ]
        return replace(self, layers=Layers(moved), timeline=None, history=())

    def animated(
        self, motion: Motion, *, progress: Callable[[int, int], None] | None = None
    ) -> Image:
        """The picture with another motion, simulated and stored.

        Args:
            motion: What moves, and how: `animate.motion`.
            progress: Called with the number of simulated frames and of all frames to simulate.

        Raises:
            UsageError: The motion does not fit the picture.
        """
        from .animate.animate import animate

        return animate(self, motion, progress)

    def render(
        self,
        *,
        t: float | None = None,
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
            t: Time in seconds, of a picture with a timeline; by default the still is drawn.
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
            UsageError: A request that makes no sense, an unknown layer, or a time of a picture
                that does not move.
            UnsupportedError: The engine is not installed.
            LimitError: The output is too large.
        """
        if t is not None:
            return self.at(t).render(
                width=width, height=height, scale=scale, region=region, layers=layers,
                background=background, dtype=dtype, engine=engine, limits=limits,
                progress=progress,
            )  # fmt: skip
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
        from .codec.pack import pack, padding

        content, budget = pack(self), DEFAULT_LIMITS.budget()
        check(content, budget)
        data = container.serialize(content)
        if len(data) > SMALL_FILE or budget.fits_small():
            return data
        extra = (*content.extra, padding(SMALL_FILE - len(data)))
        return container.serialize(replace(content, extra=extra))

    @cached_property
    def chunks(self) -> tuple[Chunk, ...]:
        """The chunks of its file but uNDO and TAIL."""
        from .codec.pack import pack

        return tuple(container.present(pack(self)))

    @property
    def planes(self) -> list[Planes]:
        """The planes that textures show, in the order of their first use."""
        views = (v.texture for v in self.layers if isinstance(v.texture, PyramidTexture))
        return list(dict.fromkeys(source for view in views for source in view.sources))

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


def from_bytes(data: bytes, limits: Limits = DEFAULT_LIMITS, *, tolerant: bool = False) -> Image:
    """Decodes a `.pxi` file held in memory.

    Args:
        data: The file.
        limits: Bounds what is spent on it.
        tolerant: Whether to make do with what can be decoded of a file that is cut off or damaged.
            What is wrong is logged as a warning, and stands in `Image.damage`.

    Raises:
        FormatError: The file breaks the format; or, if `tolerant`, too little of it is left.
        UnsupportedError: It needs a newer reader.
        LimitError: It exceeds `limits`.
    """
    from .codec.pack import unpack

    damage: tuple[str, ...] = ()
    try:
        if tolerant:
            c, damage = salvage.parse(data, limits)
        else:
            limits = limits.budget()
            c = container.parse(data, limits)
        image = unpack(c, limits, damage)
    except MemoryError:
        raise LimitError("there is not enough memory for the file") from None
    if damage:
        logging.getLogger(__name__).warning("the file is damaged: %s", "; ".join(damage))
    return image


def open_image(
    path: str | os.PathLike[str], limits: Limits = DEFAULT_LIMITS, *, tolerant: bool = False
) -> Image:
    """Reads a `.pxi` file; see `from_bytes`.

    Raises:
        InputError: The file cannot be read.
        FormatError, UnsupportedError, LimitError: As `from_bytes`.
    """
    data = read_bytes(path)
    try:
        return from_bytes(data, limits, tolerant=tolerant)
    except PxiError as error:
        error.args = (f"{os.fspath(path)}: {error}",)
        raise

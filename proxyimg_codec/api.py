"""The face of the package: pictures and layers with methods.

An `Image` is a handle to a `model.Picture`, a `Layer` a picture and a position in it. Both are
immutable: what changes something gives another one. All that they do is done by functions below.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from . import model
from .codec import read, write
from .container.chunks import Chunk
from .container.undo import Step
from .edit.methods import Editable
from .errors import UnsupportedError
from .geometry.boundary import Boundary
from .geometry.mesh import Mesh
from .geometry.pose import Pose
from .geometry.track import Timeline, Track
from .io.files import write_atomically
from .limits import DEFAULT_LIMITS, Limits
from .model import Layers, Pictured
from .render import neighbours, pixels
from .render.cache import Cache
from .render.moment import at
from .texture.implicit import Box
from .texture.network import Network
from .texture.occlusion import Moved
from .texture.planes import Planes
from .texture.pyramid import Texture

if TYPE_CHECKING:
    from .animate.motion import Motion
    from .encoder.encode import Progress
    from .encoder.settings import Settings
    from .encoder.shapes.masks import Region


class Image:
    """A `.pxi` picture in memory. Equal images have equal files; they pickle as their files.

    Args:
        picture: What it is a handle to.
        cache: Colours that were computed, shared with the images made from this one.

    Attributes:
        picture: The picture as data.
        cache: Colours that were computed.
    """

    def __init__(self, picture: Pictured, cache: Cache | None = None) -> None:
        self._picture = picture.picture
        self._cache = cache or Cache()

    def __repr__(self) -> str:
        names = ", ".join(repr(layer.name) for layer in self._picture.layers)
        return f"<Image {self.width}x{self.height}, layers {names}>"

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Image):
            return NotImplemented
        if self._picture is other._picture:
            return True
        return self.chunks == other.chunks and self.history == other.history

    def __hash__(self) -> int:
        return hash((self._picture.size, tuple(v.name for v in self._picture.layers)))

    def __reduce__(self) -> tuple[Callable[..., Image], tuple[bytes, tuple[str, ...]]]:
        return _restored, (write.serialized(self), self.damage)

    @property
    def picture(self) -> model.Picture:
        """The picture as data."""
        return self._picture

    @property
    def cache(self) -> Cache:
        """Colours that were computed, shared with the images made from this one."""
        return self._cache

    @property
    def width(self) -> int:
        """Canvas width in pixels."""
        return self._picture.width

    @property
    def height(self) -> int:
        """Canvas height in pixels."""
        return self._picture.height

    @property
    def channels(self) -> int:
        """3, or 4 if textures also give alpha."""
        return self._picture.channels

    @property
    def opaque(self) -> bool:
        """Whether the back layer covers the whole canvas, so that output has no alpha."""
        return self._picture.opaque

    @property
    def depth(self) -> int:
        """Bits a sample of the original, 8 or 16."""
        return self._picture.depth

    @property
    def layers(self) -> Layers[Layer]:
        """Layers back to front, addressed by position or by name."""
        return Layers(Layer(self, k) for k in range(len(self._picture.layers)))

    @property
    def networks(self) -> tuple[Network, ...]:
        """Decoder networks of the file."""
        return self._picture.networks

    @property
    def blocks(self) -> Mapping[str, bytes]:
        """Metadata blocks ``icc``, ``exif``, ``xmp``."""
        return self._picture.blocks

    @property
    def info(self) -> Mapping[str, Any] | None:
        """Encoder, settings and areas, as in the iNFO chunk, or None."""
        return self._picture.info

    @property
    def extra(self) -> tuple[Chunk, ...]:
        """Unknown ancillary chunks, carried along."""
        return self._picture.extra

    @property
    def groups(self) -> Mapping[str, str | None]:
        """Parent of each group of layers, a name or None, by the group's name."""
        return self._picture.groups

    @property
    def timeline(self) -> Timeline | None:
        """When layers that have a track move, or None."""
        return self._picture.timeline

    @property
    def history(self) -> tuple[Step, ...]:
        """The edits that led here, oldest first, each with the state before it."""
        return self._picture.history

    @property
    def damage(self) -> tuple[str, ...]:
        """What was wrong with the file it was read from, where that was tolerated."""
        return self._picture.damage

    @property
    def planes(self) -> list[Planes]:
        """The planes that textures show, in the order of their first use."""
        return self._picture.planes

    @property
    def chunks(self) -> tuple[Chunk, ...]:
        """The chunks of its file but uNDO and TAIL."""
        return write.state(self)

    def _with(self, picture: model.Picture) -> Image:
        """Another picture that shares the colours that were computed."""
        return Image(picture, self._cache)

    def edited(self, *operations: Mapping[str, Any]) -> Image:
        """The picture after `operations`, in order; each can be undone.

        Args:
            operations: As in an edit script, such as
                ``{"op": "move", "layer": "cat", "by": [40, -10]}``.

        Raises:
            UsageError: An operation is unknown, or cannot be done.
        """
        from .edit.script import apply

        return self._with(apply(self._picture, operations))

    def undone(self, steps: int = 1) -> Image:
        """The picture before its last `steps` edits.

        Raises:
            UsageError: There are not as many.
        """
        from .edit.history import undone

        return self._with(undone(self._picture, steps))

    def baked(self) -> Image:
        """The same picture without its history.

        Pixels of a layer that was removed stay in planes that other layers show parts of.
        """
        return self._with(replace(self._picture, history=()))

    def at(self, t: float) -> Image:
        """The still that a picture that moves is at a time in seconds.

        Before and after its timeline a picture stays as it is at its ends, unless it loops.

        Raises:
            UsageError: The picture has no timeline, or the time is not a number.
        """
        return self._with(at(self._picture, t))

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

        return self._with(animate(self._picture, motion, progress))

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
        return pixels.render(
            self._picture, t=t, width=width, height=height, scale=scale, region=region,
            layers=layers, background=background, dtype=dtype, engine=engine, limits=limits,
            progress=progress, cache=self._cache,
        )  # fmt: skip

    def to_bytes(self) -> bytes:
        """The picture as a `.pxi` file.

        Raises:
            LimitError: It is larger than readers accept by default.
        """
        return write.to_bytes(self)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes the picture to `path`, replacing it in one step.

        Raises:
            InputError: The file cannot be written.
        """
        write_atomically(path, self.to_bytes())


class Layer(Editable[Image]):
    """One layer of a picture. Its methods edit: each returns a new image.

    Attributes:
        image: The picture it belongs to.
        position: Its place there, counted from the back.
    """

    def __init__(self, image: Image, position: int) -> None:
        self.image = image
        self.position = position

    def __repr__(self) -> str:
        return f"<Layer {self.name!r} of {self.image!r}>"

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Layer):
            return NotImplemented
        return self.position == other.position and self.image == other.image

    def __hash__(self) -> int:
        return hash((self.image, self.position))

    def __reduce__(self) -> tuple[type[Layer], tuple[Image, int]]:
        # `data` must stay the very layer that the picture has.
        return Layer, (self.image, self.position)

    def _edited(self, op: str, **values: Any) -> Image:
        given = {k: v for k, v in values.items() if v is not None}
        return self.image.edited({"op": op, "layer": self.name, **given})

    @cached_property
    def data(self) -> model.Layer:
        """The layer as data."""
        return self.image.picture.layers[self.position]

    @property
    def name(self) -> str:
        """The name, unique in the picture."""
        return self.data.name

    @property
    def box(self) -> Box:
        """x, y, width, height of the texture's rectangle in canvas pixels."""
        return self.data.box

    @property
    def boundary(self) -> Boundary | None:
        """Closed paths at rest, or None for the whole canvas."""
        return self.data.boundary

    @property
    def outline(self) -> Boundary | None:
        """The boundary in its present place; None for the whole canvas."""
        return neighbours.present_outline(self.image.picture, self.data)

    @property
    def texture(self) -> Texture:
        """Codes and the index of their network, or a view of planes."""
        return self.data.texture

    @property
    def network(self) -> Network | None:
        """What decodes its texture; None where that is no network of the file."""
        return self.image.picture.network_of(self.data)

    @property
    def mesh(self) -> Mesh | None:
        """Proxy nodes, or None."""
        return self.data.mesh

    @property
    def sampling(self) -> int:
        """How features are found: 0 direct, 1 to 3 at the proxy nodes."""
        return self.data.sampling

    @property
    def pose(self) -> Pose:
        """What edits have done to it."""
        return self.data.pose

    @property
    def parent(self) -> str | None:
        """Name of the layer or group that it follows, or None."""
        return self.data.parent

    @property
    def track(self) -> Track | None:
        """How its nodes move over the timeline of the picture, or None."""
        return self.data.track

    @property
    def moved_neighbours(self) -> Moved:
        """What no longer lies to it as it did when the samples of its view were mixed."""
        return neighbours.moved_neighbours(self.image.picture, self.data)


def _restored(data: bytes, damage: tuple[str, ...]) -> Image:
    """The image that was pickled."""
    return Image(replace(read.from_own_bytes(data), damage=damage))


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
    return Image(read.from_bytes(data, limits, tolerant=tolerant))


def open_image(
    path: str | os.PathLike[str], limits: Limits = DEFAULT_LIMITS, *, tolerant: bool = False
) -> Image:
    """Reads a `.pxi` file; see `from_bytes`.

    Raises:
        InputError: The file cannot be read.
        FormatError, UnsupportedError, LimitError: As `from_bytes`.
    """
    return Image(read.from_file(path, limits, tolerant=tolerant))


def encode(
    pixels: NDArray[Any],
    settings: Settings | None = None,
    *,
    masks: Sequence[Region] | None = None,
    blocks: Mapping[str, bytes] | None = None,
    progress: Progress | None = None,
    **options: Any,
) -> Image:
    """Encodes a picture.

    Args:
        pixels: [H, W] or [H, W, C] with C = 1 grey, 2 grey and alpha, 3 RGB, 4 RGB and straight
            alpha; uint8, uint16, or floating point in 0..1.
        settings: What is asked for; `options` are fields of `Settings` given by name instead.
        masks: User-given layers back to front; the built-in decomposition otherwise.
        blocks: Metadata ``icc``, ``exif``, ``xmp`` to carry.
        progress: Called as work goes on.
        options: Fields of `Settings`, such as ``quality=70``.

    Returns:
        The picture as it will be decoded.

    Raises:
        InputError: The array cannot be a picture, or a mask does not fit it.
        UsageError: A setting is out of range.
        UnsupportedError: Something needed is not installed.
    """
    try:
        from .encoder import encode as encoder
    except ModuleNotFoundError as error:
        raise UnsupportedError(
            f"encode needs {error.name}: pip install 'proxyimg-codec[encode]'"
        ) from None
    found = encoder.encode(
        pixels, settings, masks=masks, blocks=blocks, progress=progress, **options
    )
    return Image(found)

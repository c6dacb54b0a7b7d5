"""Public interface of the package: pictures and layers with methods.

An `Image` is a handle to a `model.Picture`; a `Layer` is a handle to one layer of a picture. Both
are immutable: a method that changes something returns a new image. Their methods only call
functions of the lower modules.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pickle import PickleBuffer
from typing import TYPE_CHECKING, Any, SupportsIndex

import numpy as np
from numpy.typing import NDArray

from . import model
from .codec import read
from .container.chunks import Chunk
from .edit.methods import Editable, EditableImage
from .errors import UnsupportedError
from .handles import LayerHandle, MadeOnce, PictureHandle
from .hosted import Hosted
from .io.files import Name, write_bytes
from .io.streams import Readable, Writable
from .limits import DEFAULT_LIMITS, Limits
from .model import Layers, Pictured
from .render import pixels
from .render.cache import Cache
from .render.moment import at, displacements

if TYPE_CHECKING:
    from typing_extensions import Buffer

    from .animate.motion import Motion
    from .encoder.encode import Progress
    from .encoder.settings import Settings
    from .encoder.shapes.mask_arrays import Masks


class Image(PictureHandle, EditableImage, Hosted):
    """A `.pxi` picture in memory. Images are equal if their files are, and are pickled as files.

    ``np.asarray(image)`` are the pixels that `render` gives, and notebooks show them.

    Args:
        picture: The picture as data, or another handle to it.
        cache: Computed colours to share with other images; by default a new, empty cache.
    """

    __slots__ = ("_cache",)

    def __init__(self, picture: Pictured, cache: Cache | None = None) -> None:
        super().__init__(picture.picture)
        self._cache = Cache() if cache is None else cache

    @property
    def cache(self) -> Cache:
        """Computed colours, shared with the images made from this one."""
        return self._cache

    def __repr__(self) -> str:
        names = ", ".join(repr(layer.name) for layer in self._picture.layers)
        return f"<Image {self.width}x{self.height}, layers {names}>"

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Image):
            return NotImplemented
        one, two = self._picture, other._picture
        if one is two:
            return True
        saved = self.chunks == other.chunks and one.history == two.history
        return saved and displacements(one) == displacements(two)

    def __hash__(self) -> int:
        return hash((self._picture.size, tuple(v.name for v in self._picture.layers)))

    def __reduce_ex__(
        self, protocol: SupportsIndex
    ) -> tuple[Callable[..., Image], tuple[Any, ...]]:
        if any(displacements(self._picture)):  # more than a file can hold
            return Image, (self._picture,)
        from .codec import write

        data = write.serialized(self)
        # From protocol 5 on, who carries pickles may carry the file beside them, without copies.
        held = PickleBuffer(data) if operator.index(protocol) >= 5 else data
        return _restored, (held, self.damage)

    @property
    def layers(self) -> Layers[Layer]:
        """Layers back to front; a layer is addressed by its position or its name."""
        return Layers.over(MadeOnce(len(self._picture.layers), Layer, self))

    @property
    def chunks(self) -> tuple[Chunk, ...]:
        """Chunks of the file of this picture, without uNDO and TAIL."""
        from .codec import write

        return write.state(self)

    def _with(self, picture: model.Picture) -> Image:
        """Returns an image of another picture that shares the cache of this one."""
        return Image(picture, self.cache)

    def at(self, t: float) -> Image:
        """Returns one moment of an animated picture as a still picture.

        Args:
            t: Time in seconds. A timeline that loops repeats; otherwise a time before its start or
                after its end counts as its start or end.

        Raises:
            UsageError: The picture has no timeline, or `t` is not a finite number.
        """
        return self._with(at(self._picture, t))

    def animated(
        self, motion: Motion, *, progress: Callable[[int, int], None] | None = None
    ) -> Image:
        """Simulates a motion, and returns the picture with it in place of any earlier motion.

        Args:
            motion: Description of the motion; see `animate.motion`.
            progress: Called with the number of frames simulated so far and of all frames.

        Raises:
            UsageError: The motion does not fit the picture.

        Examples:
            >>> import proxyimg_codec as pxi
            >>> from proxyimg_codec.animate.animate import preset
            >>> image = pxi.open("photo.pxi")
            >>> moving = image.animated(preset(image, "sway", duration=1))
            >>> moving.timeline.seconds
            1.0
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
        out: NDArray[Any] | None = None,
    ) -> NDArray[Any]:
        """Renders the picture, or part of it, at any size.

        Args:
            t: Time in seconds in the timeline of the picture; by default the still is drawn.
            width: Output columns; without `height`, the aspect ratio is kept.
            height: Output rows; without `width`, the aspect ratio is kept.
            scale: Output pixels per canvas pixel, instead of `width` and `height`.
            region: x, y, width, height in canvas pixels; the whole canvas by default.
            layers: Names or positions of the layers to draw; by default all that are not hidden.
            background: Whether to draw the back layer of an opaque picture.
            dtype: uint8 or uint16 (rounded), or float32 in 0..1.
            engine: ``auto``, ``numpy``, ``native`` or ``ort``; ``numpy`` does without the compiled
                kernel, also for what is decoded only now.
            limits: Bounds on the size of the output and on the work it may take.
            progress: Called from the first milliseconds on with how much more is done, in output
                pixels; these add up to all. What it raises ends the work: so it can cancel.
            out: Array for the pixels, of the shape and type of the result.

        Returns:
            Pixels of type `dtype`, in `out` if it is given: [height, width, 3] if the picture is
            opaque and its back layer is drawn, otherwise [height, width, 4] with straight alpha.

        Raises:
            UsageError: An argument has a wrong type or is out of range, arguments contradict each
                other, the layer or engine is unknown, no layer is left, `out` does not fit, or `t`
                is given for a picture without a timeline.
            UnsupportedError: The engine, or a package that it needs, is not installed.
            LimitError: The output is too large, takes too much work, or more memory than there is.
            FormatError: A coded stream that is decoded only now is corrupt.

        Examples:
            >>> import proxyimg_codec as pxi
            >>> image = pxi.open("photo.pxi")
            >>> image.render(width=32).shape
            (24, 32, 3)
            >>> image.render(region=(20, 10, 16, 12), scale=4, dtype="float32").shape
            (48, 64, 3)
        """
        return pixels.render(
            self._picture, t=t, width=width, height=height, scale=scale, region=region,
            layers=layers, background=background, dtype=dtype, engine=engine, limits=limits,
            progress=progress, cache=self.cache, out=out,
        )  # fmt: skip

    def to_bytes(self) -> bytes:
        """Returns the picture as the bytes of a `.pxi` file.

        Raises:
            LimitError: The file would exceed what readers accept by default.
        """
        from .codec import write

        return write.to_bytes(self)

    def save(self, path: Name | Writable) -> None:
        """Writes the picture to a file, which is replaced in one step if it exists.

        Args:
            path: Path of the file, or ``-`` for standard output; a URL that fsspec knows, such as
                ``s3://bucket/a.pxi``; or a file that is open in binary, which stays open.

        Raises:
            InputError: The file cannot be written.
            LimitError: The file would exceed what readers accept by default.
            UnsupportedError: A URL needs a package that is not installed.
            UsageError: An open file takes text.

        Examples:
            >>> import proxyimg_codec as pxi
            >>> image = pxi.open("photo.pxi")
            >>> image.layers["disc"].removed().save("without.pxi")
            >>> [layer.name for layer in pxi.open("without.pxi").layers]
            ['back', 'bar']
        """
        write_bytes(path, self.to_bytes())


class Layer(LayerHandle, Editable[Image]):
    """One layer of a picture. Its methods edit the picture: each returns a new image.

    Attributes:
        image: The picture that the layer belongs to.
        position: Position of the layer in the picture, counted from the back, from 0.
    """

    __slots__ = ("_image",)

    def __init__(self, image: Image, position: int) -> None:
        super().__init__(image.picture, position)
        self._image = image

    @property
    def image(self) -> Image:
        """The picture that the layer belongs to."""
        return self._image

    def __repr__(self) -> str:
        return f"<Layer {self.name!r} of {self.image!r}>"

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Layer):
            return NotImplemented
        return self.position == other.position and self.image == other.image

    def __hash__(self) -> int:
        return hash((self.image, self.position))

    def __reduce__(self) -> tuple[type[Layer], tuple[Image, int]]:
        return Layer, (self.image, self.position)

    def _edited(self, op: str, **values: Any) -> Image:
        given = {k: v for k, v in values.items() if v is not None}
        return self.image.edited({"op": op, "layer": self.name, **given})


def _restored(data: Buffer, damage: tuple[str, ...]) -> Image:
    """Restores a pickled image."""
    return Image(replace(read.from_own_bytes(bytes(data)), damage=damage))


def from_bytes(data: Buffer, limits: Limits = DEFAULT_LIMITS, *, tolerant: bool = False) -> Image:
    """Decodes a `.pxi` file held in memory.

    Args:
        data: Bytes of the file: bytes, or any buffer of them, such as a memoryview or mmap.
        limits: Bounds on what decoding the file may cost.
        tolerant: Whether to decode as much as possible of a truncated or damaged file. The damage
            is logged as a warning, and described in `Image.damage`.

    Raises:
        FormatError: The file breaks the format; or, if `tolerant`, too little of it is left.
        UnsupportedError: The file needs a newer reader.
        LimitError: The file exceeds `limits`.
        UsageError: `data` is no buffer of bytes.

    Examples:
        >>> import proxyimg_codec as pxi
        >>> with open("photo.pxi", "rb") as file:
        ...     image = pxi.from_bytes(file.read())
        >>> image.width, image.height
        (64, 48)
    """
    return Image(read.from_bytes(data, limits, tolerant=tolerant))


def open_image(
    path: Name | Readable, limits: Limits = DEFAULT_LIMITS, *, tolerant: bool = False
) -> Image:
    """Reads and decodes a `.pxi` file.

    Args:
        path: Path of the file, or ``-`` for standard input; a URL that fsspec knows; or a file that
            is open in binary, which is read from its present place to its end, and stays open.
        limits: Bounds on what decoding the file may cost.
        tolerant: As for `from_bytes`.

    Raises:
        InputError: The file cannot be read.
        FormatError, UnsupportedError, LimitError, UsageError: As `from_bytes`.

    Examples:
        >>> import proxyimg_codec as pxi
        >>> image = pxi.open("photo.pxi")
        >>> [layer.name for layer in image.layers]
        ['back', 'bar', 'disc']
    """
    return Image(read.from_file(path, limits, tolerant=tolerant))


def encode(
    pixels: NDArray[Any],
    settings: Settings | None = None,
    *,
    masks: Masks | None = None,
    blocks: Mapping[str, bytes] | None = None,
    behind: NDArray[Any] | None = None,
    progress: Progress | None = None,
    **options: Any,
) -> Image:
    """Encodes a picture.

    Args:
        pixels: [H, W] or [H, W, C] with C = 1 for grey, 2 for grey and alpha, 3 for RGB, 4 for RGB
            and alpha; alpha is straight; integers without a sign, of which the largest of their
            type is white, bool, or floating point in 0..1.
        settings: Settings of the encoder; by default ``Settings()``.
        masks: Layers given by the user, back to front; by default the encoder finds layers itself.
            Arrays [H, W] (bool, 0 and 1, 0..255, or 0..1, cut at one half) or regions in a list, in
            a dict by name or in an array [N, H, W]; or one array [H, W] of labels, 0 is the back.
        blocks: Metadata blocks to carry: ``icc`` and ``cicp``, which say what colours these are,
            ``exif`` and ``xmp``; `io.raster.read` gives those of a file.
        behind: The picture without its objects, as `pixels`, of the same size and colours, and
            opaque: what shows of the back layer when others are moved. Pyramid only.
        progress: Called with the name of a stage, and its numbers of units done and in all.
        options: Fields of `Settings` that replace those of `settings`, such as ``quality=70``.

    Returns:
        The picture as a reader will decode it.

    Raises:
        InputError: An array cannot be a picture, or a mask or `behind` does not fit it.
        UsageError: A setting is out of range, or `behind` contradicts one.
        UnsupportedError: A package that is needed is not installed.
        LimitError: The picture is larger than readers accept by default, or than memory.

    Examples:
        >>> import numpy as np
        >>> import proxyimg_codec as pxi
        >>> pixels = np.full((48, 64, 3), 200, np.uint8)
        >>> pxi.encode(pixels, quality=40, effort=1, max_layers=1).render().shape
        (48, 64, 3)
    """
    try:
        from .encoder import encode as encoder
    except ModuleNotFoundError as error:
        raise UnsupportedError(
            f"encode needs {error.name}: pip install 'proxyimg-codec[encode]'"
        ) from None
    return Image(
        encoder.encode(
            pixels,
            settings,
            masks=masks,
            blocks=blocks,
            behind=behind,
            progress=progress,
            **options,
        )
    )

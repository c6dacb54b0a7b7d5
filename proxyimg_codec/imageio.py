"""Plugin for imageio, which with ``import proxyimg_codec.imageio`` reads and writes `.pxi` files.

import imageio.v3 as iio
import proxyimg_codec.imageio

pixels = iio.imread("photo.pxi", width=640)  # or any other argument of `Image.render`
iio.imwrite("small.pxi", pixels, quality=60, effort=3)  # or of `proxyimg_codec.encode`
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from types import EllipsisType
from typing import Any

import numpy as np
from imageio.config import known_extensions, known_plugins
from imageio.config.extensions import FileExtension
from imageio.config.plugins import PluginConfig
from imageio.core.request import URI_BYTES, InitializationError, IOMode, Request
from imageio.core.v3_plugin_api import ImageProperties, PluginV3
from numpy.typing import ArrayLike, NDArray

from . import api
from .container.chunks import SIGNATURE
from .errors import PxiError, UsageError

NAME = "proxyimg"

Index = int | EllipsisType | None


@contextmanager
def _as_imageio() -> Iterator[None]:
    """Context in which errors become those that programs expect: ValueError, or else OSError."""
    try:
        yield
    except UsageError as error:
        raise ValueError(str(error)) from error
    except PxiError as error:
        raise OSError(str(error)) from error


class PxiPlugin(PluginV3):  # type: ignore[misc]  # imageio has no types
    """A `.pxi` file as imageio sees it: one picture, drawn when it is read.

    Args:
        request: Access to the file.

    Raises:
        InitializationError: It is no such file, or is to be written under another suffix.
        OSError: It is damaged, or needs more than the limits of a reader.
    """

    def __init__(self, request: Request) -> None:
        super().__init__(request)
        self._image: api.Image | None = None
        if request.mode.io_mode is IOMode.write:
            if request.extension not in (None, ".pxi"):
                raise InitializationError(f"{request.extension} is no .pxi file")
            return
        data = request.get_file().read()
        if not data.startswith(SIGNATURE):
            raise InitializationError("no .pxi file")
        with _as_imageio():
            self._image = api.from_bytes(data)

    def _opened(self, index: Index) -> api.Image:
        """The picture.

        Raises:
            ValueError: Another one than the only one is asked for.
        """
        if self._image is None:
            raise ValueError("the file was opened to be written")
        if index not in (0, -1, None, ...):
            raise ValueError(f"index {index}: a .pxi file holds one picture")
        return self._image

    def read(self, *, index: Index = None, **options: Any) -> NDArray[Any]:
        """Draws the picture.

        Args:
            index: 0 or None for the picture; ``...`` adds an axis in front.
            options: Arguments of `Image.render`, such as ``width``, ``region`` or ``dtype``.

        Returns:
            [height, width, 3 or 4], uint8 unless `dtype` says otherwise.

        Raises:
            ValueError: There is no such index, or an argument is wrong.
            OSError: What is decoded only now is corrupt, or it takes too much work.
        """
        image = self._opened(index)
        with _as_imageio():
            pixels = image.render(**options)
        return pixels[None] if index is ... else pixels

    def iter(self, **options: Any) -> Iterator[NDArray[Any]]:
        """Yields the picture, drawn as by `read`."""
        yield self.read(index=0, **options)

    def write(self, ndimage: ArrayLike | list[ArrayLike], **options: Any) -> bytes | None:
        """Encodes a picture.

        Args:
            ndimage: [H, W], [H, W, 1..4], or one such array in a list or behind an axis of 1.
            options: Arguments of `proxyimg_codec.encode`, such as ``quality`` or ``masks``.

        Returns:
            The file, if it is written to ``<bytes>``; otherwise None.

        Raises:
            ValueError: These are several pictures, or an argument is wrong.
            OSError: The array cannot be a picture, or it cannot be written.
        """
        pixels = np.asarray(ndimage)
        if pixels.ndim == 4 or (isinstance(ndimage, list | tuple) and pixels.ndim == 3):
            if len(pixels) != 1:
                raise ValueError(f"a .pxi file holds one picture, these are {len(pixels)}")
            pixels = pixels[0]
        with _as_imageio():
            data = api.encode(pixels, **options).to_bytes()
        self.request.get_file().write(data)
        return data if self.request._uri_type == URI_BYTES else None

    def properties(self, index: Index = None) -> ImageProperties:
        """Shape and type of what `read` gives, without drawing it."""
        image = self._opened(index)
        solid = image.opaque and not image.layers[0].pose.hidden
        shape = (image.height, image.width, 3 if solid else 4)
        batch = index is ...
        return ImageProperties(
            shape=(1, *shape) if batch else shape,
            dtype=np.dtype(np.uint8),
            n_images=1 if batch else None,
            is_batch=batch,
        )

    def metadata(self, index: Index = None, exclude_applied: bool = True) -> dict[str, Any]:
        """Metadata blocks by name, and the names of the layers from back to front.

        Args:
            index: As for `read`.
            exclude_applied: Of no effect: orientation has no place in the file.
        """
        image = self._opened(index)
        return {**image.blocks, "layers": [layer.name for layer in image.layers]}


known_plugins[NAME] = PluginConfig(NAME, "PxiPlugin", __name__)
known_extensions[".pxi"] = [
    FileExtension(
        extension=".pxi",
        priority=[NAME],
        name="ProxyImg",
        description="Layered, resolution-free pictures",
    )
]

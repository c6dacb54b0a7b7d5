"""Plugin for Pillow: after ``import proxyimg_codec.pillow``, Pillow opens and saves `.pxi` files.

    from PIL import Image
    import proxyimg_codec.pillow

    with Image.open("photo.pxi") as photo:  # nothing is drawn yet
        photo.thumbnail((256, 256))         # drawn at this size, and no larger
        photo.save("photo.jpg")
    Image.open("photo.png").save("photo.pxi", quality=60, effort=3)

Pillow has 8 bits a sample; files of more are drawn in 8. A picture whose back is hidden or clear is
RGBA, others are RGB. `PxiImageFile.pxi` is the picture with its layers.

Options of `Image.save` are those fields of `encoder.settings.Settings` that are given by name,
``masks`` and ``behind`` as for `proxyimg_codec.encode`, and ``exif``, ``icc_profile`` and ``xmp``
as for other types: profile and XMP are those of the picture unless given, EXIF is left out. Other
options are passed over, as plugins do.
"""

from __future__ import annotations

import io
import math
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import fields
from typing import IO, Any

import numpy as np
from PIL import Image, ImageFile

from . import api
from .container.chunks import SIGNATURE
from .errors import LimitError, PxiError, UnsupportedError, UsageError
from .io import color, exif, metadata
from .io.raster import turned
from .limits import Limits

FORMAT, MIME = "PXI", "image/vnd.pxi"

STORED = {"1": "L", "L": "L", "LA": "LA", "RGB": "RGB", "RGBA": "RGBA", "I;16": "I;16",
          "I;16L": "I;16", "I;16B": "I;16", "La": "LA", "RGBa": "RGBA", "RGBX": "RGB", "PA": "RGBA",
          "CMYK": "RGB", "YCbCr": "RGB", "LAB": "RGB", "HSV": "RGB"}  # fmt: skip
"""Mode in which pictures of a mode are encoded; one of P depends on its palette."""


@contextmanager
def _as_pillow() -> Iterator[None]:
    """Context in which errors become those that programs expect of Pillow.

    Raises:
        DecompressionBombError: For a `LimitError`.
        ValueError: For a `UsageError`.
        OSError: For any other `PxiError`.
    """
    try:
        yield
    except LimitError as error:
        raise Image.DecompressionBombError(str(error)) from error
    except UsageError as error:
        raise ValueError(str(error)) from error
    except PxiError as error:
        raise OSError(str(error)) from error


def _limits() -> Limits:
    """Limits of a reader, with that of Pillow on the pixels that are drawn."""
    most = Image.MAX_IMAGE_PIXELS
    return Limits() if most is None else Limits(output_pixels=2 * most)


class PxiImageFile(ImageFile.ImageFile):
    """A `.pxi` file as Pillow sees it: read when it is opened, drawn when pixels are needed.

    Attributes:
        pxi: The picture with its layers.
    """

    format = FORMAT
    format_description = "ProxyImg layered picture"
    pxi: api.Image

    def _open(self) -> None:
        assert self.fp is not None
        with _as_pillow():
            data = self.fp.read()
            tolerant = bool(ImageFile.LOAD_TRUNCATED_IMAGES)
            self.pxi = api.from_bytes(data, _limits(), tolerant=tolerant)
        solid = self.pxi.opaque and not self.pxi.layers[0].pose.hidden
        self._mode = "RGB" if solid else "RGBA"
        self.info.update(_info(self.pxi))
        self._draw_at((self.pxi.width, self.pxi.height))

    def _draw_at(self, size: tuple[int, int]) -> None:
        """Sets the size in pixels at which it will be drawn."""
        self._size = size
        self.tile = [ImageFile._Tile("raw", (0, 0, *size), 0, self.mode)]

    def draft(
        self, mode: str | None, size: tuple[int, int] | None
    ) -> tuple[str, tuple[int, int, float, float]] | None:
        """Sets the size at which it will be drawn, if it is not drawn yet.

        Args:
            mode: Mode that would do; only the one that it has is there.
            size: Columns and rows that are needed; it will have at least as many and the same
                shape, but at most those of the canvas.

        Returns:
            The mode, and the rectangle that the picture takes; None if it is drawn already.
        """
        if size is None or not self.tile:
            return None
        canvas = (self.pxi.width, self.pxi.height)
        scale = min(1.0, max(asked / had for asked, had in zip(size, canvas, strict=True)))
        wide, high = (max(1, math.ceil(side * scale)) for side in canvas)
        self._draw_at((wide, high))
        return self.mode, (0, 0, wide, high)

    def thumbnail(
        self,
        size: tuple[float, float],
        resample: Image.Resampling = Image.Resampling.BICUBIC,
        reducing_gap: float | None = 2.0,
    ) -> None:
        """Makes it small enough for a size; drawn at the final size, if it is not drawn yet.

        Args:
            size: Most columns and rows.
            resample: Filter, if it is drawn already.
            reducing_gap: As for other pictures; None draws it whole and reduces it.
        """
        if self.tile and reducing_gap is not None:
            self._draw_at(_fitting(self.size, (math.floor(size[0]), math.floor(size[1]))))
        super().thumbnail(size, resample, reducing_gap)

    def load(self) -> Any:
        """Draws it, if that is not done yet, and returns access to its pixels.

        Raises:
            OSError: What is decoded only now is corrupt.
            DecompressionBombError: It is too large, or takes too much work or memory.
        """
        if self.tile and self._im is None:
            with _as_pillow():
                pixels = self.pxi.render(width=self.width, height=self.height, limits=_limits())
            if self.fp and self._exclusive_fp:
                self.fp.close()
            self.fp = io.BytesIO(pixels.tobytes())
        return super().load()

    def load_seek(self, pos: int) -> None:
        """Nothing to seek: pixels begin where the file does."""


def _fitting(size: tuple[int, int], most: tuple[int, int]) -> tuple[int, int]:
    """Largest size of the same shape within another, rounded as `Image.thumbnail` does."""
    (wide, high), (x, y) = size, most
    if (x >= wide and y >= high) or min(most) < 1:
        return size
    shape = wide / high

    def nearest(number: float, error: Any) -> int:
        return max(1, min(math.floor(number), math.ceil(number), key=error))

    if x / y >= shape:
        return nearest(y * shape, lambda n: abs(shape - n / y)), y
    return x, nearest(x / shape, lambda n: 0 if n == 0 else abs(shape - x / n))


def _info(image: api.Image) -> dict[str, bytes]:
    """Metadata under the names of Pillow; colours as a profile."""
    blocks = metadata.upright(image.blocks)
    icc = blocks.get("icc")
    if icc is None and "cicp" in blocks:
        with suppress(UnsupportedError):  # without imagecodecs nothing makes one
            icc = color.profile_of(blocks["cicp"])
    found = {"icc_profile": icc, "exif": blocks.get("exif"), "xmp": blocks.get("xmp")}
    return {name: block for name, block in found.items() if block}


def _accept(prefix: bytes) -> bool:
    return prefix.startswith(SIGNATURE)


def _save(im: Image.Image, fp: IO[bytes], filename: str | bytes) -> None:
    """Encodes a picture; the pixels of one that EXIF turns are turned."""
    from .encoder.settings import Settings

    given = dict(im.encoderinfo)
    names = {f.name for f in fields(Settings)} | {"masks", "behind"}
    options = {k: v for k, v in given.items() if k in names and v is not None}
    told = given.get("exif") or b""
    told = told.tobytes() if isinstance(told, Image.Exif) else bytes(told)
    told = told.removeprefix(b"Exif\x00\x00")
    carried = {
        "exif": told,
        "icc": given.get("icc_profile", im.info.get("icc_profile")),
        "xmp": given.get("xmp", im.info.get("xmp")),
    }
    blocks = {name: bytes(block) for name, block in carried.items() if block}
    pixels = np.ascontiguousarray(turned(_samples(im), exif.orientation(told) or 1))
    with _as_pillow():
        fp.write(api.encode(pixels, blocks=metadata.upright(blocks), **options).to_bytes())


def _samples(im: Image.Image) -> np.ndarray[Any, Any]:
    """Pixels that can be encoded.

    Raises:
        OSError: The mode has samples that do not say what white is.
    """
    mode = STORED.get(im.mode)
    if im.mode == "P":
        mode = "RGBA" if im.has_transparency_data else "RGB"
    if mode is None:
        raise OSError(f"cannot write mode {im.mode} as PXI")
    if im.mode in ("RGB", "L") and im.has_transparency_data:  # one colour is clear
        mode = {"RGB": "RGBA", "L": "LA"}[mode]
    if mode == "I;16":
        return np.asarray(im).astype(np.uint16)
    return np.asarray(im if mode == im.mode else im.convert(mode))


Image.register_open(FORMAT, PxiImageFile, _accept)
Image.register_save(FORMAT, _save)
Image.register_extension(FORMAT, ".pxi")
Image.register_mime(FORMAT, MIME)

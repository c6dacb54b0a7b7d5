"""Methods by which numpy, notebooks and Dask take an image: nobody calls them by hand."""

from __future__ import annotations

import hashlib
import pickle
from abc import ABC, abstractmethod
from collections.abc import Container, Mapping
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from .io.png import encode_png

SHOWN_MAX = 1024
"""Longest side in pixels of a picture that a notebook shows."""


class Hosted(ABC):
    """Something that is drawn and pickled, as other programs see it."""

    __slots__ = ()

    @property
    @abstractmethod
    def width(self) -> int:
        """Canvas width in pixels."""

    @property
    @abstractmethod
    def height(self) -> int:
        """Canvas height in pixels."""

    @property
    @abstractmethod
    def blocks(self) -> Mapping[str, bytes]:
        """Metadata blocks, of which a notebook needs the colours."""

    @abstractmethod
    def render(self, *, width: int | None = None, height: int | None = None) -> NDArray[Any]:
        """Draws it: uint8 [height, width, 3 or 4]."""

    def __array__(self, dtype: DTypeLike | None = None, copy: bool | None = None) -> NDArray[Any]:
        """Draws it at its own size, as numpy asks for it.

        Args:
            dtype: Type to convert uint8 samples to, which stay in 0..255.
            copy: Whether the array may not be shared with anything; it never is.

        Raises:
            ValueError: `copy` is False, but pixels are always made anew.
            PxiError: As `Image.render`.
        """
        if copy is False:
            raise ValueError("the pixels of an image are made when they are asked for: copy=False "
                             "cannot be")  # fmt: skip
        pixels = self.render()
        return pixels if dtype is None else pixels.astype(np.dtype(dtype), copy=False)

    def _repr_png_(self) -> tuple[bytes, dict[str, int]]:
        """Draws a PNG file, at most `SHOWN_MAX` pixels a side, and says its size."""
        scale = min(1.0, SHOWN_MAX / max(self.width, self.height))
        wide, high = (max(1, round(side * scale)) for side in (self.width, self.height))
        pixels = self.render(width=wide, height=high)
        colours = {k: v for k, v in self.blocks.items() if k in ("icc", "cicp")}
        return encode_png(pixels, colours), {"width": wide, "height": high}

    def _repr_mimebundle_(
        self, include: Container[str] | None = None, exclude: Container[str] | None = None
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        """Returns the forms in which a notebook may show it, by media type, and their sizes.

        Args:
            include: Media types that are wanted; all by default.
            exclude: Media types that are not.
        """
        wanted = [
            kind for kind in ("text/plain", "image/png")
            if (include is None or kind in include) and (exclude is None or kind not in exclude)
        ]  # fmt: skip
        forms: dict[str, Any] = {}
        facts: dict[str, Any] = {}
        if "text/plain" in wanted:
            forms["text/plain"] = repr(self)
        if "image/png" in wanted:
            forms["image/png"], facts["image/png"] = self._repr_png_()
        return forms, facts

    def __dask_tokenize__(self) -> tuple[str, str]:
        """Returns a name for what it holds, the same in every process, for Dask."""
        return type(self).__qualname__, hashlib.sha256(pickle.dumps(self, 4)).hexdigest()

"""Limits on the time and memory that a reader spends on a file or picture.

The cost of every part of a file is added up before the part is decoded. A function that decodes a
whole file, or draws a picture, makes one `Budget` of the limits, and all its stages spend from it.
Public functions take `Limits`; a function that takes a `Budget` is one of those stages.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, fields

from .errors import LimitError

SAMPLE_COST_BITS = 10
"""Cost of a sample of a layer: 2**SAMPLE_COST_BITS multiplications."""


SMALL_FILE = 1 << 20
"""Largest size in bytes of a small file, for which the stricter limits ``small_...`` hold too."""


@dataclass(frozen=True)
class Limits:
    """Upper bounds for reading and rendering; the defaults suit a desktop program.

    Attributes:
        file_bytes: Size of a file.
        chunks: Chunks in a file, including those of its history.
        side: Canvas width or height in pixels.
        layers: Layers in a file.
        networks: Decoder networks in a file.
        segments: Bézier segments in all boundaries together.
        gates: Gates of all meshes together; a gate is a step of decoding the connectivity.
        small_gates: The same in a file of at most `SMALL_FILE` bytes.
        faces: Triangles of all refined meshes together.
        overlap: Average number of triangles of a deformed layer that cover a sample.
        beyond: Pairs of a face and a sample outside the mesh whose distances are compared, of all
            layers together; likewise pairs of a face and a run of 48 control points of a boundary
            that follows the mesh.
        codes: Scalar codes of all textures and cells of all masks together, stored or not.
        small_codes: The same in a file of at most `SMALL_FILE` bytes.
        samples: Raster samples of all planes together.
        small_samples: The same in a file of at most `SMALL_FILE` bytes.
        filled: Raster samples of all views with a mask or cuts; hidden ones may have to be filled.
        covered: Raster samples of all views with cuts, counted once for each boundary that cuts;
            and if the layer's own boundary cuts, once more for each layer behind it.
        wavefronts: Steps of decoding arrays: columns plus twice the rows, of all planes of codes,
            masks, and curves and shapes of a motion; of rasters columns plus thrice the rows.
        motion: Coefficients of all curves, and coordinates of all shapes, together.
        parameters: Parameters of all networks together.
        metadata_bytes: Metadata, history and script together, after decompression.
        references: Chunks of all states of a history together.
        output_pixels: Pixels of one rendered picture.
        multiply_adds: Multiplications for one rendered picture: those of the networks; 2^7 for each
            feature of each anchor, for each sample of a layer with a global feature; 2^10 for each
            sample of each layer, for each triangle, and for each sample in a triangle.
        work: Edges of flattened boundaries, and their pieces in rows and in samples, of one
            rendered picture.
    """

    file_bytes: int = 1 << 30
    chunks: int = 1 << 16
    side: int = 1 << 20
    layers: int = 1024
    networks: int = 64
    segments: int = 1 << 16
    gates: int = 1 << 16
    small_gates: int = 1 << 15
    faces: int = 1 << 18
    overlap: int = 64
    beyond: int = 1 << 28
    codes: int = 1 << 24
    small_codes: int = 1 << 23
    samples: int = 1 << 26
    small_samples: int = 1 << 24
    filled: int = 1 << 27
    covered: int = 1 << 31
    wavefronts: int = 1 << 17
    motion: int = 1 << 22
    parameters: int = 1 << 22
    metadata_bytes: int = 1 << 26
    references: int = 1 << 20
    output_pixels: int = 1 << 28
    multiply_adds: int = 1 << 43
    work: int = 1 << 28

    def check(self, name: str, value: int) -> None:
        """Raises `LimitError` if `value` exceeds the limit called `name`."""
        allowed = getattr(self, name)
        if value > allowed:
            raise LimitError(
                f"{name.replace('_', ' ')}: {value} exceeds the limit of {allowed}; raise it with "
                f"Limits({name}=...) or --limit {name}=... if you trust the file",
                rule="SEC-2",
            )


class Budget:
    """Running account of what was spent of the limits for one file or one rendered picture.

    Attributes:
        limits: The limits.
        spent: Amount spent so far, by the name of the limit.
    """

    def __init__(self, limits: Limits | None = None) -> None:
        self.limits = limits or DEFAULT_LIMITS
        self.spent: Counter[str] = Counter()

    def check(self, name: str, value: int) -> None:
        """Raises `LimitError` if `value` alone exceeds the limit called `name`."""
        self.limits.check(name, value)

    def spend(self, name: str, amount: int) -> None:
        """Spends `amount` of the limit called `name`.

        Raises:
            LimitError: The sum of this and all earlier amounts exceeds the limit.
        """
        self.spent[name] += amount
        self.check(name, self.spent[name])
        if 0 < self.spent["file_bytes"] <= SMALL_FILE and name in SMALL:
            self.check(SMALL[name], self.spent[name])

    def left(self, name: str) -> int:
        """Amount that may still be spent of the limit called `name`."""
        return int(getattr(self.limits, name)) - self.spent[name]

    def fits_small(self) -> bool:
        """Whether the amounts spent are within the limits of small files."""
        limits = self.limits
        return all(self.spent[name] <= getattr(limits, small) for name, small in SMALL.items())


SMALL = {f.name.removeprefix("small_"): f.name for f in fields(Limits) if "small_" in f.name}
"""Names of the limits of small files, by the names of the general limits that they tighten."""

DEFAULT_LIMITS = Limits()


@contextmanager
def enough_memory(purpose: str) -> Iterator[None]:
    """Context, or decorator, in which a `MemoryError` becomes a `LimitError`.

    Args:
        purpose: End of the message, such as ``"for the file"``.

    Raises:
        LimitError: There is not enough memory.
    """
    try:
        yield
    except MemoryError:
        raise LimitError(f"there is not enough memory {purpose}") from None

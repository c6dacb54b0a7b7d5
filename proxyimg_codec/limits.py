"""What a reader is willing to spend on a file. Every number read from a file is checked here.

What a file asks for is added up over all its parts, before it is done: whoever decodes a file, or
draws a picture, makes one `Budget` of the limits, which all stages draw from. Public functions take
`Limits`; what takes a `Budget` is one of those stages.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, fields

from .errors import LimitError

SAMPLE_COST_BITS = 10
"""A sample of a layer counts as 2**SAMPLE_COST_BITS multiplications."""


SMALL_FILE = 1 << 20
"""Up to this size in bytes a file is small: it may hold less, whose `Limits` begin with `small`."""


@dataclass(frozen=True)
class Limits:
    """Upper bounds for reading and rendering; the defaults suit a desktop program.

    Attributes:
        file_bytes: Size of a file.
        chunks: Chunks in a file, with those of its history.
        side: Canvas width or height in pixels.
        layers: Layers in a file.
        networks: Decoder networks in a file.
        segments: Bézier segments in all boundaries together.
        gates: Gates of all meshes together: steps of decoding their connectivity.
        small_gates: The same in a file of at most `SMALL_FILE` bytes.
        faces: Triangles of all refined meshes together.
        overlap: How often, in the mean, the triangles of a deformed layer may cover a sample.
        beyond: Pairs that are compared of a face and a point that no face of a mesh holds, of all
            layers together; and of a face and 48 control points that ride on the mesh.
        codes: Scalar codes of all textures and cells of all masks together, stored or not.
        small_codes: The same in a file of at most `SMALL_FILE` bytes.
        samples: Raster samples of all planes together.
        small_samples: The same in a file of at most `SMALL_FILE` bytes.
        filled: Raster samples of all parts that are shown with a mask or cuts, which may have to be
            filled.
        covered: Raster samples of all parts that boundaries cut, once for each of these, and for
            each layer behind one that cuts itself.
        wavefronts: Columns plus twice the rows of all planes of codes, masks, and the curves and
            shapes of a motion, and plus thrice the rows of rasters: steps of decoding them.
        motion: Coefficients of all curves, and coordinates of all shapes, together.
        parameters: Parameters of all networks together.
        metadata_bytes: Metadata, history and script together, after decompression.
        references: Chunks of all states of a history together.
        output_pixels: Pixels of one rendered picture.
        multiply_adds: Multiplications of the networks of one rendered picture, 2^7 for each feature
            of an anchor that a sample is made of, and 2^10 for each sample of each layer, each
            triangle, and each sample that it holds.
        work: Edges of boundaries, and their pieces in rows and samples, of one rendered picture.
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
    """Limits of which all that is done for one file, or for one picture, is taken.

    Attributes:
        limits: What may be spent.
        spent: What was spent so far, by the name of its limit.
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
            LimitError: Together with what was spent before it exceeds the limit.
        """
        self.spent[name] += amount
        self.check(name, self.spent[name])
        if 0 < self.spent["file_bytes"] <= SMALL_FILE and name in SMALL:
            self.check(SMALL[name], self.spent[name])

    def left(self, name: str) -> int:
        """How much may still be spent of the limit called `name`."""
        return int(getattr(self.limits, name)) - self.spent[name]

    def fits_small(self) -> bool:
        """Whether a small file may hold what was spent."""
        limits = self.limits
        return all(self.spent[name] <= getattr(limits, small) for name, small in SMALL.items())


SMALL = {f.name.removeprefix("small_"): f.name for f in fields(Limits) if "small_" in f.name}
"""The limits of small files, by the limits that they are stricter than."""

DEFAULT_LIMITS = Limits()

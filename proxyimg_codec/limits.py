"""What a reader is willing to spend on a file. Every number read from a file is checked here.

What a file asks for is added up over all its parts, before it is done: whoever decodes a file, or
draws a picture, makes one `Budget` of the limits, which all stages draw from.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field, fields

from .errors import LimitError

SAMPLE_COST_BITS = 10
"""A sample of a layer counts as 2**SAMPLE_COST_BITS multiplications."""


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
        faces: Triangles of all refined meshes together.
        overlap: How often, in the mean, the triangles of a deformed layer may cover a sample.
        beyond: Pairs that are compared of a face and a point that no face of a mesh holds, of all
            layers together; and of a face and 48 control points that ride on the mesh.
        codes: Scalar codes of all textures and cells of all masks together, stored or not.
        samples: Raster samples of all planes together.
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
        multiply_adds: Multiplications of the networks of one rendered picture, and 2^10 for each
            sample of each layer and of each triangle.
        work: Edges of boundaries, and their pieces in rows and samples, of one rendered picture.
    """

    file_bytes: int = 1 << 30
    chunks: int = 1 << 16
    side: int = 1 << 20
    layers: int = 1024
    networks: int = 64
    segments: int = 1 << 16
    gates: int = 1 << 16
    faces: int = 1 << 18
    overlap: int = 64
    beyond: int = 1 << 28
    codes: int = 1 << 24
    samples: int = 1 << 26
    filled: int = 1 << 27
    covered: int = 1 << 31
    wavefronts: int = 1 << 17
    motion: int = 1 << 22
    parameters: int = 1 << 22
    metadata_bytes: int = 1 << 26
    references: int = 1 << 20
    output_pixels: int = 1 << 28
    multiply_adds: int = 1 << 43
    work: int = 1 << 30

    def check(self, name: str, value: int) -> None:
        """Raises `LimitError` if `value` exceeds the limit called `name`."""
        allowed = getattr(self, name)
        if value > allowed:
            raise LimitError(
                f"{name.replace('_', ' ')}: {value} exceeds the limit of {allowed}; raise it with "
                f"Limits({name}=...) or --limit {name}=... if you trust the file",
                rule="SEC-2",
            )

    def spend(self, name: str, amount: int) -> None:
        """Checks `amount`, in a `Budget` together with all that was spent before.

        Raises:
            LimitError: It exceeds the limit called `name`.
        """
        self.check(name, amount)

    def budget(self) -> Budget:
        """A budget of which nothing is spent; of a budget itself, what is left of it."""
        return Budget(**{f.name: getattr(self, f.name) for f in fields(Limits)})


@dataclass(frozen=True)
class Budget(Limits):
    """Limits of which all that is done for one file, or one picture, is taken."""

    spent: Counter[str] = field(default_factory=Counter)

    def spend(self, name: str, amount: int) -> None:
        """Spends `amount`; see `Limits.spend`."""
        self.spent[name] += amount
        self.check(name, self.spent[name])

    def budget(self) -> Budget:
        """Itself."""
        return self


DEFAULT_LIMITS = Limits()

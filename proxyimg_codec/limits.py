"""What a reader is willing to spend on a file. Every number read from a file is checked here."""

from __future__ import annotations

from dataclasses import dataclass

from .errors import LimitError


@dataclass(frozen=True)
class Limits:
    """Upper bounds for reading and rendering; the defaults suit a desktop program.

    Attributes:
        file_bytes: Size of a file.
        chunks: Chunks in a file.
        side: Canvas width or height in pixels.
        layers: Layers in a file.
        networks: Decoder networks in a file.
        segments: Bézier segments in all boundaries together.
        gates: Gates of all meshes together: steps of decoding their connectivity.
        faces: Triangles of one refined mesh.
        overlap: How often, in the mean, the triangles of a deformed layer may cover a sample.
        beyond: Pairs of a point that no face of a mesh holds and a face, which are compared to
            find the nearest.
        codes: Scalar codes of all textures and cells of all masks together, stored or not.
        samples: Raster samples of all planes together.
        filled: Raster samples of all parts that are shown with a mask or cuts, which may have to be
            filled.
        covered: Raster samples of all parts that boundaries cut, once for each of these, and for
            each layer behind one that cuts itself.
        wavefronts: Columns plus twice the rows of a plane of codes, a mask, or the curves or shapes
            of a motion, or plus thrice the rows of a raster: steps of its decoding.
        motion: Coefficients of all curves, and coordinates of all shapes, together.
        parameters: Parameters of all networks together.
        metadata_bytes: One metadata block after decompression.
        references: Chunks of all states of a history together.
        output_pixels: Pixels of one rendered picture.
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
    codes: int = 1 << 25
    samples: int = 1 << 26
    filled: int = 1 << 27
    covered: int = 1 << 31
    wavefronts: int = 1 << 16
    motion: int = 1 << 22
    parameters: int = 1 << 22
    metadata_bytes: int = 1 << 26
    references: int = 1 << 20
    output_pixels: int = 1 << 28

    def check(self, name: str, value: int) -> None:
        """Raises `LimitError` if `value` exceeds the limit called `name`."""
        allowed = getattr(self, name)
        if value > allowed:
            raise LimitError(
                f"{name.replace('_', ' ')}: {value} exceeds the limit of {allowed}; "
                f"raise it with Limits({name}=...) if you trust the file",
                rule="SEC-2",
            )


DEFAULT_LIMITS = Limits()

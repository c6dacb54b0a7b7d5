"""TEXR: the texture of one layer, in the order of the layers."""

from .fields import Field

TYPE = "TEXR"

IMPLICIT = 1
"""Number of the implicit coder: a plane of codes decoded by a network of the file."""

FIELDS = (
    Field("coder", "int", "Texture coder: 1 = implicit.", 0, 255),
    Field("network", "int", "Index of the decoder network.", 0, 1 << 16),
    Field("grid", "ints", "Columns and rows of the plane of codes.", 2, 1 << 24, items=2),
    Field("bits", "int", "Bits a code.", 2, 8),
    Field("steps", "bin", "Quantization step of each feature, float16."),
    Field(
        "stored",
        "bin",
        "Coded array [1, rows, columns] of 1 bit: which codes are stored; empty = all.",
    ),
    Field("codes", "bin", "Coded array [D, rows, columns] of the stored codes."),
)

"""TEXR: the texture of one layer, in the order of the layers."""

from collections.abc import Mapping
from typing import Any

from ..errors import UnsupportedError
from .fields import Field

TYPE = "TEXR"

SHARED, IMPLICIT, PYRAMID = 0, 1, 2
"""Numbers of the coders: the texture of an earlier layer; a plane of codes that a network of the
file decodes; a view of the planes of a raster."""

_CODER = Field("coder", "int", "Texture coder: 0 = shared, 1 = implicit, 2 = pyramid.", 0, 255)

SHARED_FIELDS = (
    _CODER,
    Field("texture", "int", "The earlier TEXR, counted from 0, that both layers show.", 0, 1 << 16),
)

FIELDS = (
    _CODER,
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

PYRAMID_FIELDS = (
    _CODER,
    Field("planes", "int", "Index of the planes that give colour.", 0, 1 << 16),
    Field("alpha", "int", "0 = opaque, n = planes n - 1 give alpha.", 0, 1 << 16),
    Field("part", "ints", "x, y, width, height in samples of what is shown, over the whole box.",
          0, 1 << 24, items=4),
    Field("cell", "int", "Side of a cell of the mask is 2^cell samples; MUST be 0 without a mask.",
          0, 6),
    Field("mask", "bin", "Coded array [1, rows, columns] of 1 bit: which cells of the part belong "
          "to the layer; empty = all."),
    Field("cuts", "ints", "Ascending numbers of layers whose boundaries take samples from the "
          "layer: its own, and layers in front.", 0, 1 << 16),
)  # fmt: skip

CODERS = {SHARED: SHARED_FIELDS, IMPLICIT: FIELDS, PYRAMID: PYRAMID_FIELDS}
"""Fields of TEXR by coder."""


def fields_of(payload: bytes) -> tuple[Field, ...]:
    """Declared fields of a TEXR payload, which depend on the coder that it names.

    A payload that names none is taken for one of the implicit coder.

    Raises:
        UnsupportedError: The coder is not known.
    """
    # The coder is the first value: it follows the header of one byte, in a map also its key. In
    # msgpack an integer below 128 is one byte, its value; up to 255 it is a byte CC and the value.
    coder, key, header = IMPLICIT, b"\xa5coder", payload[:1]
    in_map = b"\x80" <= header < b"\x90" and payload.startswith(key, 1)
    if in_map or b"\x90" <= header < b"\xa0":
        at = 1 + in_map * len(key)
        first, second = payload[at : at + 1], payload[at + 1 : at + 2]
        if b"" < first < b"\x80":
            coder = int.from_bytes(first)
        elif first == b"\xcc" and second >= b"\x80":
            coder = int.from_bytes(second)
    if coder not in CODERS:
        raise UnsupportedError(f"chunk TEXR: texture coder {coder} is not known", rule="CHK-13")
    return CODERS[coder]


def mask_shape(fields: Mapping[str, Any]) -> tuple[int, int]:
    """Rows and columns of the cells that cover the part of a pyramid texture.

    Args:
        fields: Values of TEXR with `part` and `cell`.
    """
    _, _, width, height = fields["part"]
    side = 1 << fields["cell"]
    return -(-height // side), -(-width // side)

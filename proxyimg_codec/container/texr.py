"""TEXR: the texture of one layer, in the order of the layers."""

from ..errors import UnsupportedError
from .fields import Field

TYPE = "TEXR"

SHARED, IMPLICIT = 0, 1
"""Coders: the texture of an earlier layer; a plane of codes decoded by a network of the file."""

_CODER = Field("coder", "int", "Texture coder: 0 = shared, 1 = implicit.", 0, 255)

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


def fields_of(payload: bytes) -> tuple[Field, ...]:
    """The fields of a payload, by its coder; those of the implicit coder if it has none.

    Raises:
        UnsupportedError: The coder is not known.
    """
    # The first entry of a canonical map is `coder`: a one-byte header, the key, a small integer,
    # which is itself below 128, or follows a byte CC.
    coder = IMPLICIT
    if payload[1:7] == b"\xa5coder":
        first, second = payload[7:8], payload[8:9]
        if b"" < first < b"\x80":
            coder = int.from_bytes(first)
        elif first == b"\xcc" and second >= b"\x80":
            coder = int.from_bytes(second)
    if coder not in (SHARED, IMPLICIT):
        raise UnsupportedError(f"chunk TEXR: texture coder {coder} is not known")
    return SHARED_FIELDS if coder == SHARED else FIELDS

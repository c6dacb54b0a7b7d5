"""TEXR: the texture of one layer, in the order of the layers."""

from collections.abc import Mapping
from typing import Any

from ..errors import UnsupportedError
from .chunks import VERSION
from .fields import Field

TYPE = "TEXR"

SHARED, IMPLICIT, PYRAMID = 0, 1, 2
"""Numbers of the coders: the texture of an earlier layer; a plane of codes that a network of the
file decodes; a view of the planes of a raster."""

GRAIN_MAX = 6
"""Largest binary logarithm of the side of a cell of sources."""

OFFSETS_MAX = 255
"""Most offsets of a texture, so that the number of one, or 0, fits 8 bits."""

CELLS_MAX = 1 << 16
"""Most cells of sources, which are balanced many times."""

COMPLETED: dict[str, Any] = {
    "behind": 0, "behind_alpha": 0, "grain": 0, "offsets": [], "sources": b"", "unmix": 0,
}  # fmt: skip
"""Fields that pyramid textures have since version 0.11, with values that have no effect."""

ABSENT: dict[str, Any] = {**COMPLETED, "matte": 0}
"""Values for what pyramid textures of earlier versions do not have."""

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
    Field("behind", "int", "0 = none, n = planes n - 1 give samples of the view's own that lie "
          "behind what covers them.", 0, 1 << 16),
    Field("behind_alpha", "int", "0 = opaque, n = planes n - 1 give the alpha of these.",
          0, 1 << 16),
    Field("grain", "int", "Side of a cell of `sources` is 2^grain samples; MUST be 0 without "
          "these.", 0, GRAIN_MAX),
    Field("offsets", "ints", "dx, dy in samples of up to 255 offsets at which hidden samples are "
          "copied.", -(1 << 24), 1 << 24),
    Field("sources", "bin", "Coded array of rows and columns of cells: the offset of each, counted "
          "from 1; 0 = none; empty = none at all."),
    Field("unmix", "int", "1 = samples at the boundary of the layer itself are unmixed where what "
          "is behind has changed; 0 = they are filled.", 0, 1),
    Field("matte", "int", "0 = none, n = planes n - 1 give the alpha of soft samples where what is "
          "behind has changed.", 0, 1 << 16),
)  # fmt: skip

PLANES = ("alpha", "behind", "behind_alpha", "matte")
"""Fields of pyramid textures that are 0, or the number of planes and 1."""

CODERS = {SHARED: SHARED_FIELDS, IMPLICIT: FIELDS, PYRAMID: PYRAMID_FIELDS}
"""Fields of TEXR by coder."""

_ADDED = (((0, 11), len(ABSENT)), ((0, 12), len(ABSENT) - len(COMPLETED)))
"""Versions that added fields of pyramid textures, and how many end what is older."""


def fields_of(payload: bytes, version: tuple[int, int] = VERSION) -> tuple[Field, ...]:
    """Declared fields of a TEXR payload, which depend on the coder that it names.

    A payload that names none is taken for one of the implicit coder.

    Args:
        payload: Payload of the chunk.
        version: Format version, major and minor, that it is written in.

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
    fields = CODERS[coder]
    newer = next((count for since, count in _ADDED if version < since), 0)
    return fields[:-newer] if coder == PYRAMID and newer else fields


def planes_of(fields: Mapping[str, Any]) -> list[int]:
    """Numbers of the planes that a pyramid texture names, in the order of its fields."""
    others = (fields[key] - 1 for key in PLANES if fields[key])
    return [fields["planes"], *others]


def cells_shape(fields: Mapping[str, Any], side: str = "cell") -> tuple[int, int]:
    """Rows and columns of the cells that cover the part of a pyramid texture.

    Args:
        fields: Values of TEXR.
        side: Key of the binary logarithm of the side of a cell: ``cell`` for those of the mask,
            ``grain`` for those of the sources.
    """
    _, _, width, height = fields["part"]
    return -(-height >> fields[side]), -(-width >> fields[side])


def sources_bits(offsets: int) -> tuple[int, int]:
    """Number of channels of the array of sources, 1 or 2, and bits of each.

    The second channel has the upper bits, so that all bits are coded with adaptive counts.

    Args:
        offsets: Number of offsets, 1..`OFFSETS_MAX`.
    """
    bits = offsets.bit_length()
    return (1, bits) if bits <= 4 else (2, 4)

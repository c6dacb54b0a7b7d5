"""PLAN: planes of one raster of the pyramid coder. These are numbered in file order from 0."""

from typing import Any

from .chunks import VERSION
from .fields import Field

TYPE = "PLAN"

TILED_FROM = (0, 12)
"""First version whose PLAN has the fields of `ABSENT`, and stands behind all TEXR."""

ABSENT: dict[str, Any] = {"tile": 0, "details": []}
"""Values for what PLAN of earlier versions does not have."""

TILE_MIN = 6
"""Smallest binary logarithm of the side of a tile, so that there are few streams."""

FIELDS = (
    Field("model", "int", "Registered number of the model.", 0, 65535),
    Field("size", "ints", "Columns and rows of the raster, in samples.", 1, 1 << 24, items=2),
    Field("components", "int", "1 = grey, 3 = colour.", 1, 3),
    Field("step", "int", "Quantization step: 2 ** (step / 64) levels of 0..255.", 0, 640),
    Field("levels", "int", "Levels of the pyramid.", 1, 8),
    Field("grey", "int", "Finest levels that have no chroma.", 0, 8),
    Field("lowest", "ints", "Scale index of each lowest plane.", 0, 63),
    Field(
        "shifts",
        "ints",
        "8 + shift of the scale index: luma and chroma of level 1, then of level 2, and so on.",
        0,
        15,
    ),
    Field(
        "cell",
        "int",
        "Side of a cell of the support is 2 ** cell samples; without effect if that is empty.",
        1,
        8,
    ),
    Field("support", "bin", "Coded array [1, rows, columns] of 1 bit, per cell; empty = all."),
    Field(
        "tile",
        "int",
        "Side of a tile of the latents is 2 ** tile positions; 0 = no tiles.",
        0,
        12,
    ),
    Field(
        "details",
        "ints",
        "What each level adds, from level 1 on: root mean square in 1/8 of 1/255; empty = unknown.",
        0,
        255,
    ),
    Field("escapes", "bin", "Differences that have no symbol, in coding order."),
    Field("data", "bin", "Entropy-coded latents, coarsest level first."),
)

_EARLIER = tuple(f for f in FIELDS if f.key not in ABSENT)
"""Fields before version `TILED_FROM`."""


def fields_of(version: tuple[int, int] = VERSION) -> tuple[Field, ...]:
    """Declared fields of PLAN in a format version, major and minor."""
    return FIELDS if version >= TILED_FROM else _EARLIER

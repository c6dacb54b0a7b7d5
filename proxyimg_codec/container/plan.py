"""PLAN: planes of one raster of the pyramid coder. These are numbered in file order from 0."""

from .fields import Field

TYPE = "PLAN"

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
    Field("escapes", "bin", "Differences that have no symbol, in coding order."),
    Field("data", "bin", "Entropy-coded latents, coarsest level first."),
)

"""mOTN: motion of the nodes of layers over time. Readers that do not know it show the still."""

from .fields import Field

TYPE = "mOTN"

FIELDS = (
    Field("duration", "int", "Length of the timeline in milliseconds.", 1, 3_600_000),
    Field("fps", "int", "Frames a second that it was made for: a hint for export.", 1, 240),
    Field("loop", "int", "1 = the end of the timeline is its beginning.", 0, 1),
    Field("intervals", "int", "Equal intervals that the timeline is cut into.", 1, 1 << 16),
    Field("unit", "int", "Shapes are multiples of 2^-unit canvas pixels.", 0, 6),
    Field("layers", "ints", "Ascending numbers of the layers that move; each has a mesh.",
          0, 1 << 16),
    Field("bodies", "ints", "For each of these layers the number of the body that it moves with.",
          0, 1 << 16),
    Field("modes", "int", "Curves and shapes of each of these layers.", 1, 64),
    Field("curve_classes", "bin", "Classes of the signed integers [modes, layers times "
          "coefficients]: steps of the curves."),
    Field("curve_deltas", "bin", "Raw bits of these integers."),
    Field("shape_classes", "bin", "Classes of the signed integers [2 modes, nodes of these "
          "layers]: residuals of the shapes."),
    Field("shape_deltas", "bin", "Raw bits of these integers."),
    Field("size", "int", "Bytes of the script; 0 = none."),
    Field("script", "bin", "What it was made from, JSON in UTF-8, as one zstd frame."),
)  # fmt: skip

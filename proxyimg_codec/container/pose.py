"""POSE: the pose of one edited layer. These chunks stand after all MESH, in layer order."""

from .fields import Field

TYPE = "POSE"

FIELDS = (
    Field("layer", "int", "The layer, counted from 0.", 0, 1 << 16),
    Field("matrix", "ints", "a, b, c, d of the affine map in 2^-24.",
          1 - (1 << 31), (1 << 31) - 1, items=4),
    Field("shift", "ints", "e, f of the affine map in 1/1024 canvas pixel.",
          1 - (1 << 33), (1 << 33) - 1, items=2),
    Field("opacity", "int", "Opacity in 1/65535.", 0, 65535),
    Field("hidden", "int", "1 = the layer is not drawn.", 0, 1),
    Field("colour", "ints", "Rows of a 3 x 4 colour matrix in 2^-12; empty = none.",
          -(1 << 20), 1 << 20),
    Field("node_classes", "bin",
          "Classes of the signed integers [2, nodes]: displacements; empty = none."),
    Field("node_deltas", "bin", "Raw bits of these integers."),
    Field("place_classes", "bin",
          "Classes of the signed integers [2, nodes]: texture displacements; empty = none."),
    Field("place_deltas", "bin", "Raw bits of these integers."),
)  # fmt: skip

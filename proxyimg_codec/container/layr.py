"""LAYR: name, box and boundary of one layer. These chunks stand back to front, before textures."""

from .fields import Field

TYPE = "LAYR"

FIELDS = (
    Field("name", "str", "Name of the layer, unique in the file, 1..255 characters.", 1, 255),
    Field("box", "ints", "x, y, width, height of the texture's rectangle in canvas pixels.",
          -(1 << 24), 1 << 24, items=4),
    Field("sampling", "int", "How features are found: 0 = direct, 1 = local and global, 2 = local, "
          "3 = global.", 0, 255),
    Field("unit", "int", "Boundary coordinates are multiples of 2^-unit canvas pixels.", 0, 6),
    Field("segments", "ints", "Bézier segments of each closed path; empty = the whole canvas.",
          1, 1 << 24),
    Field("classes", "bin", "Classes of the signed integers [6, S]: deltas of S segments in all."),
    Field("deltas", "bin", "Raw bits of these integers."),
)  # fmt: skip

"""MESH: the mesh of one layer. These chunks stand after all LAYR, in the order of the layers."""

from .fields import Field

TYPE = "MESH"

FIELDS = (
    Field("layer", "int", "The layer, counted from 0.", 0, 1 << 16),
    Field("origin", "ints", "x, y of lattice point 0, 0 in canvas pixels.",
          -(1 << 24), 1 << 24, items=2),
    Field("step", "ints", "Lattice spacing across and down in 1/1024 canvas pixel.",
          1, 1 << 24, items=2),
    Field("vertices", "int", "Vertices of the base.", 3, 1 << 16),
    Field("gates", "int", "Symbols of its connectivity.", 3, 1 << 20),
    Field("symbols", "bin", "Coded array [1, 1, gates] of 4 bits."),
    Field("far", "ints", "Vertices of the symbols 15, in order.", 0, 1 << 16),
    Field("classes", "bin", "Classes of the signed integers [2, vertices]: residuals."),
    Field("deltas", "bin", "Raw bits of these integers."),
    Field("levels", "int", "Number of refinements.", 0, 4),
    Field("splits", "bin",
          "One coded array [1, 1, triangles] of 1 bit a level, each after its u32 length."),
)  # fmt: skip

"""Materials: stiffness, density and air resistance of layers.

Stiffness is stated as a frequency. So a material behaves alike at every size of a layer, at every
resolution of its mesh, and with every time step.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Material:
    """Material of a layer.

    The first three attributes are frequencies in Hz, of the slowest standing wave f = c / 2L in a
    bar as long as the diagonal L of the layer. Here c is the speed of waves that this kind of
    stiffness alone would carry; its modulus is density * (2 L f)**2. With 0 there is no such
    stiffness.

    Attributes:
        stretch: Resistance of edges to a change of length.
        area: Resistance of triangles to a change of area.
        bend: Resistance of two adjacent triangles to a change of the distance of their far corners.
        shape: Frequency in Hz with which a node returns to the best rigid fit of its layer.
        drag: Rate at which still air slows the layer down, in 1/s.
        density: Mass of a square pixel; it only matters if layers meet.
        wind: Acceleration by a wind of strength 1, in diagonals of the layer per second squared.
    """

    stretch: float
    area: float
    bend: float
    shape: float
    drag: float
    density: float
    wind: float


MATERIALS = {
    "cloth": Material(0.8, 2.0, 0.4, 0.9, 1.5, 1.0, 1.0),
    "hair": Material(1.0, 2.0, 0.5, 0.8, 1.2, 1.0, 1.0),
    "jelly": Material(1.2, 4.0, 0.6, 1.3, 0.4, 1.0, 0.5),
    "rigid": Material(6.0, 6.0, 3.0, 8.0, 0.3, 2.0, 0.3),
    "flame": Material(0.9, 1.5, 0.4, 1.0, 2.0, 0.2, 2.0),
    "water": Material(0.6, 4.0, 0.3, 0.8, 0.8, 1.0, 1.0),
}
"""Materials that a motion can use by name."""

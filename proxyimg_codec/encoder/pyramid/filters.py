"""Analysis filters of the CDF 9/7 wavelet."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...texture.grid import BANDS

# Cohen, Daubechies, Feauveau 1992; Antonini et al. 1992, table II, orthonormal scaling: halves of
# the analysis filters.
_LOW = (0.852698679009, 0.377402855613, -0.110624404418, -0.023849465020, 0.037828455507)
_HIGH = (0.788485616406, -0.418092273222, -0.040689417609, 0.064538882629)


def analysis_wavelet() -> NDArray[np.float64]:
    """Analysis weights as a convolution over 2 x 2 cells, float64 [12, 12, 5, 5].

    Outputs are 3 planes and 9 bands 3 * colour + band; inputs are the 4 samples of a cell of each
    colour.
    """
    axis = np.zeros((2, 2, 5))  # [band, phase, tap]
    for phase in range(2):
        for tap in range(5):
            n = phase + 2 * (tap - 2)
            axis[0, phase, tap] = _LOW[abs(n)] if abs(n) < 5 else 0
            axis[1, phase, tap] = _HIGH[abs(n - 1)] if abs(n - 1) < 4 else 0
    out = np.zeros((12, 12, 5, 5))
    for colour in range(3):
        planes = [(colour, (0, 0))] + [(3 + 3 * colour + k, way) for k, way in enumerate(BANDS)]
        for plane, (v, h) in planes:
            for y in range(2):
                for x in range(2):
                    out[plane, 4 * colour + 2 * y + x] = np.outer(axis[v, y], axis[h, x])
    return out

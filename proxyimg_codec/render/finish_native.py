"""Clamping of colours and rounding to output samples in the compiled kernel (`native/finish.h`).

`compose.premultiplied` and `pixels` are the reference.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..native import kernel
from ..texture.network import Floats


def premultiplied(output: Floats) -> Floats:
    """Clamps outputs of a texture, as `compose.premultiplied` does.

    Args:
        output: float32 [N, 3] colour, or [N, 4] premultiplied colour and alpha; a NaN counts as 0.

    Returns:
        float32 [N, 4].
    """
    lib = kernel.library()
    assert lib is not None, "check available() first"
    output = np.ascontiguousarray(output, np.float32)
    out = np.empty((len(output), 4), np.float32)
    lib.pxi_premultiplied(kernel.pointer(output), output.shape[1], len(output), kernel.pointer(out))
    return out


def finished(tile: Floats, solid: bool, dtype: np.dtype[Any]) -> NDArray[Any]:
    """Converts premultiplied colours to output samples.

    Args:
        tile: float32 [h, w, 4] premultiplied colour and alpha, or [h, w, 3] opaque colour.
        solid: Whether the output is opaque; then it has 3 components, else 4.
        dtype: uint8 or uint16.

    Returns:
        [h, w, 3], or [h, w, 4] with straight alpha.
    """
    lib = kernel.library()
    assert lib is not None, "check available() first"
    tile = np.ascontiguousarray(tile, np.float32)
    h, w, channels = tile.shape
    out = np.empty((h, w, 3 if solid else 4), dtype)
    lib.pxi_finished(
        kernel.pointer(tile), channels, h * w, out.shape[2], 8 * out.itemsize, kernel.pointer(out)
    )
    return out

"""Textures of soft layers that change hands: lent ones are opaque, new ones of soft layers soft."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..errors import PxiError
from ..model import Layer
from ..texture.pyramid import PyramidTexture, Texture


def without_matte(view: PyramidTexture) -> PyramidTexture:
    """Opaque view of a soft one without cuts: its soft samples are those behind it."""
    if view.matte is None:
        return view
    assert view.behind is not None, "a matte comes with it"
    soft, cell = view.matte.support, view.matte.packed["cell"]
    if soft.all():
        size = view.part[2:]
        alpha = view.behind_alpha if view.alpha else None
        return PyramidTexture(view.behind, alpha, (0, 0, *size))
    if view.mask is None:
        return replace(view, matte=None, cell=cell, mask=~soft)
    fine = min(view.cell, cell)
    rows, columns = (-(-side >> fine) for side in reversed(view.part[2:]))
    mask, apart = (
        v.repeat(1 << (own - fine), 0)[:rows].repeat(1 << (own - fine), 1)[:, :columns]
        for v, own in ((view.mask, view.cell), (~soft, cell))
    )
    return replace(view, matte=None, cell=fine, mask=mask & apart if (mask & apart).any() else mask)


def with_matte(shown: Texture, target: Layer, effort: int) -> Texture:
    """Texture that is as soft as that which a layer had, if it is a whole raster without alpha.

    Args:
        shown: The new texture, which is stretched over the box of the layer.
        target: The layer as it was.
        effort: How hard the encoder tries, 1..9.

    Raises:
        PxiError: The encoder is not installed.
    """
    old = target.texture
    if not isinstance(old, PyramidTexture) or old.matte is None:
        return shown
    if not isinstance(shown, PyramidTexture) or shown.part != (0, 0, *shown.planes.size):
        return shown
    if shown.alpha is not None or shown.mask is not None or shown.cuts is not None:
        return shown
    try:
        import cv2

        from ..encoder.pyramid.encode import EFFORTS, encode
        from ..encoder.pyramid.picture import alpha_of
    except ModuleNotFoundError as error:
        raise PxiError(
            f"textures of soft layers need {error.name}: pip install 'proxyimg-codec[encode]'"
        ) from None
    alpha = np.where(old.soft, old.matte.raster[..., 0], np.float32(1))
    size = shown.planes.size
    shrunk = size[0] < alpha.shape[1]
    how = cv2.INTER_AREA if shrunk else cv2.INTER_LINEAR
    raster = alpha_of(np.asarray(cv2.resize(alpha, size, interpolation=how), np.float32))
    step = old.matte.packed["step"]
    matte, _ = encode(raster, step, EFFORTS[effort - 1], 0, lambda samples: None)
    return replace(shown, matte=matte, behind=shown.planes)

"""Pixels of the back layer where others hide it: given by the user, or made by an inpainter."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError, UsageError
from ...io.samples import to_float
from ...texture.network import Floats
from ...texture.occlusion import Occlusion, Samples
from ..settings import Settings
from ..shapes.external_models.inpainting import find_inpainter
from ..shapes.masks import check_size
from .hidden import hidden_in

Inpainter = Callable[[Floats, Samples], Floats]
"""Function of a picture float32 [H, W, 3] in 0..1 and its hole, bool [H, W]: the picture filled."""

Source = Floats | Inpainter
"""What gives the pixels: a picture float32 [H, W, 3] in 0..1, or a function that makes it."""

_log = logging.getLogger(__name__)


def source_of(
    behind: NDArray[Any] | None, settings: Settings, width: int, height: int
) -> Source | None:
    """Finds what gives the hidden pixels of the back layer, before anything is encoded.

    Args:
        behind: Picture of the user as `encode` takes it; None if there is none.
        settings: Settings of the encoder.
        width: Width of the picture in pixels.
        height: Height of the picture in pixels.

    Returns:
        The source; None if hidden parts are completed in another way.

    Raises:
        InputError: `behind` is no picture, has another size, or is not opaque; or the model of
            `settings.background` is not here.
        UsageError: `behind` contradicts the settings, or there is no such background.
    """
    if behind is None:
        name = settings.inpainter
        return None if name is None else find_inpainter(name, settings.jobs)
    if settings.background != "auto":
        raise UsageError(f"behind and background {settings.background} contradict each other")
    if not settings.pyramid:
        raise UsageError("behind needs texture pyramid")
    try:
        picture = to_float(np.asarray(behind))[0]
    except InputError as error:
        raise InputError(f"behind: {error}") from None
    check_size("behind", picture, width, height)
    if picture[..., 3].min() < 1:
        raise InputError("behind: it is not opaque everywhere; fill what is clear, or drop alpha")
    return np.ascontiguousarray(picture[..., :3])


def pixels_behind(
    colours: Floats, cuts: Occlusion | None, source: Source
) -> tuple[Floats, Samples] | None:
    """Gets the hidden pixels of a view.

    Args:
        colours: float32 [H, W, 3] in 0..1, the picture.
        cuts: Cuts of the view; None if nothing cuts it.
        source: What gives them.

    Returns:
        float32 [h, w, 3] samples in 0..1 of the box of the view, and bool [h, w], True where they
        count; None if nothing is hidden, which is said in a warning.

    Raises:
        InputError: A model or plug-in cannot be used, or gives no picture.
    """
    hidden = None if cuts is None else hidden_in(cuts)[1]
    if cuts is None or hidden is None or not hidden.any():
        _log.warning("nothing hides a part of the back layer; what lies behind is not stored")
        return None
    x, y, width, height = cuts.box
    part = np.s_[y : y + height, x : x + width]
    if not callable(source):
        return source[part], hidden
    return source(np.ascontiguousarray(colours[part]), hidden), hidden

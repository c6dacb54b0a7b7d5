"""Operation that says how the hidden parts of a layer are filled.

Files whose hidden parts are filled smoothly, and layers from which others were cut out, get what
`--background auto` gives, or the other way round. Planes stay as they are: references are stored,
or what is behind is no longer named.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from ..errors import PxiError, UsageError
from ..model import Layer, Picture
from ..texture.pyramid import PyramidTexture
from .operations import layer_named, operation, substituted
from .structure import ONE


@operation("complete", layer=ONE, method="completion?: exemplar, the default, or smooth")
def complete(picture: Picture, layer: str | int, method: str = "exemplar") -> Picture:
    """Lets the hidden parts of a layer copy places of it that suit, or fills them smoothly.

    It copies where that is no worse than filling.

    Raises:
        UsageError: The layer has an implicit texture, or nothing of it is hidden.
        PxiError: The encoder, which chooses what is copied, is not installed.
    """
    chosen = layer_named(picture, layer)
    texture, said = chosen.texture, f"complete: layer {chosen.name!r}"
    if not isinstance(texture, PyramidTexture):
        raise UsageError(f"{said} has an implicit texture, which is continued smoothly by itself")
    if texture.shown is None or (texture.cuts and not texture.cuts.fronts):
        raise UsageError(f"{said} hides nothing: all of it shows")
    if method == "smooth":
        stored: dict[str, Any] = {} if texture.matte else {"behind": None, "behind_alpha": None}
        return _with(picture, chosen, replace(texture, copies=None, **stored))
    try:
        from ..encoder.completion.hidden import copies_of_texture
    except ModuleNotFoundError as error:
        raise PxiError(
            f"complete needs {error.name}: pip install 'proxyimg-codec[encode]'"
        ) from None
    return _with(picture, chosen, replace(texture, copies=copies_of_texture(texture)))


def _with(picture: Picture, layer: Layer, texture: PyramidTexture) -> Picture:
    return substituted(picture, [replace(layer, texture=texture)])

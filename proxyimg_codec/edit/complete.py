"""Operation that continues what is around the hidden parts of a layer, as the encoder does.

Files whose hidden parts are filled smoothly, and layers from which others were cut out, get what
`--background auto` gives. Planes stay as they are: only references are stored.
"""

from __future__ import annotations

from dataclasses import replace

from ..errors import PxiError, UsageError
from ..model import Picture
from ..texture.pyramid import PyramidTexture
from .operations import changed, layer_named, operation
from .structure import ONE


@operation("complete", layer=ONE)
def complete(picture: Picture, layer: str | int) -> Picture:
    """Lets the hidden parts of a layer copy places of it that suit, where that is no worse.

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
    try:
        from ..encoder.completion.hidden import copies_of_texture
    except ModuleNotFoundError as error:
        raise PxiError(
            f"complete needs {error.name}: pip install 'proxyimg-codec[encode]'"
        ) from None
    done = replace(chosen, texture=replace(texture, copies=copies_of_texture(texture)))
    return changed(picture, [done if v is chosen else v for v in picture.layers])

"""ProxyImg codec: layered, resolution-free pictures in the `.pxi` format.

    import proxyimg_codec as pxi

    image = pxi.open("photo.pxi")
    pixels = image.render(width=1024)

Names are imported when they are first used: opening and rendering need numpy, encoding needs the
``encode`` extra.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from ._version import __version__ as __version__
from .errors import (
    FormatError,
    InputError,
    LimitError,
    PxiError,
    UnsupportedError,
    UsageError,
)
from .limits import Limits

if TYPE_CHECKING:
    from .api import Image as Image
    from .api import Layer as Layer
    from .api import encode as encode
    from .api import from_bytes as from_bytes
    from .api import open_image as open
    from .encoder.settings import Settings as Settings
    from .encoder.shapes.find import find_layers as find_layers
    from .encoder.shapes.masks import Region as Region

_LAZY = {
    "Image": ("api", "Image"),
    "Layer": ("api", "Layer"),
    "open": ("api", "open_image"),
    "from_bytes": ("api", "from_bytes"),
    "encode": ("api", "encode"),
    "find_layers": ("encoder.shapes.find", "find_layers"),
    "Region": ("encoder.shapes.masks", "Region"),
    "Settings": ("encoder.settings", "Settings"),
}

__all__ = [
    "FormatError",
    "Image",
    "InputError",
    "Layer",
    "LimitError",
    "Limits",
    "PxiError",
    "Region",
    "Settings",
    "UnsupportedError",
    "UsageError",
    "encode",
    "find_layers",
    "from_bytes",
    "open",
]


def __getattr__(name: str) -> Any:
    if name not in _LAZY:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module, attribute = _LAZY[name]
    try:
        return getattr(importlib.import_module(f".{module}", __name__), attribute)
    except ModuleNotFoundError as error:
        raise UnsupportedError(
            f"{name} needs {error.name}: pip install 'proxyimg-codec[encode]'"
        ) from None

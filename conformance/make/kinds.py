"""All cases by kind; each module of ``valid`` and of ``refused`` makes one kind."""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from typing import Any

from .refused.base import Refused
from .registry import Valid


def _cases(module: str) -> Any:
    """Cases of a module of this package."""
    return importlib.import_module(f".{module}", __package__).CASES


VALID: Mapping[str, Mapping[str, Valid]] = {
    name: _cases(f"valid.{name}")
    for name in (
        "layers", "textures", "networks", "canvases", "levels", "versions", "metadata", "meshes",
        "poses", "samplings", "pyramids", "views", "behind", "mattes", "motion",
    )
}  # fmt: skip
"""Valid cases by kind and name."""

REFUSED: Mapping[str, Mapping[str, Refused]] = {
    f"refused-{name}": _cases(f"refused.{name}")
    for name in (
        "framing", "structure", "values", "arrays", "bombs", "poses", "pyramids", "views",
        "behind", "mattes", "motion", "metadata",
    )
}  # fmt: skip
"""Cases of files that must be refused, by kind and name."""

KIND_OF: Mapping[str, str] = {
    name: kind for kind, cases in (*VALID.items(), *REFUSED.items()) for name in cases
}
"""Kind of each case, which is the name of the folder that contains it."""

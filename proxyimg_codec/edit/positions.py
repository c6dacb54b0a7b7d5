"""Positions of layers in a row of edits: those of the picture that the row began with."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Self

from ..errors import UsageError
from ..model import Picture


@dataclass(frozen=True)
class Positions:
    """Names that the layers of a first picture have by now, by their positions in it.

    Attributes:
        first: Names in the first picture, back to front.
        now: Present names; None for layers that are gone.
    """

    first: tuple[str, ...]
    now: tuple[str | None, ...]

    @classmethod
    def of(cls, picture: Picture) -> Self:
        """Positions in a picture."""
        names = tuple(layer.name for layer in picture.layers)
        return cls(names, names)

    def name(self, address: str | int) -> str:
        """Present name of a layer, given by a name, which is taken as it is, or by its position.

        Raises:
            UsageError: There was no such position, or the layer is gone.
        """
        if isinstance(address, str):
            return address
        if not -len(self.first) <= address < len(self.first):
            raise UsageError(
                f"there is no layer {address}; the picture has {', '.join(map(repr, self.first))}"
            )
        name = self.now[address]
        if name is None:
            raise UsageError(
                f"layer {address}, which was {self.first[address]!r}, is gone; positions are those "
                "before the first edit"
            )
        return name

    def after(self, edit: Mapping[str, Any], picture: Picture) -> Self:
        """Positions after an edit.

        Args:
            edit: The edit, with names for positions.
            picture: The picture after it.
        """
        there = {layer.name for layer in picture.layers}
        old, new = (edit["layer"], edit["name"]) if edit["op"] == "rename" else (None, None)
        names = (new if name == old else name for name in self.now)
        return replace(self, now=tuple(name if name in there else None for name in names))

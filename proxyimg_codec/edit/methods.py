"""Edits of a layer as methods; each names an operation (`operations`) that is then applied."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Generic, TypeVar

Pair = tuple[float, float]
Edited = TypeVar("Edited")


class Editable(Generic[Edited]):
    """Methods of a layer that return a new image, in which the layer is changed.

    Lengths are in canvas pixels, angles in degrees clockwise, pivots canvas points (the centre of
    the layer by default). All raise `UsageError` for what cannot be done. Layers that have this
    one as parent follow its geometry.
    """

    def _edited(self, op: str, **values: Any) -> Edited:
        """The picture after operation `op` on this layer; values that are None are left out."""
        raise NotImplementedError  # each kind of handle knows its picture

    def moved(self, dx: float, dy: float) -> Edited:
        """Moved by `dx`, `dy`; there and back is exact."""
        return self._edited("move", by=[dx, dy])

    def rotated(self, degrees: float, pivot: Pair | None = None) -> Edited:
        """Turned clockwise."""
        return self._edited("rotate", degrees=degrees, pivot=pivot)

    def scaled(self, x: float, y: float | None = None, pivot: Pair | None = None) -> Edited:
        """Enlarged `x` times across and `y` times (as across by default) down."""
        return self._edited("scale", by=[x, x if y is None else y], pivot=pivot)

    def sheared(self, x: float, y: float = 0, pivot: Pair | None = None) -> Edited:
        """Slanted: x grows by `x` a pixel of y, y by `y` a pixel of x."""
        return self._edited("shear", by=[x, y], pivot=pivot)

    def transformed(self, matrix: Sequence[float], pivot: Pair | None = None) -> Edited:
        """Mapped by a, b, c, d, e, f: x' = a x + c y + e, y' = b x + d y + f, about the pivot."""
        return self._edited("affine", matrix=list(matrix), pivot=pivot)

    def flipped(self, axis: str = "horizontal", pivot: Pair | None = None) -> Edited:
        """Mirrored: ``horizontal`` exchanges left and right, ``vertical`` top and bottom."""
        return self._edited("flip", axis=axis, pivot=pivot)

    def dragged(self, handles: Mapping[Pair, Pair]) -> Edited:
        """Bent so that each point moves by its vector, as rigidly as possible elsewhere.

        Args:
            handles: Vectors dx, dy by canvas points x, y on the layer; (0, 0) pins a point.
        """
        return self._edited("drag", handles=[[*p, *v] for p, v in handles.items()])

    def with_point(self, path: int, point: int, dx: float, dy: float) -> Edited:
        """One control point of the boundary moved; texture appears or disappears there."""
        return self._edited("point", path=path, point=point, by=[dx, dy])

    def removed(self) -> Edited:
        """Taken away: what it hid shows."""
        return self._edited("remove")

    def duplicated(self, name: str | None = None) -> Edited:
        """With a copy in front of it, which shares its texture."""
        return self._edited("duplicate", name=name)

    def renamed(self, name: str) -> Edited:
        """Under another name."""
        return self._edited("rename", name=name)

    def reordered(self, to: int | str) -> Edited:
        """At position `to` from the back, or ``front``, ``back``, ``forward``, ``backward``."""
        return self._edited("order", to=to)

    def hidden(self) -> Edited:
        """Not drawn."""
        return self._edited("hide")

    def shown(self) -> Edited:
        """Drawn again."""
        return self._edited("show")

    def stilled(self) -> Edited:
        """Without its motion."""
        return self._edited("still")

    def with_opacity(self, value: float) -> Edited:
        """With opacity `value` in 0..1."""
        return self._edited("opacity", value=value)

    def recoloured(
        self,
        *,
        hue: float | None = None,
        saturation: float | None = None,
        brightness: float | None = None,
        tint: str | None = None,
        matrix: Sequence[float] | None = None,
    ) -> Edited:
        """With other colours, on top of earlier changes of colour.

        Args:
            hue: Degrees to turn the hue by.
            saturation: Factor; 0 is grey.
            brightness: Factor.
            tint: ``#rrggbb``; shades of this colour.
            matrix: Rows of a 3 x 4 matrix applied to red, green, blue and one.
        """
        values = {"hue": hue, "saturation": saturation, "brightness": brightness, "tint": tint}
        return self._edited("recolour", **values, matrix=None if matrix is None else list(matrix))

    def textured(self, source: str, layer: str | int | None = None, fit: str = "box") -> Edited:
        """With the texture of something else; its shape stays.

        Args:
            source: A layer of this picture; or a `.pxi` file or a picture file, by its name.
            layer: A layer of that `.pxi` file, by name or position; its front one by default.
            fit: ``box`` stretches box to box; ``shape`` maps outline to outline.
        """
        return self._edited("texture", source=source, from_layer=layer, fit=fit)

    def with_parent(self, name: str | None) -> Edited:
        """Following a layer or group, or none."""
        return self._edited("parent", to=name or "")

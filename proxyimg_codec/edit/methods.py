"""Edits as methods of pictures and of layers; those of layers are operations of `operations`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Generic, Self, TypeVar

if TYPE_CHECKING:
    from ..generate.run import Run
    from ..model import Picture

Pair = tuple[float, float]
Edited = TypeVar("Edited")


class EditableImage:
    """Methods of a picture that return another one, after edits or before them."""

    __slots__ = ()

    @property
    def picture(self) -> Picture:
        """The picture as data."""
        raise NotImplementedError  # only subclasses have one

    def _with(self, picture: Picture) -> Self:
        """Returns an image of another picture."""
        raise NotImplementedError  # only subclasses can make one

    def edited(self, *operations: Mapping[str, Any]) -> Self:
        """Returns the picture after `operations`, applied in order; each can be undone.

        Args:
            operations: Operations as in an edit script, such as
                ``{"op": "move", "layer": "cat", "by": [40, -10]}``.

        Raises:
            UsageError: An operation is unknown, or cannot be applied.

        Examples:
            >>> import proxyimg_codec as pxi
            >>> image = pxi.open("photo.pxi")
            >>> moved = image.edited({"op": "move", "layer": "disc", "by": [6, -2]})
            >>> len(moved.history)
            1
        """
        if not operations:
            return self
        from .script import apply

        return self._with(apply(self.picture, operations))

    def inserted(
        self,
        source: str,
        layer: str | int | None = None,
        *,
        at: Pair | None = None,
        over: str | int | None = None,
        under: str | int | None = None,
        name: str | None = None,
        effort: int | None = None,
    ) -> Self:
        """Inserts a layer of another `.pxi` file, which is not encoded anew, or a picture file.

        Args:
            source: Name of the file.
            layer: Name or position of a layer of a `.pxi` file; its front layer by default.
            at: Canvas point for its centre; by default that in its own file if both pictures have
                the same size, otherwise the middle of the canvas.
            over: Name or position of the layer that it lies just in front of.
            under: Name or position of the layer that it lies just behind.
            name: Name of the new layer.
            effort: How hard the encoder tries with a picture file, 1..9; by default 2.
        """
        given = {"source": source, "from_layer": layer, "at": at, "over": over, "under": under,
                 "name": name, "effort": effort}  # fmt: skip
        return self.edited({"op": "insert", **{k: v for k, v in given.items() if v is not None}})

    def undone(self, steps: int = 1) -> Self:
        """Returns the picture as it was before its last `steps` edits.

        Raises:
            UsageError: The history has fewer edits than that.

        Examples:
            >>> import proxyimg_codec as pxi
            >>> image = pxi.open("photo.pxi")
            >>> image.layers["disc"].hidden().undone() == image
            True
        """
        from .history import undone

        return self._with(undone(self.picture, steps))

    def baked(self) -> Self:
        """Returns the same picture without its history.

        Pixels of a removed layer stay in the file if other layers show parts of the same planes;
        `purged` takes them out.
        """
        return self._with(replace(self.picture, history=()))

    def purged(self, effort: int = 2) -> Self:
        """Returns the picture without its history, and without pixels that no layer can show.

        What shows beside such pixels changes a little, see `edit.purge.purged`.

        Args:
            effort: How hard the encoder tries, 1..9.

        Raises:
            UsageError: The effort is out of range.
            PxiError: The encoder, which this needs, is not installed.
        """
        from .purge import purged

        return self._with(purged(self.picture, effort))


class Editable(Generic[Edited]):
    """Methods of a layer that return a new image in which the layer is changed.

    Lengths are in canvas pixels, angles in degrees clockwise. Pivots are canvas points; the default
    is the centre of the layer. All methods raise `UsageError` if the edit cannot be done. Layers
    that have this one as parent follow its geometry.
    """

    __slots__ = ()

    def _edited(self, op: str, **values: Any) -> Edited:
        """Image after operation `op` on this layer; values that are None are left out."""
        raise NotImplementedError  # only subclasses know the picture of the layer

    def moved(self, dx: float, dy: float) -> Edited:
        """Moves the layer by `dx`, `dy`; moving there and back is exact.

        Examples:
            >>> import proxyimg_codec as pxi
            >>> image = pxi.open("photo.pxi")
            >>> moved = image.layers["disc"].moved(6, -2)
            >>> moved.layers["disc"].moved(-6, 2).render().tobytes() == image.render().tobytes()
            True
        """
        return self._edited("move", by=[dx, dy])

    def rotated(self, degrees: float, pivot: Pair | None = None) -> Edited:
        """Turns the layer clockwise."""
        return self._edited("rotate", degrees=degrees, pivot=pivot)

    def scaled(self, x: float, y: float | None = None, pivot: Pair | None = None) -> Edited:
        """Enlarges the layer `x` times across and `y` times down; by default `y` is `x`."""
        return self._edited("scale", by=[x, x if y is None else y], pivot=pivot)

    def sheared(self, x: float, y: float = 0, pivot: Pair | None = None) -> Edited:
        """Slants the layer: x grows by `x` per pixel of y, and y by `y` per pixel of x."""
        return self._edited("shear", by=[x, y], pivot=pivot)

    def transformed(self, matrix: Sequence[float], pivot: Pair | None = None) -> Edited:
        """Applies the affine map x' = a x + c y + e, y' = b x + d y + f about the pivot.

        Args:
            matrix: a, b, c, d, e, f, as in SVG.
            pivot: Origin of the map.
        """
        return self._edited("affine", matrix=list(matrix), pivot=pivot)

    def flipped(self, axis: str = "horizontal", pivot: Pair | None = None) -> Edited:
        """Mirrors the layer: ``horizontal`` swaps left and right, ``vertical`` top and bottom."""
        return self._edited("flip", axis=axis, pivot=pivot)

    def dragged(self, handles: Mapping[Pair, Pair]) -> Edited:
        """Bends the layer so that each point moves by its vector, as rigidly as possible elsewhere.

        One point alone moves the whole layer. For a point outside the layer the nearest one inside
        is taken, which is logged as a warning.

        Args:
            handles: Vectors dx, dy by canvas points x, y on the layer; (0, 0) pins a point.

        Examples:
            >>> import proxyimg_codec as pxi
            >>> image = pxi.open("photo.pxi")
            >>> bent = image.layers["disc"].dragged({(32, 12): (5, -2), (32, 36): (0, 0)})
            >>> bent.layers["disc"].pose.bent
            True
        """
        return self._edited("drag", handles=[[*p, *v] for p, v in handles.items()])

    def with_point(
        self, path: int, point: int, dx: float, dy: float, *, follow: bool = False
    ) -> Edited:
        """Moves one control point of the boundary; texture appears or disappears there.

        Args:
            path: Number of the path, from 0.
            point: Number of the control point in the path, from 0.
            dx: Distance to the right.
            dy: Distance down.
            follow: Whether the proxy nodes, and so the texture, go along instead; the rest of the
                outline stays.
        """
        by = [dx, dy]
        return self._edited("point", path=path, point=point, by=by, follow=follow or None)

    def removed(self) -> Edited:
        """Removes the layer, so that what it hid shows.

        Its pixels stay in the file until the picture is purged; see `EditableImage.purged`.
        """
        return self._edited("remove")

    def cut(
        self,
        mask: str | None = None,
        *,
        points: Sequence[Pair] | None = None,
        outside: Sequence[Pair] | None = None,
        name: str | None = None,
    ) -> Edited:
        """Makes a new layer, just in front, out of a part of the layer; nothing is encoded anew.

        Args:
            mask: Name of a file with a mask of the canvas.
            points: Instead of a mask, canvas points inside of what is to be found.
            outside: Canvas points outside of it.
            name: Name of the new layer; by default that of the mask file.
        """
        given = {"mask": mask, "points": points, "outside": outside, "name": name}
        return self._edited("cut", **given)

    def merged(self, other: str | int) -> Edited:
        """Makes one layer of this one and another that shows the same planes; nothing is encoded.

        Args:
            other: Name or position of the other layer.
        """
        return self._edited("merge", other=other)

    def completed(self, method: str | None = None) -> Edited:
        """Lets the hidden parts of the layer copy places of it that suit; nothing is encoded.

        Args:
            method: ``exemplar``, the default, or ``smooth``: they are filled smoothly instead.
        """
        return self._edited("complete", method=method)

    def duplicated(self, name: str | None = None) -> Edited:
        """Puts a copy in front of the layer, which shares its texture."""
        return self._edited("duplicate", name=name)

    def renamed(self, name: str) -> Edited:
        """Gives the layer another name."""
        return self._edited("rename", name=name)

    def reordered(self, to: int | str) -> Edited:
        """Moves the layer to position `to` from the back.

        Args:
            to: Position from the back, or ``front``, ``back``, ``forward``, ``backward``.
        """
        return self._edited("order", to=to)

    def hidden(self) -> Edited:
        """Hides the layer, which is then not drawn."""
        return self._edited("hide")

    def shown(self) -> Edited:
        """Shows a hidden layer again."""
        return self._edited("show")

    def stilled(self) -> Edited:
        """Removes the motion of the layer."""
        return self._edited("still")

    def with_opacity(self, value: float) -> Edited:
        """Sets the opacity of the layer to `value` in 0..1."""
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
        """Changes the colours of the layer, on top of earlier changes of colour.

        Args:
            hue: Rotation of the hue in degrees.
            saturation: Factor of the saturation; 0 gives grey.
            brightness: Factor of red, green and blue.
            tint: ``#rrggbb``; colours become shades of it.
            matrix: The 12 entries of a 3 x 4 matrix, row by row, applied to (red, green, blue, 1)
                in 0..1.

        Examples:
            >>> import proxyimg_codec as pxi
            >>> image = pxi.open("photo.pxi")
            >>> grey = image.layers["disc"].recoloured(saturation=0).render()
            >>> red, green, blue = grey[24, 32].tolist()
            >>> max(red, green, blue) - min(red, green, blue) <= 1
            True
        """
        values = {"hue": hue, "saturation": saturation, "brightness": brightness, "tint": tint}
        return self._edited("recolour", **values, matrix=None if matrix is None else list(matrix))

    def textured(
        self,
        source: str | int,
        layer: str | int | None = None,
        fit: str = "box",
        effort: int | None = None,
    ) -> Edited:
        """Gives the layer another texture; its shape stays.

        Args:
            source: Name or position of a layer of this picture, or name of a `.pxi` file or
                picture file.
            layer: Name or position of a layer of that `.pxi` file; its front layer by default.
            fit: ``box`` stretches the texture from box to box; ``shape`` maps outline to outline.
            effort: How hard the encoder tries with a picture file, 1..9; by default 2.
        """
        return self._edited("texture", source=source, from_layer=layer, fit=fit, effort=effort)

    def generated(
        self,
        prompt: str,
        *,
        guide: str,
        negative: str | None = None,
        guidance: float | None = None,
        steps: int | None = None,
        seed: int | None = None,
        resolution: int | None = None,
        times: Pair | None = None,
        weighting: str | None = None,
        clip: float | None = None,
        precision: str | None = None,
        keep_structure: float | None = None,
        effort: int | None = None,
        run: Run | None = None,
    ) -> Edited:
        """Gives the layer a new texture, made from words or after a picture; its shape stays.

        What is None is as in `generate.settings.Settings`, which says what each parameter means.

        Args:
            prompt: What the texture shows; may be empty if the guide is a picture.
            guide: Folder or file of a model, a picture file, or the name of a plug-in.
            negative: What the texture does not show.
            guidance: How many times the difference that the prompt makes counts.
            steps: Steps of the optimizer.
            seed: Seed of all random numbers.
            resolution: Rows and columns of what the guide sees.
            times: Least and greatest share of the timesteps, within 0..1.
            weighting: ``sds`` or ``uniform``.
            clip: Greatest root mean square of the gradient of a picture.
            precision: ``full``, ``half`` or ``bfloat``.
            keep_structure: How strongly edges of the old texture stay.
            effort: How hard the result is encoded, 1..9.
            run: Where it is computed, and who watches; by default on the CPU, unwatched.
        """
        from ..generate.run import present, running

        values = {"negative": negative, "guidance": guidance, "steps": steps, "seed": seed,
                  "resolution": resolution, "times": None if times is None else list(times),
                  "weighting": weighting, "clip": clip, "precision": precision,
                  "keep_structure": keep_structure, "effort": effort}  # fmt: skip
        with running(run or present()):
            return self._edited("generate", prompt=prompt, guide=guide, **values)

    def with_parent(self, parent: str | int | None) -> Edited:
        """Lets the layer follow another layer, by name or position, or a group; None for none."""
        return self._edited("parent", to="" if parent is None else parent)

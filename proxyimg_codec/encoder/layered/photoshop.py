"""Reader of Photoshop files (.psd, .psb) with layers, through psd-tools.

Layers are drawn by psd-tools, each alone, with masks and with those effects that it knows. It also
draws what blends together with what lies behind.
"""

from __future__ import annotations

import io
import struct
import warnings
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from importlib import import_module
from typing import Any

import numpy as np

from ...errors import InputError, PxiError, UnsupportedError
from ...io import metadata
from ...io.color import Colour, adopt
from ...io.raster import Picture
from ...io.samples import rounded
from ...limits import DEFAULT_LIMITS, Limits
from .nodes import Node, Patch, layered_picture
from .source import Colours, LayeredPicture, check_limit, printable

DRAWN_EFFECTS = ("Stroke", "ColorOverlay", "GradientOverlay", "PatternOverlay")
"""Effects that psd-tools draws."""

DIFFERENT = 0.03
"""Root of the mean squared difference from the flat picture, of 1 for white, that is told."""

COLOURS = {"RGB": 3, "GRAYSCALE": 1}
"""Colour modes that can be imported, and their channels."""

Box = tuple[int, int, int, int]
"""Left, top, right and bottom in pixels of the canvas."""

_HEADER = struct.Struct(">4sH6xHIIHH")
_RESOURCES = {"icc": "ICC_PROFILE", "exif": "EXIF_DATA_1", "xmp": "XMP_METADATA"}
_FULL = 255
"""Opacity of what is opaque."""


def is_photoshop(data: bytes) -> bool:
    """Whether a file begins as Photoshop's do."""
    return data[:4] == b"8BPS"


def has_reader() -> bool:
    """Whether psd-tools is installed."""
    try:
        import_module("psd_tools")
    except ImportError:
        return False
    return True


def read_photoshop(
    data: bytes, name: str, limits: Limits = DEFAULT_LIMITS, blend: str = "flatten"
) -> LayeredPicture | None:
    """Reads a Photoshop file.

    Masks, and the alpha of a layer that others are clipped to, become alpha of the layers. The
    opacity of groups goes to their layers, as with OpenRaster. Adjustment layers and layers with a
    blending mode are flattened with what lies behind them; adjustments that psd-tools does not
    know, and effects, are left out and named.

    Args:
        data: Bytes of the file.
        name: Name of the file in error messages.
        limits: Bounds on the canvas, the number of layers and their pixels.
        blend: ``flatten``, or ``refuse`` to refuse adjustment layers and blending modes.

    Returns:
        The picture; None if the file has less than two layers, so that it is a flat picture.

    Raises:
        InputError: The file is damaged, or no layer has a visible pixel.
        UnsupportedError: psd-tools is not installed or lacks a package, the file has other colours
            than RGB or grey of 8 or 16 bits, or layers that blend may not be flattened.
        LimitError: The file exceeds `limits`.
    """
    if not has_reader():
        raise UnsupportedError(
            f"{name}: reading its layers needs psd-tools: pip install 'proxyimg-codec[psd]'"
        )
    with _foreign(name):
        document = _opened(data, name, limits)
        layers = [layer for layer in document.descendants() if not layer.is_group()]
    if len(layers) < 2:
        return None
    reader = _Reader(document, name, limits, blend)
    with _foreign(name):
        nodes = reader.nodes(document, ())
        blocks = {
            block: found
            for block, kind in _RESOURCES.items()
            if isinstance(found := reader.resource(kind), bytes) and found
        }
    picture = layered_picture(nodes, document.size, blend, reader.merge, limits, name)
    colours = dict(reader.colours.blocks or {})
    told = metadata.upright({k: v for k, v in blocks.items() if k != "icc"})
    with _foreign(name):
        difference = reader.difference()
    if difference > DIFFERENT:
        reader.notes.append(
            "its layers look different from the flat picture in it: not all of them can be drawn; "
            "--frame 0 takes the flat picture"
        )
    notes = (*picture.notes, *dict.fromkeys(reader.notes))
    return replace(picture, blocks={**told, **colours}, notes=notes)


@contextmanager
def _foreign(where: str) -> Iterator[None]:
    """Context in which psd-tools works: its errors become ours."""
    try:
        with warnings.catch_warnings():
            # It replaces what it cannot decode by black, and says so by a warning.
            warnings.simplefilter("ignore")
            warnings.simplefilter("error", import_module("psd_tools").PSDDecompressionWarning)
            yield
    except (PxiError, MemoryError):
        raise
    except ImportError:
        raise UnsupportedError(
            f"{where}: psd-tools lacks a package to draw this: pip install 'psd-tools[composite]', "
            "or rasterize the layer"
        ) from None
    except Exception as error:  # psd-tools raises errors of any class for damaged files
        problem = str(error).split("\n")[0][:200] or type(error).__name__
        raise InputError(f"{where}: damaged, or not as Photoshop writes it ({problem})") from None


def _opened(data: bytes, name: str, limits: Limits) -> Any:
    """Opens a file after a look at its header.

    Raises:
        InputError: The file is too short.
        UnsupportedError: Its colours cannot be imported.
        LimitError: The canvas exceeds `limits`.
    """
    if len(data) < _HEADER.size:
        raise InputError(f"{name}: the file is truncated")
    _, _, _, height, width, depth, mode = _HEADER.unpack_from(data)
    check_limit(limits, "side", max(width, height), name)
    check_limit(limits, "output_pixels", width * height, name)
    modes = import_module("psd_tools.constants").ColorMode
    kind = modes(mode).name if mode in list(modes) else f"mode {mode}"
    if kind not in COLOURS or depth not in (8, 16):
        raise UnsupportedError(
            f"{name}: layers of {kind} colours in {depth} bits cannot be imported; convert the "
            "file to RGB or grey of 8 or 16 bits, or take it flat (--frame 0)"
        )
    return import_module("psd_tools").PSDImage.open(io.BytesIO(data))


class _Reader:
    """Reader of the layers of a document.

    Attributes:
        document: The `psd_tools.PSDImage`.
        name: Name of the file in messages.
        limits: Bounds on the pixels of layers.
        blend: What becomes of layers that blend.
        colours: Colours of the layers.
        notes: What was not drawn.
    """

    def __init__(self, document: Any, name: str, limits: Limits, blend: str) -> None:
        self.document, self.name, self.limits, self.blend = document, name, limits, blend
        self.colours, self.notes = Colours(), list[str]()

    def resource(self, kind: str) -> Any:
        """Content of an image resource by its name in psd-tools, or None."""
        return self.document.image_resources.get_data(
            import_module("psd_tools.constants").Resource[kind]
        )

    def nodes(self, group: Any, groups: tuple[str, ...]) -> tuple[Node, ...]:
        """Layers and groups in a group, back to front."""
        runs: list[list[Any]] = []
        for layer in group:
            if layer.clipping and runs:
                runs[-1].append(layer)
            else:
                runs.append([layer])
        return tuple(n for base, *clips in runs for n in self._with_clips(base, clips, groups))

    def _with_clips(self, base: Any, clips: Sequence[Any], groups: tuple[str, ...]) -> list[Node]:
        """Nodes of a layer and of those that are clipped to it."""
        node = self._node(base, groups)
        own = [(v, n) for v in clips if (n := self._node(v, groups)) is not None]
        if node is None or not own:
            return [] if node is None else [node]
        shown = [v for v, n in own if n.shows]
        alike = all(n.children is None and not n.blend for _, n in own if n.shows)
        effects = any(v.has_effects() for v in (base, *shown))
        if alike and not effects and node.children is None and not node.blend and node.opacity == 1:
            return [node, *(self._clipped(base, node, v, n) for v, n in own)]
        # What blends within its base, or shares its translucence, cannot be a layer of its own.
        blend = node.blend or _blending_within(node)
        if shown and node.shows and not blend:
            self.notes.append(f"the layers clipped to {node.name!r} become one with it")
        whole = partial(self._drawn, (base, *shown), (base,))
        return [replace(node, draw=whole, children=None, blend=blend)]

    def _clipped(self, base: Any, below: Node, layer: Any, node: Node) -> Node:
        """Node of a layer that shows only where its base does."""

        def draw(where: str) -> Patch | None:
            own = self._drawn((layer,), (layer,), where, layer.bbox)
            mask = self._drawn((base,), (base,), where, layer.bbox)
            if own is None or mask is None:
                return None
            pixels, alpha = (_with_alpha(patch.pixels) for patch in (own, mask))
            white = np.iinfo(pixels.dtype).max
            share = alpha[..., -1] / np.float64(white)
            pixels[..., -1] = np.rint(pixels[..., -1] * share)
            return own._replace(pixels=pixels)

        return replace(node, draw=draw, hidden=node.hidden or below.hidden)

    def _node(self, layer: Any, groups: tuple[str, ...]) -> Node | None:
        """Node of a layer or group; None for an adjustment that cannot be drawn."""
        kinds = import_module("psd_tools.api.layers")
        mode, name = layer.blend_mode.name, printable(layer.name)
        plain = mode in ("NORMAL", "PASS_THROUGH")
        fill = 1.0 if layer.has_effects() else layer.fill_opacity / _FULL
        node = Node(
            name, groups, fill * layer.opacity / _FULL, not layer.visible,
            "" if plain else "blending mode " + mode.lower().replace("_", " "),
            draw=partial(self._drawn, (layer,), (layer,)), handle=layer,
        )  # fmt: skip
        if isinstance(layer, kinds.AdjustmentLayer):
            known = import_module("psd_tools.composite.adjustments").ADJUSTMENT_FUNC
            if layer.kind not in known and self.blend == "flatten":
                if node.shows:
                    self.notes.append(
                        f"adjustment layer {name!r} ({layer.kind}) is left out: it cannot be "
                        "drawn, and the picture looks different"
                    )
                return None
            return replace(node, blend=f"adjustment {layer.kind}")
        if node.shows:
            lost = [e.name for e in layer.effects if e.enabled and e.name not in DRAWN_EFFECTS]
            if lost:
                what = ", ".join(dict.fromkeys(lost))
                self.notes.append(f"layer {name!r} is drawn without its effects: {what}")
        if not layer.is_group():
            return node
        if isinstance(layer, kinds.Artboard):
            self.notes.append(f"artboard {name!r} is taken as a group, without its background")
        inner = self.nodes(layer, (*groups, name or "group"))
        return replace(node, children=inner, isolated=mode != "PASS_THROUGH")

    def difference(self) -> float:
        """Root of the mean squared difference between the layers and the flat picture in the file.

        Effects of old files, artboards and the like are drawn in that alone. It is 0 if there is
        none. Transparent parts are compared over white.
        """
        if not self.document.has_preview():
            return 0.0
        draw = import_module("psd_tools.composite").composite
        drawn, _, alpha = draw(self.document, layer_filter=lambda layer: layer.visible)
        flat, share = (self.document.numpy(kind) for kind in ("color", "shape"))
        error = (alpha * drawn + 1 - alpha) - (share * flat + 1 - share)
        return float(np.sqrt((error**2).mean()))

    def merge(self, below: Sequence[Node], scope: Node | None) -> Patch | None:
        """Draws layers that show as one, as `nodes.Merge`."""
        layers = [node.handle for node in below]
        for node in below:
            layers += _clips_of(node.handle)
        top = [] if scope is None else [scope.handle]
        return self._drawn(layers, top, self.name, self.document.viewbox)

    def _drawn(
        self, layers: Sequence[Any], alone: Sequence[Any], where: str,
        viewport: Box | None = None,
    ) -> Patch | None:  # fmt: skip
        """Draws layers as they look together.

        Args:
            layers: Layers, and groups with what shows in them.
            alone: Those of them, or groups around them, that are to be opaque, unclipped, and drawn
                over what lies behind; all groups around these are, too.
            where: Beginning of messages.
            viewport: Left, top, right, bottom of the part of the canvas to draw; by default that of
                the first layer.

        Returns:
            The pixels; None if nothing of them lies on the canvas.
        """
        with _foreign(where):
            kept = {id(v) for layer in layers for v in (*_shown_in(layer), *_around(layer))}
            full = {id(v): v for layer in alone for v in (layer, *_around(layer))}
            if viewport is None:
                effects = any(layer.has_effects() for layer in layers)
                viewport = self.document.viewbox if effects else layers[0].bbox
            box = _intersection(viewport, self.document.viewbox)
            if box is None:
                return None
            for layer in layers:
                check_limit(self.limits, "output_pixels", layer.width * layer.height, where)
            draw = import_module("psd_tools.composite").composite
            with _at_full(full.values(), {id(v) for v in alone}):
                colour, _, alpha = draw(
                    self.document, viewport=box, layer_filter=lambda layer: id(layer) in kept
                )
        return self._patch(np.dstack([colour, alpha]), box, where)

    def _patch(self, drawn: Any, box: Box, where: str) -> Patch:
        """Pixels of floats [h, w, C] in 0..1 with alpha, in colours that can be carried."""
        dtype = np.uint8 if self.document.depth == 8 else np.uint16
        values = rounded(np.clip(drawn, 0, 1).astype(np.float32), dtype)
        if (values[..., -1] == np.iinfo(dtype).max).all():
            values = values[..., :-1]
        pixels, blocks, notes = adopt(values, Colour(icc=self.resource("ICC_PROFILE") or b""))
        self.notes += notes
        if pixels.dtype.kind == "f":
            pixels = rounded(np.clip(pixels, 0, 1), dtype)
        return Patch(self.colours.adopted(Picture(pixels, blocks), where), *box[:2])


def _intersection(one: Box, other: Box) -> Box | None:
    """Common part of two boxes, or None."""
    left, top = (max(a, b) for a, b in zip(one[:2], other[:2], strict=True))
    right, bottom = (min(a, b) for a, b in zip(one[2:], other[2:], strict=True))
    return (left, top, right, bottom) if left < right and top < bottom else None


@contextmanager
def _at_full(layers: Iterable[Any], unclipped: set[int]) -> Iterator[None]:
    """Context in which layers are opaque, and some are not clipped."""
    layers = list(layers)
    before = [(v, v.opacity, v.fill_opacity, v.clipping) for v in layers]
    for layer in layers:
        layer.opacity = _FULL
        if not layer.has_effects() and layer.fill_opacity != _FULL:
            layer.fill_opacity = _FULL
        if id(layer) in unclipped and layer.clipping:
            layer.clipping = False
    try:
        yield
    finally:
        for layer, opacity, fill, clipping in before:
            layer.opacity = opacity
            if layer.fill_opacity != fill:
                layer.fill_opacity = fill
            if layer.clipping != clipping:
                layer.clipping = clipping


def _shown_in(layer: Any) -> Iterator[Any]:
    """A layer, and what shows in it if it is a group."""
    yield layer
    for child in layer if layer.is_group() else ():
        if child.visible:
            yield from _shown_in(child)


def _around(layer: Any) -> Iterator[Any]:
    """Groups around a layer, innermost first."""
    group = layer.parent
    while group is not None and group.parent is not None:
        yield group
        group = group.parent


def _blending_within(node: Node) -> str:
    """Blending of layers in a group with what lies behind the group; empty if none does."""
    if node.children is None or node.isolated:
        return ""
    shown = [child for child in node.children if child.shows]
    return next((b for child in shown if (b := child.blend or _blending_within(child))), "")


def _clips_of(layer: Any) -> list[Any]:
    """Visible layers that are clipped to a layer."""
    return [v for v in layer.clip_layers if v.visible]


def _with_alpha(pixels: Any) -> Any:
    """A copy of pixels [h, w, C] with alpha."""
    if pixels.shape[2] in (2, 4):
        return pixels.copy()
    return np.dstack([pixels, np.full(pixels.shape[:2], np.iinfo(pixels.dtype).max, pixels.dtype)])

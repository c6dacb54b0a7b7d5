"""The reference renderer: coverage, warp, texture, front-to-back compositing, in tiles."""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Sequence

import numpy as np
from numpy.typing import NDArray

from ..geometry import coverage as cover
from ..geometry.boundary import Boundary
from ..geometry.mesh import FRACTION_BITS
from ..geometry.pose import COLOUR_BITS, OPACITY_MAX
from ..geometry.warp import Located, Warp
from ..limits import DEFAULT_LIMITS, SAMPLE_COST_BITS, Budget, Limits
from ..model import Layer, Picture
from ..native import kernel
from ..texture import node_sampling, sampling
from ..texture.grid import Window
from ..texture.implicit import ImplicitTexture
from ..texture.network import Floats, Network
from ..texture.occlusion import ALL_IN_PLACE, Moved
from ..texture.planes import Planes
from ..texture.pyramid import PyramidTexture
from . import engines, finish_native, still
from .cache import SAMPLES_MAX, Cache, Sheet
from .neighbours import moved_neighbours, present_outline
from .progress import Progress
from .view import View

TILE_SAMPLES = 1 << 16
"""Samples rendered at a time: bounds memory for any output, and keeps it in the processor cache."""

ANCHOR_COST_BITS = 7
"""Cost of a feature at an anchor, for each sample: 2**ANCHOR_COST_BITS multiplications."""

Rectangle = tuple[int, int, int, int]


def compose(
    picture: Picture,
    view: View,
    layers: Sequence[Layer],
    engine: str,
    out: Callable[[int, int, Floats], None],
    limits: Limits = DEFAULT_LIMITS,
    cache: Cache | None = None,
    progress: Callable[[int], None] | None = None,
) -> None:
    """Draws layers, and hands finished tiles to a function.

    What a layer was mixed with, of neighbours that are not drawn, does not show [PYR-46]. First the
    parts of planes that are needed are decoded.

    Args:
        picture: Picture that the layers belong to.
        view: Output size and region.
        layers: Layers to draw, back to front.
        engine: Name of the engine that runs the decoder networks.
        out: Called for each tile with row and column of its first output pixel, and float32
            [h, w, 4] premultiplied colour and alpha in 0..1.
        limits: Bounds on the work.
        cache: Colours computed before; this call adds to them.
        progress: Called again and again with how much more is done, in output pixels; these add up
            to all. What it raises ends the work.

    Raises:
        UsageError: The engine is unknown.
        UnsupportedError: The engine, or a package that it needs, is not installed.
        LimitError: The work would exceed `limits`.
        FormatError: A coded stream that is decoded only now is corrupt.
    """
    budget, cache = Budget(limits), cache or Cache()
    drawn = frozenset(layers)
    moved = [moved_neighbours(picture, layer, drawn) for layer in layers]
    sx, sy = view.supersampling
    samples = len(layers) * view.width * sx * view.height * sy
    budget.spend("multiply_adds", samples << SAMPLE_COST_BITS)
    solid = all(map(_is_solid, layers, moved))
    painters = [
        _Painter(picture, layer, apart, solid, view, engine, budget, cache)
        for layer, apart in zip(reversed(layers), reversed(moved), strict=True)
    ]
    told = Progress(view.width * view.height, progress)
    needs = [p.needs for p in painters if p.needs is not None]
    told.decode(needs)
    tile_w = max(min(view.width, TILE_SAMPLES // (sx * sy)), 1)
    tile_h = max(TILE_SAMPLES // (tile_w * sx * sy), 1)
    for row in range(0, view.height, tile_h):
        h = min(tile_h, view.height - row)
        for column in range(0, view.width, tile_w):
            w = min(tile_w, view.width - column)
            with told.drawing(w * h):
                tile = _tile(painters, (column * sx, row * sy, w * sx, h * sy))
                if sx * sy > 1:
                    tile = tile.reshape(h, sy, w, sx, 4).mean((1, 3), dtype=np.float32)
                out(row, column, tile)


def _tile(painters: Sequence[_Painter], box: Rectangle) -> Floats:
    """Renders premultiplied samples [h, w, 4] of a rectangle `box` = x, y, w, h of samples."""
    _, _, w, h = box
    if (shared := _together(painters, box)) is not None:
        return shared
    result = np.zeros((h * w, 4), np.float32)
    clear = np.ones(h * w, np.float32)
    for painter in painters:
        sheet = painter.sheet(box)
        rows = slice(sheet.start, sheet.stop)
        covered = np.float32(1) if sheet.coverage is None else sheet.coverage
        fresh = np.flatnonzero((clear[rows] * covered > 0) & ~sheet.known)
        if len(fresh):
            painter.paint(sheet, box, fresh)
        colour = painter.posed(sheet.colour)
        if painter.native:
            kernel.blend(result[rows], clear[rows], colour, sheet.coverage)
            continue
        weight = clear[rows] * covered
        result[rows] += weight[:, None] * colour
        clear[rows] *= 1 - covered * colour[:, 3]
    return result.reshape(h, w, 4)


def _together(painters: Sequence[_Painter], box: Rectangle) -> Floats | None:
    """Renders `_tile` if all layers show the same samples, as in a picture at rest; else None."""
    if not all(painter.plain for painter in painters):
        return None
    shown: list[still.Still] = []
    covers: list[NDArray[np.int32] | None] = []
    for painter in painters:
        covered = painter.covered(box)
        if covered is not None and not covered.any():
            continue
        found = painter.still(box)
        if found is None or found.samples is not (shown or [found])[0].samples:
            return None
        shown.append(found)
        covers.append(covered)
    for own, covered in zip(shown, covers, strict=True):
        # Beyond the ends of a layer's part, its last samples are repeated.
        rows, columns = own.rows != shown[-1].rows, own.columns != shown[-1].columns
        if covered is None:
            if rows.any() or columns.any():
                return None
        elif covered[rows].any() or (columns.any() and covered[:, columns].any()):
            return None
    return still.together(shown[-1], covers) if shown else None


def _is_solid(layer: Layer, moved: Moved) -> bool:
    """Whether nothing shows through a layer where its boundary covers all."""
    texture = layer.texture
    if not isinstance(texture, PyramidTexture):
        return True
    own = texture.cuts is not None and texture.cuts.own is not None
    soft = texture.matte is not None and not (own and moved == ALL_IN_PLACE)
    return texture.alpha is None and not soft


class _Painter:
    """Renderer of one layer on the sample grid of one view."""

    def __init__(
        self, picture: Picture, layer: Layer, moved: Moved, solid: bool, view: View, engine: str,
        budget: Budget, cache: Cache,
    ) -> None:  # fmt: skip
        self._picture, self._layer, self._view = picture, layer, view
        self._budget, self._cache = budget, cache
        self._engine = engine
        self._run = engines.find(engine)
        self.native = self._run is engines.run_native
        self._network = picture.network_of(layer)
        self._moved = moved
        paths = outline(present_outline(picture, layer), view)
        self._paths = None if paths is None else cover.Segments.of(paths)
        self._warp = Warp(layer.pose, layer.mesh, layer.sampling in (1, 2), budget)
        sx, sy = view.supersampling
        small = view.width * sx * view.height * sy <= SAMPLES_MAX
        # A moment of a motion is drawn only once. Caching it would displace sheets of still layers.
        self._caching = small and layer.pose.sway is None
        # What lies in front in its place hides the same samples as cuts do, if it is not clear.
        texture = layer.texture
        self._seen = (
            isinstance(texture, PyramidTexture)
            and solid
            and moved == ALL_IN_PLACE
            and texture.mask is None
            and (texture.cuts is None or texture.cuts.within is None)
        )
        self._window = self._needed()
        self._covered: tuple[Rectangle, NDArray[np.int32]] | None = None

    def _needed(self) -> Window | None:
        """Samples of the part of a pyramid texture that the view needs; None if it may be all."""
        texture, box, pose = self._layer.texture, self._layer.box, self._layer.pose
        view = self._view
        if not isinstance(texture, PyramidTexture) or pose.affine or pose.bent:
            return None
        spans = []
        for start, extent, k in ((view.y, view.region_height, 1), (view.x, view.region_width, 0)):
            scale, count = texture.part[k + 2] / box[k + 2], texture.part[k + 2]
            first, last = ((at - box[k]) * scale for at in (start, start + extent))
            spans += [
                min(max(math.floor(first) - sampling.TAPS, 0), count - 1),
                max(min(math.ceil(last) + sampling.TAPS, count), 1),
            ]
        return Window(*spans)

    @property
    def needs(self) -> tuple[Planes, Window] | None:
        """Planes of the layer and the samples of their raster to decode; None if there are none."""
        texture, view = self._layer.texture, self._view
        if not isinstance(texture, PyramidTexture):
            return None
        x, y, width, height = texture.part
        if self._window is None:
            return texture.planes, Window(y, y + height, x, x + width)
        left, top, right, bottom = self._layer.box
        right, bottom = left + right, top + bottom
        across = left < view.x + view.region_width and view.x < right
        down = top < view.y + view.region_height and view.y < bottom
        if not (across and down):
            return None
        w = self._window
        return texture.planes, Window(w.top + y, w.bottom + y, w.left + x, w.right + x)

    def sheet(self, box: Rectangle) -> Sheet:
        """Returns the sheet of a rectangle x, y, w, h of samples, with the colours known so far."""
        key = self._key(box)
        found = self._cache.get(key) if self._caching else None
        if found is None:
            found = self._blank(box)
            if self._caching:
                self._cache.put(key, found)
        return found

    def _blank(self, box: Rectangle) -> Sheet:
        _, _, w, h = box
        covered = self.covered(box)
        if covered is None:
            return Sheet(None, 0, h * w)
        seen = np.flatnonzero(covered.max(1))  # faster than any(1)
        first, last = (int(seen[0]), int(seen[-1]) + 1) if len(seen) else (0, 0)
        share = covered[first:last].ravel().astype(np.float32) / np.float32(cover.FULL)
        return Sheet(share, first * w, last * w)

    def _key(self, box: Rectangle) -> Hashable:
        """Key of everything that a sheet depends on; parts of the immutable model by identity."""
        layer, pose = self._layer, self._layer.pose
        arrays = tuple(None if v is None else v.tobytes() for v in (pose.nodes, pose.places))
        return (
            layer.boundary, layer.texture, self._moved, self._network, layer.mesh,
            layer.box, layer.sampling, pose.matrix, pose.shift, arrays,
            self._view, box, self._engine,
        )  # fmt: skip

    def paint(self, sheet: Sheet, box: Rectangle, at: NDArray[np.int64]) -> None:
        """Computes colours of samples of a sheet; `at` are their numbers, from `sheet.start` on."""
        if (found := self.still(box)) is not None:
            still.paint(found, sheet, at)
            return
        colour = self._textured(box, at + sheet.start)
        if len(at) == len(sheet.known):
            sheet.colour = colour
        else:
            sheet.colour[at] = colour
        sheet.known[at] = True

    @property
    def plain(self) -> bool:
        """Whether it paints samples as they are, all that are asked for."""
        pose = self._layer.pose
        return self._seen and not pose.colour and pose.opacity == OPACITY_MAX

    def covered(self, box: Rectangle) -> NDArray[np.int32] | None:
        """Coverage int32 [h, w] of a rectangle in 0..`cover.FULL`; None where all is covered."""
        if self._paths is None:
            return None
        if self._covered is None or self._covered[0] != box:  # a tile asks twice, at most
            self._covered = box, cover.coverage(self._paths, *box, self._budget)
        return self._covered[1]

    def still(self, box: Rectangle) -> still.Still | None:
        """Samples that the points of a rectangle lie on; None if they are not that simple."""
        texture, (x, y, w, h) = self._layer.texture, box
        if not (self.native and isinstance(texture, PyramidTexture)) or self._window is None:
            return None
        xs, ys = self._view.columns(x, x + w), self._view.rows(y, y + h)
        return still.find(texture, xs, ys, self._layer.box, self._moved, self._seen)

    def posed(self, colour: Floats) -> Floats:
        """Applies the colour matrix and the opacity of the pose to premultiplied colours [n, 4]."""
        pose = self._layer.pose
        if pose.colour:
            matrix = np.array(pose.colour, np.float32).reshape(3, 4) / (1 << COLOUR_BITS)
            red, green, blue, alpha = colour.T.copy()
            colour = colour.copy()
            for k, (r, g, b, one) in enumerate(matrix):
                mixed = r * red + g * green + b * blue + one * alpha
                colour[:, k] = np.minimum(np.maximum(mixed, 0), alpha)
        if pose.opacity != OPACITY_MAX:
            colour = colour * np.float32(pose.opacity / OPACITY_MAX)
        return colour

    def _textured(self, box: Rectangle, at: NDArray[np.int64]) -> Floats:
        """Premultiplied texture colours [n, 4] of the samples numbered `at` [n] of a rectangle."""
        x0, y0, w, h = box
        xs, ys = self._view.columns(x0, x0 + w), self._view.rows(y0, y0 + h)
        x, y = xs[at % w], ys[at // w]
        layer = self._layer
        face = None
        if self._warp.meshed:
            faces = self._warp.faces(*self._view.grid, box)
            face = faces.ravel()[at]
        shown = self._warp.locate(x, y, face)
        texture = layer.texture
        if isinstance(texture, PyramidTexture):
            sampled = texture.sample(
                shown.x, shown.y, layer.box, self._moved, self.native, self._window, self._seen
            )
            return premultiplied(sampled)
        network = self._network
        assert network is not None, "an implicit texture has a network"
        cost = network.shape.parameters
        if layer.sampling in (node_sampling.BOTH, node_sampling.GLOBAL):
            anchors = 4 if layer.boundary is None else sum(layer.boundary.segments)
            cost += anchors * len(texture.steps) << ANCHOR_COST_BITS
        self._budget.spend("multiply_adds", len(at) * cost)
        if layer.sampling:
            return premultiplied(_at_nodes(self._picture, layer, texture, network, shown))
        taps = texture.taps(shown.x, shown.y, layer.box)
        return premultiplied(self._run(texture, network, taps))


def outline(boundary: Boundary | None, view: View) -> list[NDArray[np.int64]] | None:
    """Paths of a boundary on the sample grid of a view.

    Args:
        boundary: Boundary in its present place; None for the whole canvas.
        view: The view.

    Returns:
        For each path int64 [3 m, 2] control points in 1/256 sample; None for the whole canvas.
    """
    if boundary is None:
        return None
    sx, sy = view.supersampling
    unit = boundary.unit
    return [
        np.stack(
            [
                cover.to_output(p[:, 0], unit, view.x, view.region_width, view.width * sx),
                cover.to_output(p[:, 1], unit, view.y, view.region_height, view.height * sy),
            ],
            axis=1,
        )
        for p in boundary.paths
    ]


def _at_nodes(
    picture: Picture, layer: Layer, texture: ImplicitTexture, network: Network, shown: Located
) -> Floats:
    """Network outputs float32 [n, channels] of a layer with node sampling."""
    refined = layer.mesh.refined if layer.mesh else None
    nodes = np.zeros((1, 2)) if refined is None else refined.nodes / (1 << FRACTION_BITS)
    faces = np.zeros((1, 3), np.int32) if refined is None else refined.faces
    count = len(shown.x)
    features = node_sampling.features(
        texture, layer.box, layer.sampling, nodes, faces,
        node_sampling.anchors(layer.boundary, picture.size),
        np.zeros(count, np.int64) if shown.face is None else shown.face,
        np.zeros((count, 3)) if shown.weights is None else shown.weights,
        np.stack([shown.x, shown.y], axis=1),
    )  # fmt: skip
    return engines.run_features(network, features)


def premultiplied(output: Floats) -> Floats:
    """Clamps outputs of a texture to valid premultiplied colour and alpha.

    Args:
        output: float32 [N, 3] colour, or [N, 4] premultiplied colour and alpha; a NaN counts as 0.

    Returns:
        float32 [N, 4] with alpha in 0..1, which is 1 without a fourth output, and colour in
        0..alpha.
    """
    if kernel.available():
        return finish_native.premultiplied(output)
    result = np.empty((len(output), 4), np.float32)
    result[:, 3] = np.fmin(np.fmax(output[:, 3], 0), 1) if output.shape[1] == 4 else 1
    for k in range(3):
        # Unlike clip, fmax of a NaN and a number is the number.
        np.fmin(np.fmax(output[:, k], 0), result[:, 3], out=result[:, k])
    return result

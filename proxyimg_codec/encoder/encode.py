"""Encoding of pixels as a `Picture`: layers, boundaries, fitted and quantized textures."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from .._version import __version__
from ..container import meta
from ..errors import UsageError
from ..io.color import cicp_problem
from ..io.samples import standard, to_float
from ..limits import DEFAULT_LIMITS, enough_memory
from ..model import Layer, Layers, Picture
from ..texture.implicit import ImplicitTexture
from ..texture.network import Floats, NetShape, Network
from .completion.behind import source_of
from .completion.occluded import extended
from .implicit import fit, node_problem
from .implicit.fit_problem import Problem, build
from .implicit.state import State, quantize, rows_of
from .settings import Settings
from .shapes.layers import Plan, plan_layers
from .shapes.mask_arrays import Masks, regions_of
from .shapes.masks import Region
from .shapes.meshes import with_meshes
from .suited import tell_if_unsuited

CODES_MAX = DEFAULT_LIMITS.codes
"""Most codes that readers accept by default; codes of a large picture lie further apart."""


class Progress(Protocol):
    """Callback that is told how far the encoder is."""

    def __call__(self, stage: str, done: int, total: int) -> None:
        """Reports that `done` of `total` units of a stage are finished.

        Args:
            stage: Name of the stage: ``layers``, ``hidden`` or ``texture``.
            done: Number of finished units.
            total: Number of units of the stage.
        """


@enough_memory("to encode the picture; make it smaller, or encode it in parts")
def encode(
    pixels: NDArray[Any],
    settings: Settings | None = None,
    *,
    masks: Masks | None = None,
    blocks: Mapping[str, bytes] | None = None,
    behind: NDArray[Any] | None = None,
    progress: Progress | None = None,
    **options: Any,
) -> Picture:
    """Encodes a picture.

    Args:
        pixels: [H, W] or [H, W, C] with C = 1 for grey, 2 for grey and alpha, 3 for RGB, 4 for RGB
            and alpha; alpha is straight; integers without a sign, of which the largest of their
            type is white, bool, or floating point in 0..1.
        settings: Settings of the encoder; by default ``Settings()``.
        masks: Layers given by the user, back to front; by default the encoder finds layers itself.
            A list of arrays [H, W] (bool, 0 and 1, 0..255, or floats in 0..1; `settings.matte` says
            what becomes of soft ones) or of regions, a dict of arrays by name, an array [N, H, W],
            or one array [H, W] of labels 0, 1, 2, ... of which 0 is the back.
        blocks: Metadata blocks to carry: ``icc`` and ``cicp``, which say what colours these are,
            ``exif`` and ``xmp``; `io.raster.read` gives those of a file.
        behind: The picture without its objects, as `pixels`, of the same size and colours, and
            opaque: what shows of the back layer when others are moved. Pyramid only.
        progress: Called with the name of a stage, and its numbers of units done and in all.
        options: Fields of `Settings` that replace those of `settings`, such as ``quality=70``.

    Returns:
        The picture as a reader will decode it.

    Raises:
        InputError: An array cannot be a picture, a mask or `behind` does not fit it, or a mesher
            or a model fails.
        UsageError: A setting or metadata block is invalid, `behind` contradicts a setting, or a
            target size or PSNR is out of reach.
        UnsupportedError: A package that is needed is not installed.
        LimitError: The picture is larger than readers accept by default, or needs more memory than
            there is.
    """
    settings = _with_options(settings or Settings(), options)
    report = progress or (lambda stage, done, total: None)
    picture, depth = to_float(np.asarray(pixels))
    DEFAULT_LIMITS.check("side", max(picture.shape[:2]))
    check_blocks(blocks or {})
    height, width = picture.shape[:2]
    source = source_of(behind, settings, width, height)
    regions = None if masks is None else regions_of(masks, height, width)
    plan = _planned(picture, settings, regions, report)
    premultiplied = picture if plan.opaque else _premultiplied(picture)
    plan = with_meshes(premultiplied, plan, settings)
    finished = partial(_finished, settings=settings, depth=depth, blocks=dict(blocks or {}))
    if settings.pyramid and (behind is not None or not plain(premultiplied)):
        from .pyramid.picture import encode_picture

        image = encode_picture(picture, plan, settings, report, finished, source)
        if settings.texture == "auto" and masks is None:
            tell_if_unsuited(standard(np.asarray(pixels)), image)
        return image
    return finished(_with_network(premultiplied, plan, settings, report))


def _finished(
    found: Picture, settings: Settings, depth: int, blocks: Mapping[str, bytes]
) -> Picture:
    """Gives a picture what its file has beside layers."""
    from .pyramid.tiles import with_tiles

    return replace(with_tiles(found, settings), depth=depth, blocks=blocks)


def _premultiplied(picture: Floats) -> Floats:
    out = picture.copy()
    out[..., :3] *= picture[..., 3:]
    return out


def _with_options(settings: Settings, options: Mapping[str, Any]) -> Settings:
    """Replaces some fields of settings; raises `UsageError` if there is no such field."""
    try:
        return replace(settings, **options) if options else settings
    except TypeError as error:
        raise UsageError(f"encode: {error}") from None


def _planned(
    picture: Floats, settings: Settings, masks: Sequence[Region] | None, report: Progress
) -> Plan:
    """Plan of the layers of a picture, float32 [H, W, 4] with straight alpha."""
    report("layers", 0, 1)
    plan = plan_layers(picture, settings, masks)
    report("layers", 1, 1)
    if settings.background == "complete" and not plan.opaque:
        raise UsageError("background complete needs an opaque picture")
    return plan


def _with_network(picture: Floats, plan: Plan, settings: Settings, report: Progress) -> Picture:
    """Encodes a premultiplied picture, float32 [H, W, 4], with implicit textures."""
    height, width = picture.shape[:2]
    outlines = [layer.boundary for layer in plan.layers]

    def problem_of(shape: NetShape, spacing: float) -> Problem:
        problem = build(picture, outlines, shape, spacing)
        learnt = settings.sampling == "direct" and settings.background != "none"
        if outlines[0] is None and learnt:
            problem = extended(problem, width, height, spacing)
        return problem

    return fit_image(problem_of, height * width, plan, (width, height), settings, report)


def plain(picture: Floats) -> bool:
    """Whether all pixels of a picture [H, W, C] are equal."""
    return bool((picture == picture[0, 0]).all())


def fit_image(
    problem_of: Callable[[NetShape, float], Problem],
    pixels: int,
    plan: Plan,
    size: tuple[int, int],
    settings: Settings,
    report: Progress,
) -> Picture:
    """Fits the implicit textures of planned layers, which share one network.

    Args:
        problem_of: Makes the fitting problem for the sizes of a network and a spacing of codes in
            canvas pixels.
        pixels: Number of pixels to learn; decides the size of the network.
        plan: The layers.
        size: Width and height of the canvas in pixels.
        settings: Settings of the encoder.
        report: Called as steps of the optimizer are done.

    Returns:
        A picture with a depth of 8 bits, without metadata.

    Raises:
        UnsupportedError: torch is needed and not installed, or the device is not available.
    """
    shape, spacing = settings.network(pixels, plan.channels), settings.spacing
    problem = problem_of(shape, spacing)
    while (codes := shape.dim * sum(plane.size for plane in problem.planes)) > CODES_MAX:
        spacing *= 1.02 * math.sqrt(codes / CODES_MAX)
        problem = problem_of(shape, spacing)
    if (problem.target == problem.target[0]).all():
        problem = problem_of(NetShape(1, 0, 1, 1, plan.channels), np.inf)
    elif settings.sampling == "node":
        problem = node_problem.build(problem, plan.layers, size, node_problem.options_for(settings))
    state, stored = _fit(problem, settings, report)
    network, textures = assemble(problem, state, stored, settings)
    info = {
        "encoder": f"proxyimg-codec {__version__}",
        "settings": json.dumps(settings.record(), sort_keys=True),
        "areas": list(problem.areas),
    }
    layers = [
        Layer(layer.name, plane.box, layer.boundary, texture, layer.mesh, problem.sampling,
              parent=layer.parent)
        for layer, plane, texture in zip(plan.layers, problem.planes, textures, strict=True)
    ]  # fmt: skip
    return Picture(*size, plan.channels, plan.opaque, 8, Layers(layers), (network,), info=info,
                   groups=plan.groups)  # fmt: skip


def check_blocks(blocks: Mapping[str, bytes]) -> None:
    """Raises `UsageError` if a metadata block is empty, no bytes, not known, or no colour."""
    for name, block in blocks.items():
        if name not in (*meta.BLOCKS, "cicp") or not block:
            kinds = ", ".join((*meta.BLOCKS, "cicp"))
            raise UsageError(f"metadata block {name!r} is empty or not one of {kinds}")
        if not isinstance(block, bytes):
            raise UsageError(
                f"metadata block {name!r} is of type {type(block).__name__}, not bytes"
            )
    problem = cicp_problem(blocks["cicp"]) if "cicp" in blocks else None
    if problem is not None:
        raise UsageError(f"metadata block 'cicp': {problem}")


def _fit(
    problem: Problem, settings: Settings, report: Progress
) -> tuple[State, list[NDArray[np.bool_]]]:
    """Fits the parameters of a problem.

    Returns:
        The quantized state, and for each layer bool [rows, columns], True at stored positions.
    """
    if (problem.target == problem.target[0]).all():
        return constant(problem, settings), problem.stored()
    done = 0

    def step(count: int) -> None:
        nonlocal done
        done += count
        report("texture", done, settings.steps)

    if isinstance(problem, node_problem.NodeProblem):
        from .implicit.fit_node import fit_quantized

        state = fit_quantized(
            problem, settings.steps, settings.bits, settings.weight_bits, settings.seed,
            settings.device, step,
        )  # fmt: skip
    else:
        state = fit.fit(
            problem, settings.steps, settings.bits, settings.weight_bits, settings.seed,
            settings.device, settings.jobs, step,
        )  # fmt: skip
    stored = problem.stored()
    if settings.background == "complete":
        from .completion.background import complete

        stored[0] = complete(problem, state, stored[0], settings)
    return state, stored


def constant(problem: Problem, settings: Settings) -> State:
    """State of a picture of one colour: everything is 0 but the bias of the output."""
    state = fit.initial(problem, settings.seed)
    state.codes[:] = 0
    state.weights[:] = 0
    rows_of(problem.shape, state.weights)[-1][1][:] = problem.target[0]
    state.code_bits, state.net_bits = settings.bits, settings.weight_bits
    return state


def assemble(
    problem: Problem, state: State, stored: list[NDArray[np.bool_]], settings: Settings
) -> tuple[Network, list[ImplicitTexture]]:
    """Quantizes a fitted state.

    Args:
        problem: The problem that the state was fitted to.
        state: The state, with quantization steps.
        stored: For each layer bool [rows, columns], True at positions whose codes are stored.
        settings: Settings of the encoder, for the bits per code and per weight.

    Returns:
        The network, and the texture of each layer.
    """
    shape: NetShape = problem.shape
    rows = rows_of(shape, state.weights)
    ends = np.cumsum([o for _, o in shape.layers])[:-1]
    steps = np.split(state.row_steps, ends)
    network = Network(
        shape,
        settings.weight_bits,
        tuple(
            quantize(w, s[:, None], settings.weight_bits)
            for (w, _), s in zip(rows, steps, strict=True)
        ),
        state.row_steps.astype(np.float16),
        np.concatenate([b for _, b in rows]).astype(np.float16),
    )
    textures = []
    for k, plane in enumerate(problem.planes):
        values = state.codes[plane.start : plane.start + plane.size]
        codes = quantize(values, state.code_steps[k], settings.bits)
        codes = np.where(stored[k].reshape(-1, 1), codes, np.int8(0)).T
        textures.append(
            ImplicitTexture(
                0,
                settings.bits,
                state.code_steps[k].astype(np.float16),
                np.ascontiguousarray(codes).reshape(-1, plane.rows, plane.columns),
                stored[k],
            )
        )
    return network, textures

"""Plug-ins: functions that are found by name, and that other packages can add.

A package offers a plug-in as an entry point in the group ``proxyimg_codec.KIND``:

    [project.entry-points."proxyimg_codec.segmenters"]
    mine = "my_package:segment"

Kinds:
    segmenters: `(rgb, max_layers, support) -> list[Region]`, as `encoder.shapes.figures.segment`.
    prompters: `(rgb, prompts, jobs=1) -> list[Region]`, as `encoder.shapes.pointing.point_at`.
    depth: `(rgb) -> float32 [H, W]`, larger is nearer; any scale.
    inpainters: `(picture, hole) -> float32 [H, W, 3]`, both of them in 0..1: the picture with other
        colours where hole, bool [H, W], is True.
    guides: `(wishes) -> Guide`, as in `generate.guide`: what new textures are made by.
    meshers: `(boundary, size, edge) -> Base`, as `geometry.mesher.delaunay`.
    engines: `(texture, network, taps) -> float32 [N, channels]`, as `render.engines.run_numpy`.
    handles: `(picture) -> Image`: what functions below `api` give to those who call them directly.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from ..errors import UnsupportedError, UsageError

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint, EntryPoints

BUILT_IN: dict[str, dict[str, str]] = {
    "segmenters": {
        "figures": "proxyimg_codec.encoder.shapes.figures:segment",
        "regions": "proxyimg_codec.encoder.shapes.segment:segment",
    },
    "prompters": {
        "maps": "proxyimg_codec.encoder.shapes.pointing:point_at",
        "sam": "proxyimg_codec.encoder.shapes.external_models.prompting:prompted",
    },
    "depth": {},
    "inpainters": {},
    "guides": {},
    "meshers": {
        "delaunay": "proxyimg_codec.geometry.mesher:delaunay",
        "triwild": "proxyimg_codec.encoder.shapes.external_meshers:triwild",
        "ftetwild": "proxyimg_codec.encoder.shapes.external_meshers:ftetwild",
    },
    "engines": {"ort": "proxyimg_codec.export.onnx_engine:run"},
    "handles": {"image": "proxyimg_codec.api:Image"},
}
"""Plug-ins of this package: ``module:attribute`` by kind and name."""


def _added(kind: str) -> EntryPoints:
    """Entry points of other packages for a kind."""
    # Imports e-mail, ZIP files and sockets: a tenth of a second that decoding does not need.
    from importlib.metadata import entry_points

    return entry_points(group=f"proxyimg_codec.{kind}")


def names(kind: str) -> list[str]:
    """Names of all plug-ins of a kind, built-in ones first."""
    added = {e.name for e in _added(kind)}
    return [*BUILT_IN[kind], *sorted(added - set(BUILT_IN[kind]))]


def find(kind: str, name: str) -> Any:
    """Loads the plug-in of a kind and name; built-in ones cannot be replaced.

    Raises:
        UsageError: There is no such plug-in.
        UnsupportedError: A package that the plug-in needs is not installed, or the package that
            offers it does not have it.
    """
    if name in BUILT_IN[kind]:
        module, _, attribute = BUILT_IN[kind][name].partition(":")
        try:
            return getattr(importlib.import_module(module), attribute)
        except ModuleNotFoundError as error:
            raise UnsupportedError(
                f"{kind}: {name} needs {error.name}: pip install 'proxyimg-codec[all]'"
            ) from None
    for entry in _added(kind):
        if entry.name == name:
            return _loaded(kind, entry)
    there = ", ".join(names(kind)) or "none"
    raise UsageError(f"{kind}: {name!r} is unknown; there are {there}")


def _loaded(kind: str, entry: EntryPoint) -> Any:
    """Loads a plug-in of another package."""
    package = entry.dist.name if entry.dist else entry.module.partition(".")[0]
    try:
        return entry.load()
    except ModuleNotFoundError as error:
        problem = f"needs {error.name}, which is not installed"
    except (ImportError, AttributeError) as error:
        problem = f"cannot be loaded ({error})"
    raise UnsupportedError(
        f"{kind}: {entry.name!r} of package {package} {problem}; install what is missing, or "
        f"another version of {package}"
    )

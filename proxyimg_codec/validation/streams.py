"""Decoding of all streams of a container, each once; states of a history share most of them."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from math import inf, prod
from typing import Any

from ..codec import unpack
from ..container import layr, mesh, motn, netw, plan, pose, texr
from ..container.content import Container, Values
from ..geometry import boundary
from ..geometry import pose as poses
from ..geometry.mesh import Mesh
from ..limits import Budget, Limits
from ..model import Picture
from ..texture import implicit, network, planes, pyramid
from .findings import Findings


class Streams:
    """Decoded chunks of a file and its history; equal chunks are decoded once.

    Attributes:
        budget: Number of values that may still be decoded; streams that would exceed it are
            skipped.
    """

    def __init__(self, findings: Findings, limits: Limits) -> None:
        self.budget: float = inf
        self._findings, self._limits = findings, limits
        # Keys are the identities of the values of a chunk, and of the objects that it refers to.
        self._results: dict[tuple[int, ...], Any] = {}

    def decode(self, c: Container) -> None:
        """Decodes all streams of a container, and reports their errors."""
        budget = Budget(self._limits)
        for i, v in enumerate(c.layers):
            self._once(layr.TYPE, i, sum(v["segments"]), partial(boundary.decode, v, ""), v)
        meshes = {
            v["layer"]: self._once(mesh.TYPE, i, v["gates"] << 6, partial(_mesh, v, budget), v)
            for i, v in enumerate(c.meshes)
        }
        for i, v in enumerate(c.poses):
            own = meshes.get(v["layer"])
            if own is not None or v["layer"] not in meshes:
                cost = 1 if own is None else 4 * len(own.refined.nodes)
                self._once(pose.TYPE, i, cost, partial(poses.decode, v, own, ""), v, own)
        nets = [
            self._once(
                netw.TYPE, i, v["hidden"] * (v["depth"] * v["hidden"] + v["dim"] * 25),
                partial(network.unpack, v, ""), v,
            )
            for i, v in enumerate(c.networks)
        ]  # fmt: skip
        rasters = [
            self._once(
                plan.TYPE, i, 3 * prod(n + (1 << v["levels"]) for n in v["size"]),
                partial(_planes, v), v,
            )
            for i, v in enumerate(c.planes)
        ]  # fmt: skip
        self._textures(c, nets, rasters)
        if c.motion is not None:
            moving = [meshes[n] for n in c.motion["layers"]]
            if all(m is not None for m in moving):
                nodes = sum(len(m.refined.nodes) for m in moving)
                cost = c.motion["modes"] * (len(moving) * (c.motion["intervals"] + 3) + 2 * nodes)
                work = partial(unpack.motion, c.motion, meshes, budget)
                self._once(motn.TYPE, 0, cost, work, c.motion, *moving)

    def _textures(self, c: Container, nets: list[Any], rasters: list[Any]) -> None:
        """Decodes the textures of a container.

        Args:
            c: The container.
            nets: Its networks; None for those that could not be decoded.
            rasters: Its planes, likewise.
        """
        for i, v in enumerate(c.textures):
            if v["coder"] == texr.IMPLICIT:
                sampling = c.layers[i]["sampling"]
                sources = [nets[v["network"]]]
                cost = prod(v["grid"]) * c.networks[v["network"]]["dim"]
                work: Callable[[], Any] = partial(implicit.unpack, v, tuple(nets), "", sampling)
                parts: list[object] = [v, *sources, sampling == 1]
            elif v["coder"] == texr.PYRAMID:
                sources = [rasters[k] for k in texr.planes_of(v)]
                cost = prod(texr.cells_shape(v)) if v["mask"] else 1
                cost += prod(texr.cells_shape(v, "grain")) if v["sources"] else 0
                work = partial(pyramid.unpack, v, rasters, "")
                parts = [v, *sources]
            else:
                continue
            if None not in sources:
                self._once(texr.TYPE, i, cost, work, *parts)

    def keep(self, c: Container, picture: Picture) -> None:
        """Takes over the objects that the chunks of a picture were decoded to."""
        meshes = [picture.layers[v["layer"]].mesh for v in c.meshes]
        pairs = [
            *zip(c.layers, [v.boundary for v in picture.layers], strict=True),
            *zip(c.meshes, meshes, strict=True),
            *zip(c.networks, picture.networks, strict=True),
            *zip(c.planes, picture.planes, strict=True),
        ]
        self._results |= {(id(values),): own for values, own in pairs}
        for v, layer in zip(c.textures, picture.layers, strict=True):
            if v["coder"] == texr.IMPLICIT:
                key = id(v), id(picture.networks[v["network"]]), id(layer.sampling == 1)
                self._results[key] = layer.texture
            elif v["coder"] == texr.PYRAMID:
                sources = (picture.planes[k] for k in texr.planes_of(v))
                self._results[id(v), *map(id, sources)] = layer.texture

    def _once(
        self, type_: str, number: int, cost: int, work: Callable[[], Any], *parts: object
    ) -> Any:
        """Decodes a chunk, unless that was done for the same `parts` before.

        Args:
            type_: Type of the chunk.
            number: Its number among the chunks of that type.
            cost: Number of values in its streams. A history may hold any number of chunks,
                therefore their sum is bounded by `budget`.
            work: Function that decodes the chunk.
            *parts: The values of the chunk, and the objects that it refers to.

        Returns:
            The result of `work`; None if it fails or the budget is spent.
        """
        key = tuple(map(id, parts))
        if key not in self._results:
            self.budget -= cost
            if self.budget < 0:
                return None
            self._results[key] = self._findings.attempt(work, type_, number)
        return self._results[key]


def _mesh(values: Values, budget: Budget) -> Mesh:
    """Decodes a mesh and refines it."""
    own = Mesh({k: v for k, v in values.items() if k != "layer"}, "", budget)
    _ = own.refined
    return own


def _planes(values: Values) -> planes.Planes:
    """Decodes planes, including their latents, which are not kept."""
    own = planes.unpack(values, "")
    latents(own)
    return own


def latents(own: planes.Planes) -> None:
    """Decodes the latents of planes, and drops them.

    Raises:
        FormatError: A stream is corrupt.
    """
    _ = own.latents

"""Content of a parsed file: the checked values of its chunks, without numpy."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from . import texr, undo
from .chunks import Chunk

Values = Mapping[str, Any]
"""Values of one chunk, by the keys of its fields."""


@dataclass(frozen=True)
class Container:
    """A parsed file: the checked values of its chunks by key, in file order.

    Attributes:
        head: Fields of HEAD.
        layers: Fields of each LAYR, back to front.
        networks: Fields of each NETW.
        textures: Fields of each TEXR, one per layer.
        planes: Fields of each PLAN.
        meshes: Fields of each MESH.
        poses: Fields of each POSE.
        tree: Fields of tREE, or None.
        motion: Fields of mOTN, or None.
        history: Steps of uNDO that led to this state, oldest first.
        blocks: Metadata blocks by name: ``icc``, ``exif``, ``xmp``.
        cicp: Fields of cICp, or None.
        info: Fields of iNFO, or None.
        extra: Unknown ancillary chunks.
        sizes: Number of bytes of all chunks of a type together, framing included, by type.
    """

    head: Values
    layers: tuple[Values, ...]
    networks: tuple[Values, ...]
    textures: tuple[Values, ...]
    planes: tuple[Values, ...] = ()
    meshes: tuple[Values, ...] = ()
    poses: tuple[Values, ...] = ()
    tree: Values | None = None
    motion: Values | None = None
    history: tuple[undo.Step, ...] = ()
    blocks: Mapping[str, bytes] = field(default_factory=dict)
    cicp: Values | None = None
    info: Values | None = None
    extra: tuple[Chunk, ...] = ()
    sizes: Mapping[str, int] = field(default_factory=dict)

    def texture_of(self, layer: int) -> Values:
        """Fields of the texture that layer number `layer` shows: its own, or the one it shares."""
        own = self.textures[layer]
        return self.textures[own["texture"]] if own["coder"] == texr.SHARED else own

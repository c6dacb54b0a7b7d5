"""The decoded picture as frozen data without behaviour.

Functions elsewhere turn it into bytes (`codec`) and pixels (`render`), edit it (`edit`) and animate
it (`animate`). A `Layer` has no reference to its `Picture`. Users work with the handles of `api`,
which add methods.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields
from types import MappingProxyType
from typing import Any, Protocol, TypeVar, overload

from .container.chunks import Chunk
from .container.undo import Step
from .errors import UsageError
from .geometry.boundary import Boundary
from .geometry.mesh import Mesh
from .geometry.pose import REST, Pose
from .geometry.track import Timeline, Track
from .texture.implicit import Box
from .texture.network import Network
from .texture.planes import Planes
from .texture.pyramid import PyramidTexture, Texture


class Named(Protocol):
    """Protocol of objects with a name."""

    @property
    def name(self) -> str:
        """Name of the object."""


L_co = TypeVar("L_co", bound=Named, covariant=True)


class Layers(Sequence[L_co]):
    """Sequence of layers, back to front; a layer is addressed by its position or its name."""

    def __init__(self, layers: Iterable[L_co]) -> None:
        self._layers: Sequence[L_co] = tuple(layers)

    @classmethod
    def over(cls, layers: Sequence[L_co]) -> Layers[L_co]:
        """Layers of a sequence that never changes and may make them when they are asked for."""
        made = cls(())
        made._layers = layers
        return made

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Layers):
            return NotImplemented
        return self is other or tuple(self) == tuple(other)

    def __hash__(self) -> int:
        return hash(tuple(layer.name for layer in self))

    def __len__(self) -> int:
        return len(self._layers)

    def __iter__(self) -> Iterator[L_co]:
        return iter(self._layers)

    @overload
    def __getitem__(self, key: int | str) -> L_co: ...

    @overload
    def __getitem__(self, key: slice) -> tuple[L_co, ...]: ...

    def __getitem__(self, key: int | str | slice) -> L_co | tuple[L_co, ...]:
        """Returns the layer at a position or with a name, or the layers of a slice as a tuple.

        Raises:
            UsageError: There is no such layer.
        """
        if isinstance(key, slice):
            return tuple(self._layers[key])
        if isinstance(key, str):
            for layer in self._layers:
                if layer.name == key:
                    return layer
        elif -len(self) <= key < len(self):
            return self._layers[key]
        names = ", ".join(repr(layer.name) for layer in self._layers)
        raise UsageError(f"there is no layer {key!r}; the picture has {names}")


@dataclass(frozen=True, eq=False)
class Layer:
    """One layer.

    Attributes:
        name: Name of the layer, unique in the picture.
        box: Rectangle of the texture at rest: x, y, width, height in canvas pixels.
        boundary: Boundary at rest; None for the whole canvas.
        texture: Codes and the index of their network, or a view of planes.
        mesh: Mesh of proxy nodes, or None.
        sampling: Number of the sampling mode: 0 direct; 1 local and global, 2 local, 3 global
            feature.
        pose: Result of all edits of place, shape and colour.
        parent: Name of the layer or group that the layer moves with, or None.
        track: Motion of the nodes over the timeline of the picture, or None.
    """

    name: str
    box: Box
    boundary: Boundary | None
    texture: Texture
    mesh: Mesh | None = None
    sampling: int = 0
    pose: Pose = REST
    parent: str | None = None
    track: Track | None = None


@dataclass(frozen=True, eq=False)
class Picture:
    """A picture.

    Attributes:
        width: Canvas width in pixels.
        height: Canvas height in pixels.
        channels: Number of texture channels: 3, or 4 if textures may also give alpha.
        opaque: Whether the back layer covers the whole canvas without alpha, so that output has no
            alpha.
        depth: Bits per sample of the original picture, 8 or 16.
        layers: Layers back to front.
        networks: Decoder networks.
        blocks: Metadata blocks ``icc``, ``cicp``, ``exif``, ``xmp``.
        info: Fields of the iNFO chunk (encoder, settings and areas), or None.
        extra: Unknown ancillary chunks, which are carried along.
        groups: Name of the parent group or layer of each group, or None, by the group's name.
        timeline: Timeline that the tracks of layers refer to; None if nothing moves.
        history: Edits that led to this state, oldest first, each with the state before it.
        damage: Descriptions of the damage that was tolerated when the file was read.
        planes: Planes of all rasters that pyramid textures show, in the order of the file. Those
            that are given keep their order; of these, the ones that no texture shows are dropped,
            and others are appended in the order of their first use. So an edit numbers no planes
            anew but those behind some that it drops.
    """

    width: int
    height: int
    channels: int
    opaque: bool
    depth: int
    layers: Layers[Layer]
    networks: tuple[Network, ...]
    blocks: Mapping[str, bytes] = field(default_factory=dict)
    info: Mapping[str, Any] | None = None
    extra: tuple[Chunk, ...] = ()
    groups: Mapping[str, str | None] = field(default_factory=dict)
    timeline: Timeline | None = None
    history: tuple[Step, ...] = ()
    damage: tuple[str, ...] = ()
    planes: tuple[Planes, ...] = ()

    def __post_init__(self) -> None:
        views = (v.texture for v in self.layers if isinstance(v.texture, PyramidTexture))
        shown = dict.fromkeys(source for view in views for source in view.sources)
        known = dict.fromkeys(p for p in self.planes if p in shown)
        object.__setattr__(self, "planes", tuple(known | shown))
        for name in ("blocks", "groups", "info"):
            values = getattr(self, name)
            if values is not None:
                object.__setattr__(self, name, MappingProxyType(dict(values)))
        for layer in self.layers:
            for array in layer.texture.arrays:
                array.flags.writeable = False

    def __reduce__(self) -> tuple[type[Picture], tuple[Any, ...]]:
        values = (getattr(self, f.name) for f in fields(self))
        return Picture, tuple(dict(v) if isinstance(v, MappingProxyType) else v for v in values)

    @property
    def picture(self) -> Picture:
        """This picture itself, so that functions can take a picture or a handle to one."""
        return self

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the canvas in pixels."""
        return self.width, self.height

    def network_of(self, layer: Layer) -> Network | None:
        """Network that decodes the texture of `layer`; None for pyramid textures."""
        number = layer.texture.network
        return None if number is None else self.networks[number]


class Pictured(Protocol):
    """Protocol of a `Picture` and of handles to one, such as `api.Image`."""

    @property
    def picture(self) -> Picture:
        """The picture as data."""

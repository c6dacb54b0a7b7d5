"""The decoded picture as data: frozen values that know nothing of what is done with them.

Bytes (`codec`), pixels (`render`), edits (`edit`) and motion (`animate`) are functions of these; a
`Layer` does not know its `Picture`. What people use is `api`: handles with methods on top.
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
    """Anything with a name."""

    @property
    def name(self) -> str:
        """The name."""


L_co = TypeVar("L_co", bound=Named, covariant=True)


class Layers(Sequence[L_co]):
    """Layers back to front, addressed by position or by name."""

    def __init__(self, layers: Iterable[L_co]) -> None:
        self._layers = tuple(layers)

    def __len__(self) -> int:
        return len(self._layers)

    def __iter__(self) -> Iterator[L_co]:
        return iter(self._layers)

    @overload
    def __getitem__(self, key: int | str) -> L_co: ...

    @overload
    def __getitem__(self, key: slice) -> tuple[L_co, ...]: ...

    def __getitem__(self, key: int | str | slice) -> L_co | tuple[L_co, ...]:
        """The layer at a position or with a name, or the layers of a slice.

        Raises:
            UsageError: There is no such layer.
        """
        if isinstance(key, slice):
            return self._layers[key]
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
        name: Unique in the picture.
        box: x, y, width, height of the texture's rectangle in canvas pixels.
        boundary: Closed paths at rest, or None for the whole canvas.
        texture: Codes and the index of their network, or a view of planes.
        mesh: Proxy nodes, or None.
        sampling: How features are found: 0 direct, 1 to 3 at the proxy nodes.
        pose: What edits have done to it.
        parent: Name of the layer or group that it follows, or None.
        track: How its nodes move over the timeline of the picture, or None.
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
        height: Canvas height.
        channels: 3, or 4 if textures also give alpha.
        opaque: Whether the back layer covers the whole canvas, so that output has no alpha.
        depth: Bits a sample of the original, 8 or 16.
        layers: Layers back to front.
        networks: Decoder networks.
        blocks: Metadata blocks ``icc``, ``exif``, ``xmp``.
        info: Encoder, settings and areas, as in the iNFO chunk, or None.
        extra: Unknown ancillary chunks, carried along.
        groups: Parent of each group of layers, a name or None, by the group's name.
        timeline: When layers that have a track move, or None.
        history: The edits that led here, oldest first, each with the state before it.
        damage: What was wrong with the file it was read from, where that was tolerated.
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

    def __post_init__(self) -> None:
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
        """Itself: functions take whatever has a picture, such as `api.Image`."""
        return self

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the canvas in pixels."""
        return self.width, self.height

    @property
    def planes(self) -> list[Planes]:
        """The planes that textures show, in the order of their first use."""
        views = (v.texture for v in self.layers if isinstance(v.texture, PyramidTexture))
        return list(dict.fromkeys(source for view in views for source in view.sources))

    def network_of(self, layer: Layer) -> Network | None:
        """The network that decodes the texture of one of its layers; None for views of planes."""
        number = layer.texture.network
        return None if number is None else self.networks[number]


class Pictured(Protocol):
    """A `Picture`, or a handle to one, such as `api.Image`."""

    @property
    def picture(self) -> Picture:
        """The picture."""

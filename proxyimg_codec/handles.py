"""Base classes of the handles to pictures and layers: read-only access to their fields.

`api` adds the methods that edit, render and save.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Self, TypeVar, overload

from .container.chunks import Chunk
from .container.undo import Step
from .geometry.boundary import Boundary
from .geometry.mesh import Mesh
from .geometry.pose import Pose
from .geometry.track import Timeline, Track
from .model import Layer, Picture
from .render import neighbours
from .texture.implicit import Box
from .texture.network import Network
from .texture.occlusion import Moved
from .texture.planes import Planes
from .texture.pyramid import Texture

T = TypeVar("T")


class Handle:
    """Something that never changes, so that its copies are itself."""

    __slots__ = ()

    def __copy__(self) -> Self:
        return self

    def __deepcopy__(self, memo: dict[int, Any]) -> Self:
        return self


class PictureHandle(Handle):
    """Handle to a picture, with read-only access to its fields.

    Attributes:
        picture: The picture as data.
    """

    __slots__ = ("__weakref__", "_picture")

    def __init__(self, picture: Picture) -> None:
        self._picture = picture

    @property
    def picture(self) -> Picture:
        """The picture as data."""
        return self._picture

    @property
    def width(self) -> int:
        """Canvas width in pixels."""
        return self._picture.width

    @property
    def height(self) -> int:
        """Canvas height in pixels."""
        return self._picture.height

    @property
    def channels(self) -> int:
        """Number of texture channels: 3, or 4 if textures may also give alpha."""
        return self._picture.channels

    @property
    def opaque(self) -> bool:
        """Whether the back layer covers the canvas without alpha, so that output has no alpha."""
        return self._picture.opaque

    @property
    def depth(self) -> int:
        """Bits per sample of the original picture, 8 or 16."""
        return self._picture.depth

    @property
    def networks(self) -> tuple[Network, ...]:
        """Decoder networks of the file."""
        return self._picture.networks

    @property
    def blocks(self) -> Mapping[str, bytes]:
        """Metadata blocks ``icc``, ``cicp``, ``exif``, ``xmp``."""
        return self._picture.blocks

    @property
    def info(self) -> Mapping[str, Any] | None:
        """Fields of the iNFO chunk: encoder, settings and areas; None if there is no such chunk."""
        return self._picture.info

    @property
    def extra(self) -> tuple[Chunk, ...]:
        """Unknown ancillary chunks, which are carried along."""
        return self._picture.extra

    @property
    def groups(self) -> Mapping[str, str | None]:
        """Groups of layers: the name of the parent group or layer, or None, by the group's name."""
        return self._picture.groups

    @property
    def timeline(self) -> Timeline | None:
        """Timeline that the tracks of layers refer to; None if the picture has no motion."""
        return self._picture.timeline

    @property
    def history(self) -> tuple[Step, ...]:
        """Edits that led to this state, oldest first, each with the state before it."""
        return self._picture.history

    @property
    def damage(self) -> tuple[str, ...]:
        """Damage that was tolerated when the file was read, one sentence each."""
        return self._picture.damage

    @property
    def planes(self) -> tuple[Planes, ...]:
        """Planes of all rasters that pyramid textures show, in the order of the file."""
        return self._picture.planes


class LayerHandle(Handle):
    """Handle to a layer, given by its picture and position, with read-only access to its fields.

    Attributes:
        position: Position of the layer in the picture, counted from the back, from 0.
    """

    __slots__ = ("__weakref__", "_picture", "_position")

    def __init__(self, picture: Picture, position: int) -> None:
        picture.layers[position]  # it exists
        self._picture = picture
        self._position = position % len(picture.layers)

    @property
    def position(self) -> int:
        """Position of the layer in the picture, counted from the back, from 0."""
        return self._position

    @property
    def data(self) -> Layer:
        """The layer as data."""
        return self._picture.layers[self.position]

    @property
    def name(self) -> str:
        """Name of the layer, unique in the picture."""
        return self.data.name

    @property
    def box(self) -> Box:
        """Rectangle of the texture at rest: x, y, width, height in canvas pixels."""
        return self.data.box

    @property
    def boundary(self) -> Boundary | None:
        """Boundary of the layer at rest; None for the whole canvas."""
        return self.data.boundary

    @property
    def outline(self) -> Boundary | None:
        """Boundary in its present place, after the pose; None for the whole canvas."""
        return neighbours.present_outline(self._picture, self.data)

    @property
    def texture(self) -> Texture:
        """Texture: codes and the index of their network, or a view of planes."""
        return self.data.texture

    @property
    def network(self) -> Network | None:
        """Decoder network of the texture; None for pyramid textures."""
        return self._picture.network_of(self.data)

    @property
    def mesh(self) -> Mesh | None:
        """Mesh of proxy nodes; None if the layer has none."""
        return self.data.mesh

    @property
    def sampling(self) -> int:
        """Number of the sampling mode: 0 direct; 1 local and global, 2 local, 3 global feature."""
        return self.data.sampling

    @property
    def pose(self) -> Pose:
        """Pose of the layer: the result of all edits of its place, shape and colour."""
        return self.data.pose

    @property
    def parent(self) -> str | None:
        """Name of the layer or group that the layer moves with; None if there is none."""
        return self.data.parent

    @property
    def track(self) -> Track | None:
        """Motion of the nodes over the timeline of the picture; None if the layer does not move."""
        return self.data.track

    @property
    def moved_neighbours(self) -> Moved:
        """Layers and boundaries that have moved relative to this layer since its view was cut."""
        return neighbours.moved_neighbours(self._picture, self.data)


class MadeOnce(Sequence[T]):
    """A sequence whose items are made when they are first asked for.

    Args:
        count: Number of items.
        make: Makes the item of an owner at a position.
        owner: The owner.
    """

    def __init__(self, count: int, make: Callable[[Any, int], T], owner: Any) -> None:
        self._count, self._make, self._owner = count, make, owner
        self._made: dict[int, T] = {}

    def __len__(self) -> int:
        return self._count

    @overload
    def __getitem__(self, key: int) -> T: ...

    @overload
    def __getitem__(self, key: slice) -> tuple[T, ...]: ...

    def __getitem__(self, key: int | slice) -> T | tuple[T, ...]:
        """Returns the item at a position, or those of a slice."""
        place = range(self._count)[key]
        if isinstance(place, range):
            return tuple(self[k] for k in place)
        if place not in self._made:
            self._made[place] = self._make(self._owner, place)
        return self._made[place]

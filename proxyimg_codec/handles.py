"""Handles: what they show of the pictures and layers that they stand for.

`api` adds what can be done with these.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

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


class PictureHandle:
    """A handle to a picture, which shows its fields.

    Attributes:
        picture: The picture as data.
    """

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
        """3, or 4 if textures also give alpha."""
        return self._picture.channels

    @property
    def opaque(self) -> bool:
        """Whether the back layer covers the whole canvas, so that output has no alpha."""
        return self._picture.opaque

    @property
    def depth(self) -> int:
        """Bits a sample of the original, 8 or 16."""
        return self._picture.depth

    @property
    def networks(self) -> tuple[Network, ...]:
        """Decoder networks of the file."""
        return self._picture.networks

    @property
    def blocks(self) -> Mapping[str, bytes]:
        """Metadata blocks ``icc``, ``exif``, ``xmp``."""
        return self._picture.blocks

    @property
    def info(self) -> Mapping[str, Any] | None:
        """Encoder, settings and areas, as in the iNFO chunk, or None."""
        return self._picture.info

    @property
    def extra(self) -> tuple[Chunk, ...]:
        """Unknown ancillary chunks, carried along."""
        return self._picture.extra

    @property
    def groups(self) -> Mapping[str, str | None]:
        """Parent of each group of layers, a name or None, by the group's name."""
        return self._picture.groups

    @property
    def timeline(self) -> Timeline | None:
        """When layers that have a track move, or None."""
        return self._picture.timeline

    @property
    def history(self) -> tuple[Step, ...]:
        """The edits that led here, oldest first, each with the state before it."""
        return self._picture.history

    @property
    def damage(self) -> tuple[str, ...]:
        """What was wrong with the file it was read from, where that was tolerated."""
        return self._picture.damage

    @property
    def planes(self) -> list[Planes]:
        """The planes that textures show, in the order of their first use."""
        return self._picture.planes


class LayerHandle:
    """A handle to a layer: a picture and a position in it. It shows the fields of the layer.

    Attributes:
        position: Its place in the picture, counted from the back.
    """

    def __init__(self, picture: Picture, position: int) -> None:
        self._picture = picture
        self._position = position

    @property
    def position(self) -> int:
        """Its place in the picture, counted from the back."""
        return self._position

    @property
    def data(self) -> Layer:
        """The layer as data."""
        return self._picture.layers[self.position]

    @property
    def name(self) -> str:
        """The name, unique in the picture."""
        return self.data.name

    @property
    def box(self) -> Box:
        """x, y, width, height of the texture's rectangle in canvas pixels."""
        return self.data.box

    @property
    def boundary(self) -> Boundary | None:
        """Closed paths at rest, or None for the whole canvas."""
        return self.data.boundary

    @property
    def outline(self) -> Boundary | None:
        """The boundary in its present place; None for the whole canvas."""
        return neighbours.present_outline(self._picture, self.data)

    @property
    def texture(self) -> Texture:
        """Codes and the index of their network, or a view of planes."""
        return self.data.texture

    @property
    def network(self) -> Network | None:
        """What decodes its texture; None where that is no network of the file."""
        return self._picture.network_of(self.data)

    @property
    def mesh(self) -> Mesh | None:
        """Proxy nodes, or None."""
        return self.data.mesh

    @property
    def sampling(self) -> int:
        """How features are found: 0 direct, 1 to 3 at the proxy nodes."""
        return self.data.sampling

    @property
    def pose(self) -> Pose:
        """What edits have done to it."""
        return self.data.pose

    @property
    def parent(self) -> str | None:
        """Name of the layer or group that it follows, or None."""
        return self.data.parent

    @property
    def track(self) -> Track | None:
        """How its nodes move over the timeline of the picture, or None."""
        return self.data.track

    @property
    def moved_neighbours(self) -> Moved:
        """What no longer lies to it as it did when the samples of its view were mixed."""
        return neighbours.moved_neighbours(self._picture, self.data)

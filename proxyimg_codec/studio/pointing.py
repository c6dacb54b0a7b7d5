"""Layers of a raster that are being found: regions, and what was pointed at to make them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..encoder.shapes.contours import trace
from ..encoder.shapes.external_models.locate import first_here
from ..encoder.shapes.find import PROMPTER, find_layers, with_objects
from ..encoder.shapes.masks import NAME_MAX, Region, is_back, resolve, visible
from ..encoder.shapes.pointing import point_in, scene_in
from ..encoder.shapes.pointing_scene import Scene
from ..encoder.shapes.prompts import Box, Point, Prompt, checked
from ..errors import UsageError
from ..io.raster import Picture as Raster
from ..io.samples import to_float
from .strokes import painted

Mask = NDArray[np.bool_]

SLIVER = 0.03
"""Share of a region that must be seen, or it goes when others are put in front of it."""

SPECK = 12.0
"""Area in pixels below which a part of a region has no outline in the page."""


@dataclass(frozen=True, eq=False)
class Hints:
    """Hints of a user to one object; `mask` is what was there before the first of them."""

    inside: tuple[Point, ...] = ()
    outside: tuple[Point, ...] = ()
    box: Box | None = None
    strokes: Mask | None = None
    mask: Mask | None = None


@dataclass(frozen=True, eq=False)
class Pointing:
    """Raster and its regions, back to front. It never changes: every request makes another one.

    Attributes:
        raster: The picture as it was opened.
        regions: Regions, of which the first is the back, or `rest`.
        hints: Hints by the name of their region.
        found: Whether a segmenter has looked for regions already.
        scenes: Scene of the raster for the built-in prompter, when it was needed.
    """

    raster: Raster
    regions: tuple[Region, ...]
    hints: Mapping[str, Hints] = field(default_factory=dict)
    found: bool = False
    scenes: list[Scene] = field(default_factory=list)

    @classmethod
    def of(cls, raster: Raster) -> Pointing:
        """A raster that is one layer as yet."""
        whole = np.ones(raster.pixels.shape[:2], bool)
        return cls(raster, (Region("back", whole),))

    @property
    def size(self) -> tuple[int, int]:
        """Width and height in pixels."""
        height, width = self.raster.pixels.shape[:2]
        return width, height

    @property
    def opaque(self) -> bool:
        """Whether the first region is the back, which covers what no other has."""
        return bool((self._floats()[..., 3] == 1).all())

    def searched(self, max_layers: int, jobs: int) -> Pointing:
        """Returns the regions that the built-in segmenter finds.

        Raises:
            PxiError: As `encoder.shapes.find.find_layers`.
        """
        regions = find_layers(self.raster.pixels, max_layers=max_layers, jobs=jobs)
        return replace(self, regions=tuple(regions) or self.regions, hints={}, found=True)

    def pointed(self, name: str | None, hints: Hints, jobs: int) -> Pointing:
        """Returns regions of which one follows more hints; `name` None makes a new one.

        Raises:
            PxiError: As `encoder.shapes.find.with_objects`, or the name is not one.
        """
        name = self._free("object") if name is None else _checked(name)
        if is_back(name):
            raise UsageError(f'"{name}" is what no object holds; point at the object instead')
        old = self.hints.get(name)
        known = self._found(name)
        if old is None:
            old = Hints(mask=None if known is None else known.mask)
        strokes = [v for v in (old.strokes, hints.strokes) if v is not None]
        told = Hints(
            (*old.inside, *hints.inside), (*old.outside, *hints.outside),
            hints.box if hints.box is not None else old.box,
            np.logical_or.reduce(strokes) if strokes else None, old.mask,
        )  # fmt: skip
        prompt = Prompt(name, told.inside, told.outside, told.box, told.strokes, told.mask)
        region = self._prompted(prompt, jobs)
        if known is None:
            stack = [*self.regions, region]
        else:
            stack = [region if v is known else v for v in self.regions]
        return replace(self, hints={**self.hints, name: told})._stacked(stack, kept=name)

    def _prompted(self, prompt: Prompt, jobs: int) -> Region:
        """Region that a prompt finds, whatever regions there are."""
        if prompter() != PROMPTER:
            found = with_objects(self._floats(), [], [prompt], jobs=jobs)
            return next(v for v in found if v.name == prompt.name)
        width, height = self.size
        told = checked([prompt], height, width)
        self.prepare(jobs)
        return point_in(self.scenes[0], self._rgb(), told)[0]

    def prepare(self, jobs: int) -> None:
        """Makes the scene, if it is needed: most of the work, and the same for each click."""
        if not self.scenes and prompter() == PROMPTER:
            self.scenes.append(scene_in(self._rgb(), jobs))

    def _rgb(self) -> NDArray[np.uint8]:
        return np.rint(self._floats()[..., :3] * 255).astype(np.uint8)

    def split(self, name: str, hints: Hints, to: str | None, jobs: int) -> Pointing:
        """Returns regions with a new one just in front of another, made of a part of that.

        Raises:
            PxiError: As `pointed`, or nothing of the region is there.
        """
        whole = self._region(name)
        new = self._free(to or f"{name}/part")
        prompt = Prompt(new, hints.inside, hints.outside, hints.box, hints.strokes)
        inside = self._prompted(prompt, jobs).mask & whole.mask
        if not inside.any():
            raise UsageError(f'nothing of "{name}" is there; point at a part of it')
        if (inside == whole.mask).all():
            raise UsageError(f'this is all of "{name}"; also say what is outside of the part')
        rest = list(self.regions)
        at = next(k for k, v in enumerate(rest) if v.name == name)
        rest.insert(at + 1, Region(new, inside))
        told = {**self.hints, new: replace(hints, mask=inside)}
        return replace(self, hints=told)._stacked(rest, kept=name)

    def painted(
        self, name: str, strokes: Sequence[Sequence[Point]], radius: float, erase: bool
    ) -> Pointing:
        """Returns regions of which one has more pixels, or fewer: exactly those of the strokes.

        Raises:
            PxiError: There is no such region, or nothing would be left of one.
        """
        region = self._region(name)
        brush = painted(strokes, radius, self.size)
        mask = region.mask & ~brush if erase else region.mask | brush
        if not erase:  # what is painted is to be seen
            above = self.regions[self.regions.index(region) + 1 :]
            others = {v.name: replace(v, mask=v.mask & ~brush) for v in above}
        else:
            others = {}
        changed = [others.get(v.name, v) for v in self.regions]
        changed[self.regions.index(region)] = Region(name, mask)
        return self._stacked(changed, without=name, kept=name)

    def renamed(self, name: str, to: str) -> Pointing:
        """Returns regions of which one has another name.

        Raises:
            UsageError: There is no such region, or the name is taken or not one.
        """
        region = self._region(name)
        if to != name and self._found(_checked(to)) is not None:
            raise UsageError(f'there is a region "{to}" already')
        regions = [replace(v, name=to) if v is region else v for v in self.regions]
        hints = {to if k == name else k: v for k, v in self.hints.items()}
        return replace(self, regions=tuple(regions), hints=hints)

    def removed(self, name: str) -> Pointing:
        """Returns regions without one, whose pixels go to what lies behind.

        Raises:
            UsageError: There is no such region, or it is the back.
        """
        region = self._object(name)
        return self._stacked([v for v in self.regions if v is not region], without=name)

    def merged(self, name: str, other: str) -> Pointing:
        """Returns regions of which `other` has become a part of `name`.

        Raises:
            UsageError: There are no such two regions.
        """
        one, two = self._region(name), self._object(other)
        if one is two:
            raise UsageError(f'"{name}" is given twice; name two regions')
        whole = Region(name, one.mask | two.mask)
        rest = [whole if v is one else v for v in self.regions if v is not two]
        return self._stacked(rest, without=name)

    def ordered(self, name: str, to: int) -> Pointing:
        """Returns regions of which one is at position `to` from the back.

        Raises:
            UsageError: There is no such region or position.
        """
        region, first = self._object(name), int(self.opaque)
        rest = [v for v in self.regions if v is not region]
        if not first <= to <= len(rest):
            raise UsageError(f"to: {to} is not within {first}..{len(rest)}")
        rest.insert(to, region)
        return self._stacked(rest, kept=name)

    def described(self) -> list[dict[str, Any]]:
        """Regions as JSON values, see `README.md`."""
        seen = visible(self.regions)
        found = [
            _described(k, region, mask, self.hints.get(region.name))
            for k, (region, mask) in enumerate(zip(self.regions, seen, strict=True))
        ]
        found[0]["back"] = self.opaque
        return found

    def save_masks(self, folder: Path) -> None:
        """Writes the regions as the folder of masks that pxi-encode takes."""
        from PIL import Image

        for k, region in enumerate(self.regions):
            place = folder / f"{k:02d} {region.name}.png"
            place.parent.mkdir(parents=True, exist_ok=True)
            Image.fromarray(region.mask.astype(np.uint8) * 255).save(place)

    def _floats(self) -> NDArray[np.float32]:
        return np.asarray(to_float(self.raster.pixels)[0])

    def _stacked(
        self, regions: Sequence[Region], without: str | None = None, kept: str | None = None
    ) -> Pointing:
        """Pointing with other regions, which are completed to a stack.

        Regions of which others leave nothing to see, or a sliver, go.

        Args:
            regions: Regions back to front.
            without: Name of a region whose hints go.
            kept: Name of a region that stays, whatever there is to see of it.
        """
        width, height = self.size
        support = None if self.opaque else self._floats()[..., 3] >= 0.5
        seen = zip(regions, visible(regions), strict=True)
        there = [
            v for k, (v, mask) in enumerate(seen)
            if v.name == kept or (k == 0 and mask.any()) or mask.sum() > SLIVER * v.mask.sum()
        ]  # fmt: skip
        stack = resolve(there, height, width, support)
        names = {v.name for v in stack} - {without}
        hints = {k: v for k, v in self.hints.items() if k in names}
        return replace(self, regions=tuple(stack), hints=hints)

    def _found(self, name: str) -> Region | None:
        return next((v for v in self.regions if v.name == name), None)

    def _region(self, name: Any) -> Region:
        found = self._found(name) if isinstance(name, str) else None
        if found is None:
            there = ", ".join(f'"{v.name}"' for v in self.regions)
            raise UsageError(f"there is no region {name!r}; there are {there}")
        return found

    def _object(self, name: Any) -> Region:
        found = self._region(name)
        if found is self.regions[0] and self.opaque:
            raise UsageError(f'"{name}" is the back, which stays behind all')
        return found

    def _free(self, wanted: str) -> str:
        name, number = _checked(wanted), 2
        while self._found(name) is not None:
            name, number = f"{wanted} {number}", number + 1
        return name


def prompter() -> str:
    """Name of who finds what is pointed at: ``sam`` where there are weights, or ``maps``."""
    return "sam" if first_here("sam") else PROMPTER


def _checked(name: Any) -> str:
    """Name of a region that can also be the name of a mask file.

    Raises:
        UsageError: It cannot.
    """
    good = isinstance(name, str) and 1 <= len(name) <= NAME_MAX and name.isprintable()
    if not good or any(part.strip(". ") != part or not part for part in name.split("/")):
        raise UsageError(
            f"name {name!r}: must be 1..{NAME_MAX} printable characters, and parts between "
            "slashes neither empty nor with dots or spaces at their ends"
        )
    return str(name)


def _described(k: int, region: Region, mask: Mask, hints: Hints | None) -> dict[str, Any]:
    rows, columns = np.flatnonzero(mask.any(1)), np.flatnonzero(mask.any(0))
    told = hints or Hints()
    return {
        "index": k, "name": region.name, "back": False, "area": int(mask.sum()),
        "bounds": [int(columns[0]), int(rows[0]), int(columns[-1]) + 1, int(rows[-1]) + 1],
        "outline": [_smoothed(loop) for loop in trace(mask, SPECK)],
        "prompt": {"inside": told.inside, "outside": told.outside, "box": told.box},
    }  # fmt: skip


def _smoothed(loop: NDArray[np.float64]) -> list[float]:
    """Middles of the sides of a loop along pixels, x and y in turn: stairs become slopes."""
    middles = (loop + np.roll(loop, -1, 0)) / 2
    long = np.abs(np.roll(loop, -1, 0) - loop).max(1) > 2
    ends = np.stack([loop, middles], 1)
    keep = np.stack([long | np.roll(long, 1), ~long], 1)
    return [float(v) for v in ends[keep].ravel()]

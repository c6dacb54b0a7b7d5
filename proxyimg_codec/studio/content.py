"""Content of a session: nothing, a raster whose layers are being found, or a document."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path, PurePath
from typing import Any

from ..codec.write import to_bytes
from ..encoder.encode import Progress, encode
from ..encoder.import_layers import encode_layered
from ..encoder.layered.openraster import is_openraster, read_openraster
from ..encoder.layered.photoshop import has_reader, is_photoshop, read_photoshop
from ..encoder.layered.source import LayeredPicture
from ..encoder.settings import BACKGROUNDS, Settings
from ..errors import UsageError
from ..io import raster
from ..limits import DEFAULT_LIMITS, Limits
from .document import Document
from .jobs import Job
from .pointing import Pointing

PAST_MAX = 100
"""Most states of regions that can be undone."""

FOUND = 4
"""Most layers that are looked for in a raster that is opened."""

SETTINGS = ("quality", "effort", "target_size", "target_bpp", "target_psnr", "tune", "texture",
            "background", "matte", "seed")  # fmt: skip
"""Settings of the encoder that a page may choose."""


@dataclass(frozen=True, eq=False)
class Content:
    """Everything that a session holds. It never changes: requests make others.

    Attributes:
        file: Name of the file that was opened, or "".
        path: Absolute path of that file; None if it was sent by the page.
        pointing: Raster and regions, if a raster was opened.
        past: Earlier states of `pointing`, oldest first.
        future: States of `pointing` that were undone, the next one last.
        settings: Settings that the raster was encoded with.
        document: Picture that is edited, or None.
        base: Number of edits in the history when the document was opened or encoded.
        kept: Number of them that are still the same.
        recovered: Whether this comes from a session that broke off.
    """

    file: str = ""
    path: str | None = None
    pointing: Pointing | None = None
    past: tuple[Pointing, ...] = ()
    future: tuple[Pointing, ...] = ()
    settings: Mapping[str, Any] | None = None
    document: Document | None = None
    base: int = 0
    kept: int = 0
    recovered: bool = False

    @property
    def stage(self) -> str:
        """Stage: ``empty``, ``pointing`` or ``editing``."""
        if self.document is not None:
            return "editing"
        return "empty" if self.pointing is None else "pointing"

    @property
    def name(self) -> str:
        """Name of the picture without suffix."""
        return PurePath(self.file).stem or "picture"

    def is_new(self, before: Content) -> bool:
        """Whether this has a raster that another content does not have."""
        there = None if before.pointing is None else before.pointing.raster
        return self.pointing is not None and self.pointing.raster is not there

    @property
    def edited(self) -> Document:
        """The document.

        Raises:
            UsageError: There is none.
        """
        if self.document is None:
            raise UsageError("no picture is being edited; open one, and encode it")
        return self.document

    @property
    def pointed(self) -> Pointing:
        """The raster whose layers are being found.

        Raises:
            UsageError: There is none.
        """
        if self.pointing is None or self.document is not None:
            raise UsageError("no raster is open whose layers are being found")
        return self.pointing

    def with_regions(self, pointing: Pointing) -> Content:
        """Returns the content with other regions, of which the present ones are the past."""
        if pointing is self.pointing:
            return self
        past = (*self.past, self.pointed)[-PAST_MAX:]
        return replace(self, pointing=pointing, past=past, future=())

    def first_found(self, jobs: int) -> Content:
        """Returns the content with the regions that are found first, which cannot be undone.

        Raises:
            PxiError: As `Pointing.searched`.
        """
        return replace(self, pointing=self.pointed.searched(FOUND, jobs))

    def regions_undone(self) -> Content:
        """Returns the content with the regions before the last change.

        Raises:
            UsageError: There is no such change.
        """
        if not self.past:
            raise UsageError("there is nothing to undo")
        *past, before = self.past
        future = (*self.future, self.pointed)
        return replace(self, pointing=before, past=tuple(past), future=future)

    def regions_redone(self) -> Content:
        """Returns the content with the change of regions that was undone last.

        Raises:
            UsageError: There is no such change.
        """
        if not self.future:
            raise UsageError("there is nothing to redo")
        *future, after = self.future
        past = (*self.past, self.pointed)
        return replace(self, pointing=after, past=past, future=tuple(future))

    def with_edits(self, edits: Sequence[Any], folder: Path, files: Collection[str]) -> Content:
        """Returns the content after edits.

        Raises:
            PxiError: As `Document.edited`.
        """
        document = self.edited.edited(edits, folder, files)
        kept = min(self.kept, self.edited.at) if document is not self.document else self.kept
        return replace(self, document=document, kept=kept)

    def encoded(self, asked: Mapping[str, Any], jobs: int, job: Job) -> Content:
        """Returns the content with a document that is made of the regions.

        Raises:
            PxiError: A setting is unknown or out of range, or the encoder fails.
        """
        pointing, settings = self.pointed, settings_of(asked, jobs)
        picture = encode(
            pointing.raster.pixels, settings, masks=list(pointing.regions),
            blocks=pointing.raster.blocks, progress=reporting(job),
        )  # fmt: skip
        job.check()
        # What is edited is what a reader of the file has.
        document = Document.parsed(to_bytes(picture), DEFAULT_LIMITS)
        return replace(self, document=document, settings=dict(asked), base=0, kept=0)

    def reopened(self) -> Content:
        """Returns the content with the raster whose document is given up.

        Raises:
            UsageError: The document does not come from a raster.
        """
        if self.pointing is None:
            raise UsageError("this picture was not made of a raster here")
        return replace(self, document=None)


def settings_of(asked: Mapping[str, Any], jobs: int) -> Settings:
    """Settings of the encoder that a page asks for.

    Raises:
        UsageError: One is unknown or out of range.
    """
    for key in asked:
        if key not in SETTINGS:
            raise UsageError(f"setting {key!r} is unknown; there are {', '.join(SETTINGS)}")
    if asked.get("background", "auto") not in BACKGROUNDS:
        raise UsageError(f"background: must be one of {', '.join(BACKGROUNDS)}")
    return Settings(**{"effort": 2, **asked}, jobs=jobs)


def reporting(job: Job) -> Progress:
    """Progress callback of the encoder that reports to a job."""

    def report(stage: str, done: int, total: int) -> None:
        job.report(stage, done, max(total, 1))

    return report


def is_layered(data: bytes, name: str) -> bool:
    """Whether a file has layers of its own that can be read here."""
    if is_openraster(data) or name.lower().endswith(".ora"):
        return True
    return is_photoshop(data) and has_reader()


def _layered(data: bytes, name: str) -> LayeredPicture | None:
    if not is_layered(data, name):
        return None
    return read_photoshop(data, name) if is_photoshop(data) else read_openraster(data, name)


def opened(data: bytes, name: str, limits: Limits, jobs: int, job: Job) -> Content:
    """Content of a file.

    Args:
        data: Bytes of the file.
        name: Name of the file.
        limits: Bounds on what it may ask for.
        jobs: Threads to use.
        job: Job that is told of progress.

    Raises:
        PxiError: It cannot be read, or is too large.
    """
    limits.check("file_bytes", len(data))
    if name.lower().endswith(".pxi"):
        document = Document.parsed(data, limits)
        return Content(name, document=document, base=document.count, kept=document.count)
    layered = _layered(data, name)
    if layered is not None:
        limits.check("output_pixels", layered.width * layered.height)
        picture, _ = encode_layered(layered, Settings(effort=2, jobs=jobs), reporting(job))
        return Content(name, document=Document.parsed(to_bytes(picture), limits))
    picture_file = raster.parse(data, name)
    height, width = picture_file.pixels.shape[:2]
    limits.check("output_pixels", width * height)
    limits.check("side", max(width, height))
    return Content(name, pointing=Pointing.of(picture_file))

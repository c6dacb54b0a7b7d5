"""Guides by the names that users give: a folder of a pipeline, a denoiser, a picture, a plug-in."""

from __future__ import annotations

from pathlib import Path

from .. import plugins
from ..errors import InputError, UsageError
from .diffusers_guide import pipeline_guide
from .guide import INDEX, Guide, Wishes, device_of
from .picture_guide import picture_guide
from .pixel_guide import denoiser_guide
from .settings import Settings


def guide_for(wishes: Wishes) -> Guide:
    """Guide that settings name.

    Raises:
        UsageError: There is no such file or plug-in, or the prompt is empty or not understood.
        InputError: The folder or file holds no model of a known kind.
        UnsupportedError: A package or a device that it needs is not there.
    """
    device_of(wishes.run)
    text = wishes.settings.guide
    path = Path(text)
    if not path.exists():
        if path.suffix or path.name != text:
            raise UsageError(f"generate: there is no guide {text!r}")
        _needs_words(wishes.settings)
        made: Guide = plugins.find("guides", text)(wishes)
        return made
    if path.is_dir():
        if not (path / INDEX).is_file():
            raise InputError(f"{text}: holds no pipeline: there is no {INDEX} in it")
        _needs_words(wishes.settings)
        return pipeline_guide(path, wishes)
    if is_denoiser(path):
        _needs_words(wishes.settings)
        return denoiser_guide(path, wishes)
    return picture_guide(path)


def is_denoiser(path: Path) -> bool:
    """Whether a file is one that torch wrote, which is a ZIP archive.

    Raises:
        InputError: It cannot be read.
    """
    try:
        with path.open("rb") as file:
            return file.read(4) == b"PK\x03\x04"
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from None


def _needs_words(settings: Settings) -> None:
    if not settings.prompt.strip():
        raise UsageError("generate: the prompt is empty; only a picture as guide needs no words")

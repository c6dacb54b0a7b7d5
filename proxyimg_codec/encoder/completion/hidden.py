"""Hidden samples of views: which of them are completed, and from what."""

from __future__ import annotations

import numpy as np

from ...texture.completion import FILL_ONE, Copies
from ...texture.network import Floats
from ...texture.occlusion import Occlusion, Samples
from ...texture.pyramid import PyramidTexture
from ..settings import Settings
from .references import references

OPAQUE = 0.99
"""Least alpha of samples that are copied."""


def copies_of(
    picture: Floats, cuts: Occlusion | None, settings: Settings, soft: Samples | None = None
) -> Copies | None:
    """Chooses what the hidden samples of a view copy: those of its own shape that others cover.

    Args:
        picture: float32 [H, W, 4] in 0..1 with straight alpha.
        cuts: Cuts of the view; None if nothing cuts it.
        settings: Settings of the encoder, for `background` and the seed.
        soft: bool [height, width], True for samples of the view that have a matte, and so colours
            of their own; or None.

    Returns:
        The references, or None if a smooth fill is wanted or as good, or nothing can be copied.
    """
    if cuts is None or not cuts.fronts or settings.background in ("smooth", "complete", "none"):
        return None
    x, y, width, height = cuts.box
    part = picture[y : y + height, x : x + width]
    known, wanted = hidden_in(cuts)
    if soft is not None:
        known, wanted = known & ~soft, wanted & ~soft
    colours = np.ascontiguousarray(part[..., :3] * np.float32(255))
    always = settings.background == "exemplar"
    return references(colours, known & (part[..., 3] >= OPAQUE), wanted, settings.seed, always)


def copies_of_texture(texture: PyramidTexture) -> Copies | None:
    """Chooses what the hidden samples of a texture copy, from what its planes have.

    Args:
        texture: A texture of which not all samples show.

    Returns:
        As `copies_of`.
    """
    if texture.cuts is not None:
        trusted, wanted = hidden_in(texture.cuts)
    else:
        assert texture.shown is not None, "nothing is hidden"
        trusted, wanted = texture.shown, ~texture.shown
    values, known = texture.known(trusted & ~texture.soft)
    samples = np.moveaxis(values, 0, 2) / np.float32(FILL_ONE)
    colours = samples[..., :-1] if texture.alpha is not None else samples
    alpha = samples[..., -1] if texture.alpha is not None else np.ones(known.shape)
    rgb = np.ascontiguousarray(
        np.broadcast_to(colours, (*known.shape, 3)) * np.float32(255), np.float32
    )
    return references(rgb, known & (alpha >= OPAQUE), wanted & ~known, seed=0)


def hidden_in(cuts: Occlusion) -> tuple[Samples, Samples]:
    """Finds what is hidden of a view: the samples of its shape that others cover or are mixed into.

    Args:
        cuts: Cuts of the view.

    Returns:
        bool [height, width], True for samples that may be copied; and likewise for hidden ones.
    """
    bare = Occlusion(None, cuts.fronts, cuts.box)
    inside = Occlusion(cuts.own, (), cuts.box).shown
    known = cuts.trusted & bare.trusted
    return known, inside & ~bare.trusted & ~known

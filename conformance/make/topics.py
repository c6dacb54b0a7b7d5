"""Topics of valid cases: names for sets of statements that a decoder breaks together."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping

ID = re.compile(r"[A-Z]{3}-[1-9][0-9]*")
"""Pattern of the ids of statements of the specification."""


def _run(prefix: str, first: int, last: int) -> str:
    """Ids with the numbers `first`..`last`, separated by spaces."""
    return " ".join(f"{prefix}-{k}" for k in range(first, last + 1))


_TOPICS = {
    # Container and chunks.
    "file": f"CON-1 CON-5 CON-6 CON-11 {_run('CON', 13, 16)} CHK-1 CHK-4",
    "file: version": "CON-3 CON-4",
    "fields: maps": "CON-17",
    "chunks: ancillary": "CON-8 CON-9 CON-12",
    "chunks: metadata": "CON-9 CHK-16 CHK-17 MET-8",
    # Entropy coding.
    "entropy": f"{_run('ENT', 1, 3)} ENT-5 ENT-6 ENT-8 {_run('ENT', 11, 13)}",
    "entropy: masks": "ENT-10",
    "entropy: halving of counts": "ENT-14",
    "entropy: lanes": "ENT-3 ENT-9",
    # Boundaries and coverage.
    "boundary: coding": "GEO-1 GEO-3 GEO-4 GEO-5 ENT-17 ENT-18",
    "boundary: escape": "ENT-17 ENT-18",
    "boundary: unit": "GEO-2",
    "coverage: border": "GEO-12 GEO-13",
    "coverage: clamping": "GEO-14",
    "coverage: components": "GEO-1 GEO-3",
    "coverage: curves": "GEO-8 GEO-9",
    "coverage: edges": f"{_run('GEO', 10, 13)} REN-5",
    "coverage: hole": "GEO-14",
    "coverage: nonzero": "GEO-14",
    "coverage: none": "GEO-15 CHK-8",
    "coverage: outside the canvas": "GEO-10 GEO-13",
    "coverage: scaling": "GEO-7 REN-4",
    # Meshes.
    "mesh: connectivity": f"{_run('MSH', 1, 8)}",
    "mesh: far vertices": "MSH-3",
    "mesh: parts": "MSH-5 MSH-9",
    "mesh: residuals": "MSH-4",
    "mesh: refinement": "MSH-10 MSH-11 MSH-13",
    "mesh: midpoints": "MSH-12",
    "mesh: closing": "MSH-14",
    "mesh: folds": "MSH-15 MSH-31",
    "mesh: overlap": "MSH-15 MSH-31",
    "mesh: faces without area": "MSH-31",
    "mesh: at rest": "CHK-9 MSH-30",
    # Poses.
    "pose: displacements": "MSH-17 MSH-18 MSH-21 MSH-32",
    "pose: texture displacements": "MSH-17 MSH-18 MSH-22 MSH-32",
    "pose: affine": "MSH-16 MSH-20 MSH-24 MSH-30",
    "pose: order": "MSH-21 MSH-29",
    "pose: beyond the mesh": "MSH-31 MSH-32 MSH-33",
    "pose: colour matrix": "MSH-34 REN-6",
    "pose: opacity": "MSH-35 REN-6",
    "pose: hidden": "REN-9 REN-10",
    "outline: riding": "MSH-23 MSH-26 MSH-27 MSH-28 MSH-29",
    "outline: pieces": "MSH-25",
    "outline: weights": "MSH-26 MSH-28",
    "outline: clamping": "MSH-20",
    "outline: the whole canvas": "MSH-23",
    # Implicit textures.
    "texture: bilinear": "TEX-2 TEX-10 TEX-11 TEX-12 CHK-6",
    "texture: rim": "TEX-11 CHK-6",
    "texture: mask": "TEX-1",
    "texture: diffusion": f"{_run('TEX', 4, 9)}",
    "texture: shared": "CHK-15",
    "texture: coders": "REN-6",
    "network": "TEX-13 TEX-14 TEX-15 TEX-17 TEX-18",
    "network: depth and width": "TEX-14",
    "network: octaves": "TEX-13",
    "networks: several": "CHK-14",
    "networks: channels": "CHK-12 TEX-18",
    "sampling: node": f"CHK-7 {_run('TEX', 20, 23)}",
    # Pyramid textures.
    "pyramid": f"PYR-4 PYR-8 PYR-9 PYR-11 PYR-12 {_run('PYR', 14, 37)}",
    "pyramid: components": "PYR-2 PYR-7 PYR-14 PYR-34",
    "pyramid: alpha": "PYR-38 PYR-44",
    "pyramid: size": "PYR-4 PYR-7 PYR-16 PYR-17 PYR-32 PYR-34",
    "pyramid: padded": "PYR-4 PYR-6 PYR-34 PYR-35",
    "pyramid: levels": "PYR-4 PYR-28",
    "pyramid: support": "PYR-5 PYR-6 PYR-7 PYR-9",
    "pyramid: grey levels": "PYR-7 PYR-26",
    "pyramid: shifts": "PYR-25 PYR-26",
    "pyramid: raw bits": "PYR-9 PYR-10",
    "pyramid: escapes": "PYR-13",
    "pyramid: step": "PYR-21 PYR-30 PYR-33 PYR-34",
    "pyramid: tiles": "PYR-8 PYR-54",
    "pyramid: part": "PYR-38 PYR-43",
    "render: thumbnails": "REN-18 PYR-55",
    "pyramid: sampling": "PYR-43 PYR-44",
    "pyramid: planes": "PYR-3",
    "pyramid: mask": "PYR-39",
    "pyramid: cuts": "PYR-40 PYR-41",
    "pyramid: fill": "PYR-42",
    "pyramid: moved": "PYR-46 PYR-52",
    "pyramid: behind": "PYR-47",
    "pyramid: copies": "PYR-48 PYR-49",
    "pyramid: matte": "PYR-53",
    "pyramid: rim": "PYR-50 PYR-51",
    # Rendering.
    "opaque": "CHK-3 REN-12",
    "alpha": "TEX-18 REN-7 REN-12",
    "alpha: from coverage alone": "REN-4 REN-12",
    "compositing: order": "REN-7 REN-8",
    "compositing: alpha": "REN-7 REN-11",
    "canvas: smallest": "REN-1",
    "canvas: aspect": "REN-1",
    "render: whole": "REN-1 REN-3 REN-14 REN-17",
    "render: enlarging": "REN-2 REN-3",
    "render: averaging": "REN-2 REN-11",
    "render: region": "REN-1 REN-3 GEO-7",
    "render: rounding of the other side": "REN-1",
    "render: layers": "REN-10",
    "render: background": "REN-12",
}

TOPICS: Mapping[str, tuple[str, ...]] = {
    **{name: tuple(ids.split()) for name, ids in _TOPICS.items()},
    **{f"codes: {bits} bits": ("ENT-2", "ENT-15", "TEX-2") for bits in range(2, 9)},
    **{f"weights: {bits} bits": ("ENT-2", "ENT-15", "TEX-15") for bits in range(2, 9)},
}
"""Ids of statements by topic."""


def statements(words: Iterable[str]) -> list[str]:
    """Ids that topics and ids stand for, sorted, each once.

    Raises:
        ValueError: A word is neither a topic nor an id.
    """
    found: set[str] = set()
    for word in words:
        if word in TOPICS:
            found.update(TOPICS[word])
        elif ID.fullmatch(word):
            found.add(word)
        else:
            raise ValueError(f"{word!r} is neither a topic of conformance/make/topics.py nor an id")
    return sorted(found, key=order)


def order(id_: str) -> tuple[str, int]:
    """Sorting key of an id."""
    return id_[:3], int(id_[4:])

"""Files of models by what users call them: a path, a known name, or a purpose."""

from __future__ import annotations

import os
from pathlib import Path

from ....errors import InputError, UsageError
from ..onnx_model import Model, load
from .catalogue import (
    DEPTH,
    ENTRIES,
    FIGURES,
    FOLDERS,
    INPAINTING,
    SAM,
    Entry,
    entry,
    folders,
    here,
)
from .kinds import PARTNERS, Kind, kind_of

PATTERNS = {
    SAM: "*sam*encoder*.onnx",
    FIGURES: "*u2net*.onnx",
    DEPTH: "*depth*.onnx",
    INPAINTING: "*lama*.onnx",
}
"""Names of files that are taken for a purpose if no known model is here."""


def is_path(name: str) -> bool:
    """Whether a name is that of a file or of several, no short name."""
    return name.lower().endswith(".onnx") or os.sep in name or bool(os.altsep and os.altsep in name)


def locate(name: str) -> list[Path]:
    """Files of a model.

    Args:
        name: A path; two paths, encoder and decoder, joined by the character that joins folders
            in PATH; the name of a known model; or a purpose: ``sam``, ``saliency``, ``depth``,
            ``inpainting``.

    Returns:
        Its files; of a SAM the encoder, then the decoder, unless only one of them was named.

    Raises:
        UsageError: There is no such name.
        InputError: The model is known, but not here.
    """
    if is_path(name):
        return [Path(name)] if os.path.exists(name) else [Path(v) for v in name.split(os.pathsep)]
    if name in PATTERNS:
        paths = first_here(name)
        if not paths:
            known = next(e.name for e in ENTRIES if e.purpose == name)
            raise InputError(f"no model for {name} is here; {_sought()}. `pxi-models get {known}` "
                             "downloads one, or name a file")  # fmt: skip
        return paths
    known_model = entry(name)
    if known_model is None:
        names = ", ".join((*PATTERNS, *(e.name for e in ENTRIES)))
        raise UsageError(f"there is no model {name!r}; there are {names}, and files of your own "
                         "by their path")  # fmt: skip
    return _files_of(known_model)


def _files_of(known: Entry) -> list[Path]:
    paths = here(known)
    if not paths:
        files = " and ".join(f.name for f in known.files)
        raise InputError(
            f"the model {known.name} ({files}) is not here; {_sought()}. `pxi-models get "
            f"{known.name}` downloads it"
        )
    return paths


def first_here(purpose: str) -> list[Path]:
    """Files of the first model for a purpose that is here; empty if there is none."""
    for known in ENTRIES:
        if known.purpose == purpose and (paths := here(known)):
            return paths
    matches = (sorted(folder.glob(PATTERNS[purpose])) for folder in folders())
    return next(([v[0]] for v in matches if v), [])


def load_pair(paths: list[Path], jobs: int) -> tuple[Model, Model | None]:
    """Loads a SAM from its two files, or from one of them, beside which the other is sought.

    Args:
        paths: One or two files.
        jobs: Threads to use.

    Returns:
        Encoder and decoder; a model that is both, and None.

    Raises:
        InputError: The files are no SAM, do not fit together, or a part is missing.
    """
    if len(paths) > 2:
        raise InputError(f"{len(paths)} files are too many for a model; name one or two")
    models = [load(p, jobs) for p in paths]
    kinds = [kind_of(m) for m in models]
    if kinds == [Kind.EFFICIENT]:
        return models[0], None
    partners = PARTNERS | {v: k for k, v in PARTNERS.items()}
    if len(models) == 1 and kinds[0] in partners:
        models.append(_beside(models[0], kinds[0], partners[kinds[0]], jobs))
        kinds.append(partners[kinds[0]])
    if len(models) == 2 and partners.get(kinds[0]) == kinds[1]:
        return (models[0], models[1]) if kinds[0] in PARTNERS else (models[1], models[0])
    found = " and ".join(f"{m.name} ({k.value})" for m, k in zip(models, kinds, strict=True))
    pairs = ", ".join(f"{a.value} and {b.value}" for a, b in PARTNERS.items())
    raise InputError(f"{found}: these are no model of the SAM family, which is {pairs}, or a "
                     f"whole {Kind.EFFICIENT.value}")  # fmt: skip


def _beside(model: Model, kind: Kind, wanted: Kind, jobs: int) -> Model:
    """Loads the other half of a SAM from the folder of one half."""
    path = Path(model.name)
    mine, other = ("encoder", "decoder") if kind in PARTNERS else ("decoder", "encoder")
    candidates = sorted(p for p in path.parent.glob("*.onnx") if other in p.name.lower())
    likely = path.with_name(path.name.replace(mine, other))
    if likely in candidates:
        candidates = [likely]
    if len(candidates) != 1:
        found = ", ".join(p.name for p in candidates) or "none"
        raise InputError(
            f"{path}: this is the {mine} of a model in two files, and the {other} beside it cannot "
            f"be told (found: {found}); name both: {path}{os.pathsep}{other.upper()}.onnx"
        )
    model = load(candidates[0], jobs)
    found_kind = kind_of(model)
    if found_kind != wanted:
        raise InputError(f"{model.name}: this is a {found_kind.value}; {path} needs a "
                         f"{wanted.value}")  # fmt: skip
    return model


def _sought() -> str:
    places = ", ".join(str(v) for v in folders())
    return f"sought in {places} (the variable {FOLDERS} adds folders)"

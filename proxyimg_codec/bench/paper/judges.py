"""Networks that judge edits, where the user has their weights; nothing is downloaded."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from .items import Pixels, Row

NAMES = {
    "clip": "folder of a CLIP model of transformers (CLIP-I, CLIP-T)",
    "dino": "folder of a DINO model of transformers (DINO)",
    "lpips": "ONNX file with two inputs [1, 3, H, W] in -1..1 and a distance (LPIPS)",
}
"""Weights that can be given, with what they are."""


def judged(weights: Mapping[str, Path], shown: Pixels, after: Pixels | None, prompt: str) -> Row:
    """Scores of an edited picture by the networks that are given.

    Args:
        weights: Files or folders, by the names of `NAMES`.
        shown: uint8 [H, W, 3] edited picture.
        after: uint8 [H, W, 3] true result, or None.
        prompt: Description of the result; may be empty.

    Raises:
        InputError: Weights cannot be read, or a package is missing.
    """
    found: Row = {}
    if "clip" in weights:
        model = _clip(weights["clip"])
        if prompt:
            found["clip_t"] = _cosine(model(shown), model(prompt))
        if after is not None:
            found["clip_i"] = _cosine(model(shown), model(after))
    if after is not None and "dino" in weights:
        see = _dino(weights["dino"])
        found["dino"] = _cosine(see(shown), see(after))
    if after is not None and "lpips" in weights:
        found["lpips"] = _lpips(weights["lpips"])(shown, after)
    return {name: round(value, 5) for name, value in found.items()}


def _cosine(one: NDArray[Any], other: NDArray[Any]) -> float:
    return float(one @ other / max(float(np.linalg.norm(one) * np.linalg.norm(other)), 1e-12))


def _transformers(path: Path) -> Any:
    try:
        import transformers
    except ModuleNotFoundError:
        raise InputError(f"{path}: judging with it needs pip install transformers") from None
    return transformers


@lru_cache(maxsize=1)
def _clip(path: Path) -> Callable[[Pixels | str], NDArray[Any]]:
    import torch

    library = _transformers(path)
    try:
        model = library.CLIPModel.from_pretrained(path, local_files_only=True).eval()
        processor = library.CLIPProcessor.from_pretrained(path, local_files_only=True)
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: is no CLIP model of transformers: {error}") from None

    def embedded(value: Pixels | str) -> NDArray[Any]:
        with torch.no_grad():
            if isinstance(value, str):
                words = processor(text=[value], return_tensors="pt", truncation=True)
                return np.asarray(_first(model.get_text_features(**words)))
            seen = processor(images=value, return_tensors="pt")
            return np.asarray(_first(model.get_image_features(**seen)))

    return embedded


@lru_cache(maxsize=1)
def _dino(path: Path) -> Callable[[Pixels], NDArray[Any]]:
    import torch

    library = _transformers(path)
    try:
        model = library.AutoModel.from_pretrained(path, local_files_only=True).eval()
        processor = library.AutoImageProcessor.from_pretrained(path, local_files_only=True)
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: is no model of transformers: {error}") from None

    def embedded(value: Pixels) -> NDArray[Any]:
        with torch.no_grad():
            seen = processor(images=value, return_tensors="pt")
            return np.asarray(model(**seen).last_hidden_state[0, 0])

    return embedded


def _first(found: Any) -> Any:
    """First embedding; newer versions of transformers wrap them."""
    return getattr(found, "pooler_output", found)[0]


@lru_cache(maxsize=1)
def _lpips(path: Path) -> Callable[[Pixels, Pixels], float]:
    import onnxruntime

    try:
        session = onnxruntime.InferenceSession(str(path), providers=["CPUExecutionProvider"])
        names = [value.name for value in session.get_inputs()]
    except Exception as error:  # onnxruntime raises classes of its own that it does not export
        raise InputError(f"{path}: is no ONNX file: {error}") from None
    if len(names) != 2:
        raise InputError(f"{path}: must have two inputs, two pictures; it has {len(names)}")

    def distance(one: Pixels, other: Pixels) -> float:
        given = {
            name: (p.transpose(2, 0, 1)[None] / np.float32(127.5) - 1).astype(np.float32)
            for name, p in zip(names, (one, other), strict=True)
        }
        return float(np.ravel(session.run(None, given)[0])[0])

    return distance

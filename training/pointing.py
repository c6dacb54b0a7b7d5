"""Fits the weights of `encoder.shapes.pointing_scene.WEIGHTS`.

    python -m training.pointing DATA/layers/coco

Pictures at even places of the sorted folder are taken; the others measure (`benchmarks.layers`).
For each thing of at least 2 % of a picture there are points: the deepest, and four well inside.
Logistic regression, trained for the IoU of soft masks, learns which basins belong to the thing.
Full batches and a seed: the same weights come out again. About two CPU-minutes. The weights belong
to the network of `models/layers-1.onnx.zst`: fit them anew when that changes.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
import torch
from numpy.typing import NDArray
from PIL import Image

from proxyimg_codec.encoder.shapes.maps import find_maps
from proxyimg_codec.encoder.shapes.pointing_scene import Scene, scene_of

THINGS = 128
"""Labels from 1 to less than this are things."""

LEAST = 0.02
"""Least share of the picture of a thing."""

MORE, DEPTH = 4, 0.35
"""Points beside the deepest, and how deep they are, as a share of the depth of that."""

STEPS, RATE, ENTROPY = 250, 0.03, 0.3
"""Steps of AdamW, its rate at the start, and the weight of the cross-entropy beside the IoU."""

SEED = 0


class Example(NamedTuple):
    """Basins as a point sees them.

    Attributes:
        measures: float64 [N] by name, of each basin.
        inside: float64 [N] share of each basin that the thing holds.
        area: float64 [N] share of the picture.
    """

    measures: dict[str, NDArray[np.float64]]
    inside: NDArray[np.float64]
    area: NDArray[np.float64]


def examples(folder: Path) -> Iterator[Example]:
    """Yields the examples of a folder of pictures ID.jpg with labels ID.png."""
    random = np.random.default_rng(SEED)
    for file in sorted(folder.glob("*.jpg"))[::2]:
        rgb = np.asarray(Image.open(file).convert("RGB"))
        scene = scene_of(rgb, find_maps(rgb))
        size = scene.labels.shape[::-1]
        picture = np.asarray(Image.open(file.with_suffix(".png"))).astype(np.uint8)
        labels = cv2.resize(picture, size, interpolation=cv2.INTER_NEAREST)
        for label in np.unique(labels):
            thing = np.asarray(labels == label)
            if 0 < label < THINGS and thing.mean() >= LEAST:
                yield from _of_thing(scene, thing, random)


def _of_thing(
    scene: Scene, thing: NDArray[np.bool_], random: np.random.Generator
) -> Iterator[Example]:
    padded = np.pad(thing, 1).astype(np.uint8)
    depth = cv2.distanceTransform(padded, cv2.DIST_L2, 5)[1:-1, 1:-1]
    deep = np.argwhere(depth > DEPTH * depth.max())
    deepest = np.array(np.unravel_index(int(depth.argmax()), depth.shape))
    inside = np.bincount(scene.labels[thing], minlength=len(scene.area)) / scene.area
    for row, column in [deepest, *deep[random.integers(len(deep), size=MORE)]]:
        yield Example(scene.measures(int(row), int(column)), inside, scene.area / thing.size)


def fit(found: list[Example], steps: int = STEPS) -> dict[str, float]:
    """Weights by name, and the ``bias``."""
    torch.manual_seed(SEED)
    names = list(found[0].measures)
    columns = [np.concatenate([e.measures[name] for e in found]) for name in names]
    values = torch.tensor(np.stack(columns, 1), dtype=torch.float32)
    mean, spread = values.mean(0), values.std(0) + 1e-6
    values = (values - mean) / spread
    target, area = (
        torch.tensor(np.concatenate(parts), dtype=torch.float32)
        for parts in ([e.inside for e in found], [e.area for e in found])
    )
    of = torch.tensor(np.repeat(np.arange(len(found)), [len(e.area) for e in found]))

    def summed(numbers: torch.Tensor) -> torch.Tensor:
        return torch.zeros(len(found)).index_add_(0, of, numbers * area)

    model = torch.nn.Linear(len(names), 1)
    optimizer = torch.optim.AdamW(model.parameters(), lr=RATE, weight_decay=1e-3)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimizer, steps)
    size = summed(target)
    for _ in range(steps):
        odds = model(values)[:, 0]
        guess = torch.sigmoid(odds)
        shared = summed(guess * target)
        overlap = shared / (summed(guess) + size - shared)
        losses = torch.nn.functional.binary_cross_entropy_with_logits(
            odds, target, reduction="none"
        )
        loss = (1 - overlap).mean() + ENTROPY * (summed(losses) / size.sqrt()).mean()
        optimizer.zero_grad()
        loss.backward()  # type: ignore[no-untyped-call]  # torch has no types here
        optimizer.step()
        schedule.step()
    weights = (model.weight[0].detach() / spread).numpy()
    bias = float(model.bias.detach()[0]) - float(weights @ mean.numpy())
    rounded = {name: round(float(w), 3) for name, w in zip(names, weights, strict=True)}
    return {"bias": round(bias, 3), **rounded}


def main() -> None:
    """Runs the command line."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("folder", type=Path)
    args = parser.parse_args()
    print(fit(list(examples(args.folder))))


if __name__ == "__main__":
    main()

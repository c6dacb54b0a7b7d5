"""Pictures for the layers network: photographs with labels, the teacher's maps, and sprites."""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from proxyimg_codec.errors import InputError

from .pictures import TEST_PICTURES, digest, read

Bytes = NDArray[np.uint8]

SIDE = 512
"""Longest side, in pixels, at which pictures are kept."""

CROPS = 1
"""Random parts of each picture that the teacher sees besides the whole."""

THING, STUFF = 128, 0.01
"""Labels below `THING` are things in pictures with labels of things; those that cover less than the
share `STUFF` of the picture do not stand out."""

LABELLED = ("coco", "things")
"""Kinds of pictures with one map of labels, in which things are told from the rest."""

MOST_SAMPLES = 6_000_000
"""Samples of a sprite above which it is left out, to save time."""

ALIKE = 16
"""Most sprites of one folder."""


@dataclass(frozen=True, eq=False)
class Shot:
    """A picture, or a part of one, with what is known of it.

    Attributes:
        rgb: uint8 [H, W, 3].
        figure: uint8 [H, W], 255 where it stands out.
        edge: uint8 [H, W], share of people who drew an edge there, 255 for all; None if unknown.
        front: uint8 [H, W], 2 on things, 1 on what lies behind them, 0 unknown; None likewise.
        sure: bool [H, W], where `edge` counts; None = everywhere.
    """

    rgb: Bytes
    figure: Bytes
    edge: Bytes | None = None
    front: Bytes | None = None
    sure: NDArray[np.bool_] | None = None


def held_out(kind: str, position: int) -> bool:
    """Tells whether a picture is kept apart to measure, by its position in the sorted folder."""
    return {"bsds": position % 5 == 0, "coco": position % 2 == 1}.get(kind, False)


def sources(data: Path) -> list[tuple[str, Path]]:
    """Kind and path of all pictures that may be trained on, without those kept apart.

    Those in ``layers/things`` have labels of some things; what has none is unknown.
    """
    found = []
    for kind, folder, ending in (
        ("bsds", "layers/bsds", "*.jpg"),
        ("coco", "layers/coco", "*.jpg"),
        ("things", "layers/things", "*.jpg"),
        ("photo", "train", "*"),
    ):
        paths = sorted((data / folder).glob(ending))
        found += [(kind, p) for i, p in enumerate(paths) if not held_out(kind, i)]
    if not found:
        raise InputError(f"{data}: no pictures in layers/bsds, layers/coco and train")
    return found


def boxes(shape: Sequence[int], name: str) -> list[tuple[int, int, int, int]]:
    """Row, column, height and width of the whole picture and of `CROPS` random parts."""
    high, wide = shape[:2]
    rng = np.random.default_rng(list(hashlib.sha256(name.encode()).digest()[:8]))
    found = [(0, 0, high, wide)]
    for _ in range(CROPS):
        share = rng.uniform(0.45, 0.75)
        h, w = int(high * share), int(wide * share)
        found.append((int(rng.integers(high - h + 1)), int(rng.integers(wide - w + 1)), h, w))
    return found


def teach(data: Path, model: Path, cache: Path, jobs: int) -> None:
    """Stores the teacher's figure maps of all pictures and their parts, where there are none yet.

    Args:
        data: Folder of the training data.
        model: Saliency network with the interface of U2-Net: float32 [1, 3, 320, 320].
        cache: Folder for the maps, one file a picture.
        jobs: Threads to use.
    """
    import onnxruntime

    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = jobs
    session = onnxruntime.InferenceSession(str(model), options)
    cache.mkdir(parents=True, exist_ok=True)
    mean, deviation = np.array([[0.485, 0.456, 0.406], [0.229, 0.224, 0.225]], np.float32)
    for kind, path in sources(data):
        target = cache / f"{kind}-{path.stem}.npz"
        if target.exists():
            continue
        rgb = _picture(path)
        maps = {}
        for k, (y, x, h, w) in enumerate(boxes(rgb.shape, path.stem)):
            part = cv2.resize(rgb[y : y + h, x : x + w], (320, 320), interpolation=cv2.INTER_AREA)
            planes = (part / np.float32(max(part.max(), 1)) - mean) / deviation
            inputs = {session.get_inputs()[0].name: planes.transpose(2, 0, 1)[None]}
            found = np.clip(session.run(None, inputs)[0][0, 0], 0, 1)
            maps[str(k)] = np.rint(found * 255).astype(np.uint8)
        staged = target.with_suffix(".part.npz")
        np.savez_compressed(staged, **maps)
        staged.rename(target)


def shots(data: Path, cache: Path) -> dict[str, list[Shot]]:
    """Reads all pictures with their labels and the teacher's maps, by kind."""
    found: dict[str, list[Shot]] = {}
    for kind, path in sources(data):
        rgb = _picture(path)
        labels = [_plane(p) for p in sorted(path.parent.glob(f"{path.stem}-*.png"))]
        if kind in LABELLED:
            labels = [_plane(path.with_suffix(".png"))]
        with np.load(cache / f"{kind}-{path.stem}.npz") as maps:
            for k, (y, x, h, w) in enumerate(boxes(rgb.shape, path.stem)):
                at = np.s_[y : y + h, x : x + w]
                found.setdefault(kind, []).append(
                    _shot(kind, rgb[at], [v[at] for v in labels], maps[str(k)])
                )
    return found


def _shot(kind: str, rgb: Bytes, labels: list[Bytes], figure: Bytes) -> Shot:
    scale = min(1.0, SIDE / max(rgb.shape[:2]))
    size = (max(1, round(rgb.shape[1] * scale)), max(1, round(rgb.shape[0] * scale)))
    rgb = np.asarray(cv2.resize(rgb, size, interpolation=cv2.INTER_AREA), np.uint8)
    figure = np.asarray(cv2.resize(figure, size), np.uint8)
    nearest = cv2.INTER_NEAREST
    labels = [np.asarray(cv2.resize(v, size, interpolation=nearest), np.uint8) for v in labels]
    if not labels:
        return Shot(rgb, figure)
    drawn_edges = [cv2.dilate(_edges(v), np.ones((2, 2), np.uint8)) for v in labels]
    edge = np.rint(np.mean(drawn_edges, 0) * 255).astype(np.uint8)
    if kind not in LABELLED:
        return Shot(rgb, figure, edge)
    label = labels[0]
    sizes = np.bincount(label.ravel(), minlength=256) / label.size
    thing = (label > 0) & (label < THING) & (sizes[label] >= STUFF)
    # The teacher sees things without labels; those with labels stand out for certain.
    figure = np.where(thing, np.uint8(255), figure // 2)
    front = np.where(label == 0, 0, np.where(label < THING, 2, 1)).astype(np.uint8)
    if kind == "things":
        around = cv2.dilate((label > 0).astype(np.uint8), np.ones((9, 9), np.uint8)) > 0
        front[around & (label == 0)] = 1
        return Shot(rgb, figure, edge, front, around)
    return Shot(rgb, figure, edge, front)


def _edges(label: Bytes) -> Bytes:
    """1 at pixels with a neighbour of another label, uint8 [H, W]."""
    edge = np.zeros(label.shape, np.uint8)
    across, down = label[:, 1:] != label[:, :-1], label[1:] != label[:-1]
    edge[:, 1:] |= across
    edge[:, :-1] |= across
    edge[1:] |= down
    edge[:-1] |= down
    return edge


def _picture(path: Path) -> Bytes:
    picture = read(path)
    if picture is None:
        raise InputError(f"{path}: cannot be read as a picture")
    if digest(picture) in set(TEST_PICTURES.read_text().split()):
        raise InputError(f"{path}: this is a test picture; take it out of the folder")
    return picture


def _plane(path: Path) -> Bytes:
    return np.asarray(cv2.imread(str(path), cv2.IMREAD_UNCHANGED), np.uint8)


def sprites(folders: Sequence[Path], cache: Path, side: int = 320) -> list[Bytes]:
    """Reads pictures with clear parts, reduced to at most `side` pixels a side.

    They are stored in `cache`/sprites.npz, and read from there the next time.

    Test pictures and those whose file has a SHA-1 that is a multiple of ten are left out: these are
    kept apart to measure.

    Returns:
        uint8 [H, W, 4] with straight alpha, cut to what is visible, each once.
    """
    stored = cache / "sprites.npz"
    if stored.exists():
        with np.load(stored) as arrays:
            return list(arrays.values())
    refused, seen, found = set(TEST_PICTURES.read_text().split()), set(), list[Bytes]()
    for path in (p for folder in folders for p in _spread(folder)):
        content = path.read_bytes()
        stamp = hashlib.sha1(content).hexdigest()
        if stamp in seen or int(stamp, 16) % 10 == 0:
            continue
        seen.add(stamp)
        picture = _decoded(content)
        if picture is None:
            continue
        if picture.size > MOST_SAMPLES:
            continue
        solid = picture[..., 3] > 127
        if not 0.08 <= solid.mean() <= 0.97 or digest(picture[..., 2::-1]) in refused:
            continue
        y, x = np.flatnonzero(solid.any(1)), np.flatnonzero(solid.any(0))
        part = cv2.cvtColor(picture, cv2.COLOR_BGRA2RGBA)[y[0] : y[-1] + 1, x[0] : x[-1] + 1]
        parts = cv2.connectedComponents(solid.astype(np.uint8))[0]
        if min(part.shape[:2]) < 48 or parts > 6:
            continue
        scale = min(1.0, side / max(part.shape[:2]))
        size = (round(part.shape[1] * scale), round(part.shape[0] * scale))
        found.append(np.asarray(cv2.resize(part, size, interpolation=cv2.INTER_AREA), np.uint8))
    np.savez(stored, *found)
    return found


def _decoded(content: bytes) -> Bytes | None:
    """Decodes a picture with alpha, uint8 [H, W, 4] in BGR order, or returns None."""
    picture = cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_UNCHANGED)
    if picture is None or picture.shape[2:] != (4,) or picture.dtype != np.uint8:
        return None
    return np.asarray(picture, np.uint8)


def _spread(folder: Path) -> list[Path]:
    """At most `ALIKE` pictures of each folder below a folder, as those of one are much alike."""
    paths, counts = list[Path](), Counter[Path]()
    for path in sorted(folder.rglob("*.png")):
        counts[path.parent] += 1
        if counts[path.parent] <= ALIKE or path.parent == folder:
            paths.append(path)
    return paths


def cut_outs(data: Path) -> list[Bytes]:
    """Things of labelled photographs as sprites, uint8 [H, W, 4], with softened edges."""
    found = []
    for kind, path in sources(data):
        if kind not in LABELLED:
            continue
        rgb, label = _picture(path), _plane(path.with_suffix(".png"))
        for k in range(1, THING):
            mask = label == k
            if mask.mean() < 0.015:
                continue
            y, x = np.flatnonzero(mask.any(1)), np.flatnonzero(mask.any(0))
            at = np.s_[y[0] : y[-1] + 1, x[0] : x[-1] + 1]
            alpha = cv2.GaussianBlur((mask[at] * 255).astype(np.uint8), (0, 0), 1.0)
            alpha = np.clip(alpha.astype(np.float32) * 2 - 255, 0, 255).astype(np.uint8)
            found.append(np.dstack([rgb[at], alpha]))
    return found

"""Editing: what it costs, what it leaves alone, and what it adds to a file.

    python -m benchmarks.editing DATA [--only time exact mesh paper]

DATA holds the Kodak pictures, their label maps and the cliparts. Times are CPU times of one thread.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import proxyimg_codec as pxi
from benchmarks import paper
from benchmarks.common import Pixels, centre_crop, header, kodak, read_rgb, run_limited
from proxyimg_codec.api import Image
from proxyimg_codec.container import mesh as mesh_chunk
from proxyimg_codec.container.chunks import Chunk
from proxyimg_codec.container.fields import pack
from proxyimg_codec.encoder.settings import Settings
from proxyimg_codec.encoder.shapes.layers import plan_layers
from proxyimg_codec.encoder.shapes.masks import Region
from proxyimg_codec.encoder.shapes.meshes import with_meshes
from proxyimg_codec.geometry import coverage as cover
from proxyimg_codec.io.samples import to_float
from proxyimg_codec.native import kernel
from proxyimg_codec.render.compose import outline
from proxyimg_codec.render.view import make_view

PICTURE = "kodim23"
RUNS = 7


def regions(data: Path, name: str, crop: bool = True) -> tuple[Pixels, list[Region]]:
    """Reads a Kodak picture and its label map.

    Args:
        data: Folder with ``kodak/`` and ``kodak_masks/``.
        name: Name of the picture, such as ``kodim23``.
        crop: Whether to take the middle 512 x 512 only.

    Returns:
        The picture [H, W, 3], and a region for each label but 0.
    """
    pixels = read_rgb(data / "kodak" / f"{name}.png")
    labels = read_rgb(data / "kodak_masks" / f"{name}.png")[..., :1]
    if crop:
        pixels, labels = centre_crop(pixels), centre_crop(labels)
    values = [v for v in np.unique(labels) if v]
    return pixels, [Region(f"object {v}", labels[..., 0] == v) for v in values]


def times(path: Path) -> None:
    """Prints times of an edit and a rendering for each engine.

    They are cold, with nothing computed before, and cached, with the picture rendered before.
    """
    print("edit and render at 512x512, one thread, CPU ms: turned, least and median of", RUNS)
    engines = ["numpy", "native"] if kernel.available() else ["numpy"]
    for engine in engines:
        code = f"from benchmarks.editing import time_edits; time_edits({str(path)!r}, {engine!r})"
        print(run_limited(code, threads=1)[0])


def time_edits(path: str, engine: str) -> None:
    """Prints the times of one engine; `times` runs this in a process of its own."""
    image = pxi.open(path)

    def measured(before: Callable[[], object], work: Callable[[int], object]) -> str:
        spent = []
        for k in range(RUNS):
            before()
            start = time.process_time()
            work(k)
            spent.append(1000 * (time.process_time() - start))
        return f"{min(spent):.0f} ({statistics.median(spent):.0f})"

    def turn(k: int) -> None:
        image.layers[-1].rotated(3 + k).render(engine=engine)

    outline = image.layers[-1].outline
    assert outline is not None
    box = outline.bounds()
    top, foot = (box[0] + box[2]) / 2, box[3] - 5.0

    def bend(k: int) -> None:
        handles = {(top, box[1] + 20.0): (10.0 + k, 5.0), (top, foot): (0.0, 0.0)}
        image.layers[-1].dragged(handles).render(engine=engine)

    def warm() -> None:
        image.cache.clear()
        image.render(engine=engine)

    turn(0)
    print(
        f"  {engine:7s} cold {measured(image.cache.clear, turn)}, cached {measured(warm, turn)}; "
        f"bent: cold {measured(image.cache.clear, bend)}, cached {measured(warm, bend)}"
    )


def exactness(image: Image) -> None:
    """Tries each exact promise of edits on a picture, and prints whether it holds."""
    name = image.layers[-1].name
    layer = image.layers[name]
    before = image.render()
    edits = {
        "move": layer.moved(40, -10), "turn": layer.rotated(30), "scale": layer.scaled(1.4),
        "remove": layer.removed(), "texture": layer.textured(image.layers[-2].name),
        "drag": layer.dragged({_middle(image, name): (25.0, 10.0)}),
    }  # fmt: skip
    for what, edited in edits.items():
        near = _near(image, name)
        if name in [v.name for v in edited.layers]:
            near |= _near(edited, name)
        same = np.array_equal(edited.render()[~near], before[~near])
        undone = edited.undone().to_bytes() == image.to_bytes()
        print(f"  {what}: beyond 2 px identical {same}, undo restores the file {undone}")
    there = layer.moved(40.3, -10.7)
    back = there.layers[name].moved(-40.3, 10.7).baked().to_bytes()
    print(f"  there and back restores the file: {back == image.to_bytes()}")
    same = np.array_equal(layer.scaled(1).render(), before)
    print(f"  identity warp is the plain render: {same}")
    tiny = layer.moved(0.01, 0.01).render(dtype="float32")
    change = np.abs(tiny - image.render(dtype="float32")).mean() * 255
    print(f"  0.01 px changes {change:.4f} levels in the mean")
    textured = layer.textured(image.layers[-2].name)
    same = np.array_equal(_coverage(textured, name), _coverage(image, name))
    print(f"  a texture leaves the coverage: {same}")


def _middle(image: Image, name: str) -> tuple[float, float]:
    y, x = np.nonzero(_coverage(image, name) == cover.FULL)
    at = len(x) // 2
    return float(x[at]), float(y[at])


def _coverage(image: Image, name: str) -> NDArray[np.int32]:
    paths = outline(image.layers[name].outline, make_view((image.width, image.height)))
    return cover.coverage(paths or [], 0, 0, image.width, image.height)


def _near(image: Image, name: str) -> NDArray[np.bool_]:
    """Pixels within 2 px of those that a layer covers, bool [H, W]."""
    import cv2

    seen = (_coverage(image, name) > 0).astype(np.uint8)
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (5, 5))
    return cv2.dilate(seen, kernel) > 0


def meshes(data: Path) -> None:
    """Prints the bytes of the meshes of all objects of the label maps, at 512 x 512."""
    rates, nodes = [], []
    for file in kodak(data):
        if not (data / "kodak_masks" / file.name).exists():
            continue
        pixels, masks = regions(data, file.stem)
        picture = to_float(pixels)[0]
        plan = plan_layers(picture, Settings(texture="implicit"), masks)
        for i, layer in enumerate(with_meshes(picture, plan, Settings(texture="implicit")).layers):
            if layer.mesh is not None and layer.boundary is not None:
                chunk = pack(mesh_chunk.FIELDS, {"layer": i, **layer.mesh.fields})
                rates.append(8 * Chunk(mesh_chunk.TYPE, chunk).size / (512 * 512))
                nodes.append(len(layer.mesh.refined.nodes))
    print(
        f"meshes of {len(rates)} objects, 512x512: mean {np.mean(rates):.4f}, largest "
        f"{max(rates):.4f} bpp, {np.mean(nodes):.0f} nodes in the mean"
    )


def main() -> None:
    """Runs the command line."""
    sections = ("time", "exact", "mesh", "paper")
    p = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    p.add_argument("data", type=Path)
    p.add_argument("--only", nargs="+", choices=sections, default=sections)
    args = p.parse_args()
    print(header(args.data))
    if {"time", "exact"} & set(args.only):
        import tempfile

        pixels, masks = regions(args.data, PICTURE)
        image = pxi.encode(pixels, masks=masks, effort=2, texture="implicit")
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "picture.pxi"
            image.save(path)
            if "time" in args.only:
                times(path)
        if "exact" in args.only:
            print(f"exactness, {PICTURE}, layers {[v.name for v in image.layers]}")
            exactness(image)
    if "mesh" in args.only:
        meshes(args.data)
    if "paper" in args.only:
        paper.run(args.data)


if __name__ == "__main__":
    main()

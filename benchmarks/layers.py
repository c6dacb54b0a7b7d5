"""How well layers are objects: python -m benchmarks.layers DATA.

    python -m benchmarks.layers DATA [--only coco,bsds,composites,clicks,cost,order]
        [--segmenter NAME,NAME] [--count N] [--sheets DIR]

Pictures are those that neither training nor tuning sees. *coco*: every second picture of
``layers/coco``; the visible parts of at most four layers against the three largest things. *bsds*:
every fifth picture of ``layers/bsds``; covering of people's segmentations by a hierarchy, at the
best level for all pictures and for each, and by the regions at which the segmenter stops by itself.
*composites*: sprites on photographs (`benchmarks.composites`). *clicks*: things from one, two and
three clicks. *cost*: CPU time and memory of a segmenter, and bytes of layers. *order*: layers from
depth. ``--sheets`` writes a sheet of the layers of each of 18 pictures, numbered, for people to
look at; ``--count`` takes the first N pictures of each set; ``--only ''`` with ``--sheets``
measures nothing.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Iterator, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

import proxyimg_codec as pxi
from benchmarks import layer_scores as scores
from benchmarks.common import Pixels, header, kodak, read_rgb, run_limited
from benchmarks.composites import composites
from proxyimg_codec import plugins
from proxyimg_codec.bench.measure import psnr
from proxyimg_codec.encoder.settings import Settings
from proxyimg_codec.encoder.shapes.external_models.depth import ordered_by_depth
from proxyimg_codec.encoder.shapes.external_models.segmenters import find_segmenter
from proxyimg_codec.encoder.shapes.hierarchy import partitions
from proxyimg_codec.encoder.shapes.labels import label_regions
from proxyimg_codec.encoder.shapes.maps import find_maps
from proxyimg_codec.encoder.shapes.masks import Region, visible
from proxyimg_codec.io import raster

Segmenter = Callable[..., list[Region]]

LAYERS = 4
"""Most layers, as at defaults."""

LEVELS = np.linspace(0.02, 0.98, 49).tolist()
"""Strengths of boundaries at which hierarchies are cut, fine to coarse."""

OWN = 64
"""Most layers where the segmenter is to stop by itself."""

SHAPES = "proxyimg_codec.encoder.shapes"

COST_SOURCE = "kodim23"
COST_RUNS = 3

SEGMENT = """
from proxyimg_codec.encoder.shapes.external_models.depth import ordered_by_depth
from proxyimg_codec.encoder.shapes.external_models.segmenters import find_segmenter
from proxyimg_codec.io import raster
rgb = raster.read({path!r}).pixels[..., :3]
segment = find_segmenter({name!r})
{call}
"""

SHEET_KODAK = ("03", "05", "15", "20", "23")


def every(files: Sequence[Path], step: int, first: int, count: int | None) -> list[Path]:
    """Files at the positions first, first + step, ... of the sorted order, at most `count`."""
    return sorted(files)[first::step][:count]


def read_labels(path: Path) -> NDArray[Any]:
    """Reads a label map [H, W]."""
    return np.asarray(raster.read(path).pixels[..., 0])


def timed(segment: Segmenter, rgb: Pixels, layers: int) -> tuple[list[Region], float]:
    """Regions of an opaque picture, and the CPU seconds they took."""
    start = time.process_time()
    regions = segment(rgb, layers, None)
    return regions, time.process_time() - start


def coco(data: Path, name: str, count: int | None) -> Iterator[str]:
    """Yields how well layers match the things of pictures."""
    segment = find_segmenter(name)
    mean, first, seconds = list[float](), list[float](), list[float]()
    files = every([*(data / "layers" / "coco").glob("*.jpg")], 2, 1, count)
    for file in files:
        wanted = scores.things(read_labels(file.with_suffix(".png")))
        if not wanted:
            continue
        regions, spent = timed(segment, read_rgb(file), LAYERS)
        found = scores.best(visible(regions), wanted)
        mean.append(float(np.mean(found)))
        first.append(float(found[0] >= 0.7))
        seconds.append(spent)
    yield (
        f"coco, {name}, {len(mean)} of {len(files)} pictures with things: mean best IoU of a layer "
        f"{ranged(mean)}; largest thing is a layer (IoU >= 0.7) {ranged(first)}; "
        f"{np.mean(seconds):.2f} CPU-s a picture"
    )


def bsds(data: Path, name: str, count: int | None) -> Iterator[str]:
    """Yields how well regions cover people's segmentations."""
    segment = find_segmenter(name)
    levels, own, regions_found, seconds = list[list[float]](), list[float](), list[int](), 0.0
    files = every([*(data / "layers" / "bsds").glob("*.jpg")], 5, 0, count)
    for file in files:
        rgb = read_rgb(file)
        people = [read_labels(p) for p in sorted(file.parent.glob(f"{file.stem}-*.png"))]
        start = time.process_time()
        divided = partitions(find_maps(rgb), LEVELS)
        seconds += time.process_time() - start
        levels.append([scores.covering(labels, people) for labels in divided])
        regions = segment(rgb, OWN, None)
        labels = np.zeros(rgb.shape[:2], np.intp)
        for k, region in enumerate(regions):
            labels[region.mask] = k
        own.append(scores.covering(labels, people))
        regions_found.append(len(regions))
    table = np.array(levels)
    level = int(table.mean(0).argmax())
    yield (
        f"bsds, {len(files)} pictures: covering at the best level for all ({LEVELS[level]:.2f}) "
        f"{ranged(table[:, level])}; at the best of each picture {ranged(table.max(1))}; "
        f"{seconds / len(files):.2f} CPU-s a picture"
    )
    yield (
        f"bsds, {name}, its own choice of regions ({np.mean(regions_found):.1f} on average): "
        f"covering {ranged(own)}"
    )


def composed(data: Path, name: str, count: int | None) -> Iterator[str]:
    """Yields whether sprites become layers, in the right order."""
    segment = find_segmenter(name)
    found, ordered, pairs, images = list[float](), list[bool](), 0, 0
    for image in composites(data, 60 if count is None else count):
        regions = segment(image.rgb, LAYERS, None)
        score = scores.sprites(visible(regions), image.masks, image.pairs)
        found += score.best
        ordered += score.ordered
        pairs += score.pairs
        images += 1
    right = [float(v >= scores.SAME) for v in found]
    yield (
        f"composites, {name}, {images} pictures, {len(found)} sprites: a layer with IoU >= 0.9 "
        f"{ranged(right)}, mean best IoU {np.mean(found):.3f}; order right in {sum(ordered)} of "
        f"{len(ordered)} overlapping pairs whose sprites both have a layer (IoU >= 0.5), of {pairs}"
    )


def clicks(data: Path, name: str, count: int | None) -> Iterator[str]:
    """Yields IoU after one, two and three clicks, by the prompter of a name."""
    prompts = import_module(f"{SHAPES}.prompts")
    prompter = plugins.find("prompters", name)
    coco_files = every([*(data / "layers" / "coco").glob("*.jpg")], 2, 1, count)
    places = {"coco": [(f, f.with_suffix(".png")) for f in coco_files]}
    masks = sorted((data / "kodak_masks").glob("*.png"))[:count]
    places["kodak"] = [(data / "kodak" / m.name, m) for m in masks]
    everything = list[list[float]]()
    for where, files in places.items():
        found, seconds = list[list[float]](), 0.0
        for file, labels in files:
            rgb = read_rgb(file)
            for thing in scores.things(read_labels(labels), None):

                def find(
                    inside: list[scores.Point], outside: list[scores.Point], rgb: Pixels = rgb
                ) -> scores.Mask:
                    centres = [tuple((x + 0.5, y + 0.5) for x, y in v) for v in (inside, outside)]
                    regions = prompter(rgb, [prompts.Prompt("thing", *centres)])
                    masks = [r.mask for r in regions if r.name == "thing"]
                    return masks[0] if masks else np.zeros(rgb.shape[:2], np.bool_)

                start = time.process_time()
                found.append(scores.clicked(thing, find))
                seconds += time.process_time() - start
        everything += found
        yield (
            f"clicks, {name}, {where}, {len(found)} things in {len(files)} pictures: IoU "
            f"{clicked(found)}; {seconds / (scores.CLICKS * len(found)):.2f} CPU-s a click"
        )
    yield f"clicks, {name}, all {len(everything)} things: IoU {clicked(everything)}"


def clicked(found: list[list[float]]) -> str:
    """Mean IoU after each number of clicks, with intervals."""
    table = np.array(found)
    return "; ".join(f"after {k} {ranged(column)}" for k, column in enumerate(table.T, 1))


def cost(data: Path, name: str, count: int | None) -> Iterator[str]:
    """Yields CPU time and memory of a segmenter, and bytes of layers beside those of label maps."""
    path = str(data / "kodak" / f"{COST_SOURCE}.png")
    runs = {
        call: [run_limited(SEGMENT.format(path=path, name=name, call=call))[1:]
               for _ in range(COST_RUNS)]
        for call in (f"segment(rgb, {LAYERS}, None)", "")
    }  # fmt: skip
    (gigabytes, whole), (_, start) = (np.median(v, axis=0) for v in runs.values())
    yield (
        f"cost, {name}, {COST_SOURCE} in a process of its own (median of {COST_RUNS}): {whole:.2f} "
        f"CPU-s, of which {start:.2f} to start and to read the picture; at most {gigabytes:.2f} GB"
    )
    more = {"layers": list[float](), "label maps": list[float]()}
    worse = {"layers": list[float](), "label maps": list[float]()}
    files = sorted((data / "kodak_masks").glob("*.png"))[:count]
    numbers = {"layers": list[int](), "label maps": list[int]()}
    for labels in files:
        rgb = read_rgb(data / "kodak" / labels.name)
        ways: dict[str, dict[str, Any]] = {
            "one": {"max_layers": 1},
            "layers": {"max_layers": LAYERS, "segmenter": name},
            "label maps": {"masks": label_regions(read_labels(labels), labels.name)},
        }
        images = {k: pxi.encode(rgb, effort=1, jobs=1, **v) for k, v in ways.items()}
        size = {k: len(image.to_bytes()) for k, image in images.items()}
        error = {k: psnr(rgb, image.render()) for k, image in images.items()}
        for k in more:
            more[k].append(100 * (size[k] / size["one"] - 1))
            worse[k].append(error[k] - error["one"])
            numbers[k].append(len(images[k].layers))
    for k in more:
        yield (
            f"cost, {name}, {k} of {len(files)} Kodak pictures ({np.mean(numbers[k]):.1f} layers), "
            f"effort 1, against one layer: {np.mean(more[k]):+.2f} % bytes, "
            f"{np.mean(worse[k]):+.3f} dB"
        )


def order(data: Path, name: str, count: int | None) -> Iterator[str]:
    """Yields whether layers stand in the order of a measured depth."""
    with np.load(data / "depth" / "motorcycle_disp.npz") as file:
        disparity = np.asarray(file["arr_0"], np.float32)
    known = np.isfinite(disparity)
    nearness = np.where(known, disparity, disparity[known].min())
    right = pairs = 0
    rng = np.random.default_rng(0)
    for layers in range(2, 2 + (7 if count is None else count)):
        ends = np.quantile(disparity[known], np.linspace(0, 1, layers + 1))
        slices = np.clip(np.searchsorted(ends, disparity) - 1, 0, layers - 1)
        regions = [Region(str(k), known & (slices == k)) for k in rng.permutation(layers)]
        found = [int(r.name) for r in ordered_by_depth(regions, nearness, opaque=False)]
        one, all_of_them = scores.inversions(found)
        right, pairs = right + one, pairs + all_of_them
    yield f"order, motorcycle, slices of its disparity: {right} of {pairs} pairs in order"


def ranged(values: Sequence[float] | NDArray[np.float64]) -> str:
    """Mean of values and its 95 % interval by the bootstrap."""
    low, high = scores.interval(list(values))
    return f"{np.mean(values):.3f} ({low:.3f}-{high:.3f})"


def sheets(data: Path, folder: Path, name: str) -> None:
    """Writes a sheet of the layers of each of 18 pictures, numbered in the order of their names."""
    segment = find_segmenter(name)
    files = [*(data / "photo").glob("*.*"), *(data / "anime").glob("*.*")]
    files += [p for p in kodak(data) if p.stem[-2:] in SHEET_KODAK]
    folder.mkdir(parents=True, exist_ok=True)
    for number, file in enumerate(sorted(files, key=lambda p: p.name), 1):
        pixels = raster.read(file).pixels
        support = pixels[..., 3] >= 128 if pixels.shape[2] == 4 else None
        rgb = np.ascontiguousarray(pixels[..., :3])
        if support is not None and support.all():
            support = None
        regions = segment(rgb, LAYERS, support)
        if support is not None:
            rgb[~support] = 255
        raster.write(folder / f"{number:02}.png", sheet(rgb, regions))


def sheet(rgb: Pixels, regions: list[Region]) -> Pixels:
    """The picture with coloured outlines of its layers, then each layer on a checkerboard."""
    bright = np.full((1, len(regions), 3), 255, np.uint8)
    bright[..., 0] = np.arange(len(regions)) * 180 / len(regions)
    colours = np.asarray(cv2.cvtColor(bright, cv2.COLOR_HSV2RGB))[0].tolist()
    y, x = np.mgrid[: rgb.shape[0], : rgb.shape[1]] // 16
    board = np.where((x + y)[..., None] % 2, np.uint8(160), np.uint8(208))
    outlined, tiles = rgb.copy(), []
    for region, colour, seen in zip(regions, colours, visible(regions), strict=True):
        found = cv2.findContours(seen.astype(np.uint8), cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)[0]
        cv2.drawContours(outlined, found, -1, colour, max(2, max(rgb.shape) // 300))
        tiles.append(np.where(region.mask[..., None], rgb, board).astype(np.uint8))
    whole = [rgb, outlined, *tiles]
    whole += [np.full_like(rgb, 255)] * (-len(whole) % 3)
    return np.vstack([np.hstack(whole[k : k + 3]) for k in range(0, len(whole), 3)])


SECTIONS: dict[str, Callable[[Path, str, int | None], Iterator[str]]] = {
    "coco": coco, "bsds": bsds, "composites": composed, "clicks": clicks, "cost": cost,
    "order": order,
}  # fmt: skip


def main() -> None:
    """Runs the command line."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("data", type=Path)
    parser.add_argument("--only", default=",".join(SECTIONS), help="sections, with commas")
    parser.add_argument("--segmenter", default=Settings().segmenter, help="names, with commas")
    parser.add_argument("--prompter", default="maps", help="names, with commas; for clicks")
    parser.add_argument("--count", type=int, help="most pictures of a section")
    parser.add_argument("--sheets", type=Path, metavar="DIR")
    args = parser.parse_args()
    segmenters = args.segmenter.split(",")
    if args.sheets:
        sheets(args.data, args.sheets, segmenters[0])
    chosen = [name for name in args.only.split(",") if name]
    if unknown := set(chosen) - set(SECTIONS):
        parser.error(f"--only: {', '.join(sorted(unknown))}; there are {', '.join(SECTIONS)}")
    print(header(args.data))
    for section in chosen:
        names = {"clicks": args.prompter.split(","), "order": ["depth"]}.get(section, segmenters)
        for name in names:
            start = time.process_time()
            for line in SECTIONS[section](args.data, name, args.count):
                print(line, flush=True)
            print(f"  {time.process_time() - start:.0f} CPU-s", flush=True)


if __name__ == "__main__":
    main()

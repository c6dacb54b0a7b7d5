"""How well what an object hides of the back is completed, and what that costs.

    python -m benchmarks.background DATA [--only SECTIONS] [--count N] [--seed S] [--pictures DIR]

Sections, with commas between them:

- ``composites``: cliparts and anime figures are pasted with true alpha on 40 Kodak pictures, 480 px
  wide or high. They are encoded with the true masks (``-e 1``), the object is removed, and what
  stands in its place is compared with the photograph and with what is around, beside OpenCV's
  inpainting, which gets the decoded picture. The method was developed on other composites than
  those of any seed.
- ``bytes``: bytes, and CPU time of encoding and decoding, of the Kodak pictures with label maps.
- ``large``: CPU time and memory of one of them enlarged to 12 megapixels.
- ``removals``: sheets of removals, in ``--pictures``, and 30 numbered pictures to be shown to
  people who have not seen the original.

DATA has ``kodak/``, ``kodak_masks/``, ``photo/``, ``clipart/`` and ``anime/``.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np

from benchmarks import background_composites, background_removals
from benchmarks.common import Pixels, header, read_rgb, run_limited
from benchmarks.layer_scores import interval
from proxyimg_codec import encode, from_bytes
from proxyimg_codec.encoder.shapes.labels import label_regions
from proxyimg_codec.encoder.shapes.masks import Region
from proxyimg_codec.io import raster

BACKGROUNDS = ("auto", "none")
"""The default, and the one that stores nothing for what is hidden, as the smooth one does."""

REPEATED = 5
"""Times that a picture is decoded; the fastest counts."""

LARGE, LARGE_SIZE = "kodim23", (4240, 2827)
"""The picture that is enlarged, and its width and height then."""

ENLARGED = """
import cv2
from proxyimg_codec import encode
from proxyimg_codec.encoder.shapes.labels import label_regions
from proxyimg_codec.io import raster
rgb = raster.read({picture!r}).pixels[..., :3]
labels = raster.read({labels!r}).pixels[..., 0]
rgb = cv2.resize(rgb, {size}, interpolation=cv2.INTER_CUBIC)
labels = cv2.resize(labels, {size}, interpolation=cv2.INTER_NEAREST)
encode(rgb, masks=label_regions(labels, "labels"), effort=1, jobs=1, background={background!r})
"""


class Cost(NamedTuple):
    """Cost of a picture.

    Attributes:
        size: Bytes of the file.
        encoding: CPU seconds of encoding.
        shown: CPU milliseconds of decoding and drawing the picture.
        removed: CPU milliseconds of decoding, and of drawing it without its first object.
    """

    size: float
    encoding: float
    shown: float
    removed: float


def cost(rgb: Pixels, masks: list[Region], background: str) -> Cost:
    """Encodes a picture, and decodes it `REPEATED` times."""
    start = time.process_time()
    image = encode(rgb, masks=masks, background=background, effort=1, jobs=1)
    encoding, file = time.process_time() - start, image.to_bytes()
    shown, removed = list[float](), list[float]()
    for _ in range(REPEATED):
        start = time.process_time()
        from_bytes(file).render()
        middle = time.process_time()
        from_bytes(file).layers[1].removed().render()
        shown.append(1000 * (middle - start))
        removed.append(1000 * (time.process_time() - middle))
    return Cost(len(file), encoding, min(shown), min(removed))


def costs(data: Path, count: int | None, seed: int, folder: Path | None) -> Iterator[str]:
    """Yields bytes, and CPU time of encoding and decoding, of pictures with label maps."""
    files = sorted((data / "kodak_masks").glob("*.png"))[:count]
    found = list[list[Cost]]()
    for path in files:
        rgb = read_rgb(data / "kodak" / path.name)
        masks = label_regions(raster.read(path).pixels[..., 0], path.name)
        found.append([cost(rgb, masks, background) for background in BACKGROUNDS])
    more = [100 * (a.size / b.size - 1) for a, b in found]
    worst = int(np.argmax(more))
    low, high = interval(more)
    yield (
        f"bytes of {len(files)} Kodak pictures with label maps, {' against '.join(BACKGROUNDS)}: "
        f"{np.mean(more):+.2f} % ({low:+.2f}..{high:+.2f}), at most {more[worst]:+.2f} % "
        f"({files[worst].stem}); {sum(a.size > b.size for a, b in found)} have more"
    )
    for name, text in (
        ("encoding", "CPU-s of encoding"),
        ("shown", "CPU-ms of decoding the picture"),
        ("removed", "CPU-ms of decoding it without an object"),
    ):
        without = [getattr(b, name) for _, b in found]
        extra = [getattr(a, name) - w for (a, _), w in zip(found, without, strict=True)]
        yield (
            f"{text}: {np.mean(extra):+.2f} in the mean, {max(extra):+.2f} at most, beside "
            f"{np.mean(without):.2f}"
        )


def large(data: Path, count: int | None, seed: int, folder: Path | None) -> Iterator[str]:
    """Yields CPU time and memory of encoding an enlarged picture."""
    found = {}
    for background in BACKGROUNDS:
        code = ENLARGED.format(
            picture=str(data / "kodak" / f"{LARGE}.png"),
            labels=str(data / "kodak_masks" / f"{LARGE}.png"),
            size=LARGE_SIZE, background=background,
        )  # fmt: skip
        found[background] = run_limited(code, threads=1)[1:]
    (memory, seconds), (less, fewer) = found.values()
    yield (
        f"large, {LARGE} at {LARGE_SIZE[0]} x {LARGE_SIZE[1]}, {BACKGROUNDS[0]} against "
        f"{BACKGROUNDS[1]}: {seconds - fewer:+.1f} CPU-s beside {fewer:.1f}, "
        f"{memory - less:+.2f} GB beside {less:.2f}"
    )


Section = Callable[[Path, int | None, int, Path | None], Iterator[str]]

SECTIONS: dict[str, Section] = {
    "composites": background_composites.run, "bytes": costs, "large": large,
    "removals": background_removals.run,
}  # fmt: skip


def main() -> None:
    """Runs the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("data", type=Path)
    parser.add_argument("--only", default=",".join(SECTIONS), help="sections, with commas")
    parser.add_argument("--count", type=int, help="most pictures of a section")
    parser.add_argument("--seed", type=int, default=1, help="which composites")
    parser.add_argument("--pictures", type=Path, metavar="DIR", help="where pictures are written")
    args = parser.parse_args()
    chosen = [name for name in args.only.split(",") if name]
    if unknown := set(chosen) - set(SECTIONS):
        parser.error(f"--only: {', '.join(sorted(unknown))}; there are {', '.join(SECTIONS)}")
    if args.count is not None and args.count < 1:
        parser.error("--count: at least 1")
    if args.pictures:
        args.pictures.mkdir(parents=True, exist_ok=True)
    cv2.setNumThreads(1)
    print(header(args.data), flush=True)
    for name in chosen:
        start = time.process_time()
        for line in SECTIONS[name](args.data, args.count, args.seed, args.pictures):
            print(line, flush=True)
        print(f"  {time.process_time() - start:.0f} CPU-s", flush=True)


if __name__ == "__main__":
    main()

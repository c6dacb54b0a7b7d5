"""How clean the edges of layers are that are drawn alone, and of the back that they leave.

    python -m benchmarks.edges DATA [--count N] [--seed S] [--effort E] [--quality Q]
        [--coders pyramid implicit] [--pictures DIR]

A sprite with true alpha is pasted on a photograph, and on the same one blurred until it is smooth.
The composites are encoded with the hard mask of the sprite. On the photograph, the object is drawn
alone; in rings of 1 px inside its mask, its colours are compared with the sprite's own. What they
may differ by is the error of the decoded composite on the same pixels, and 2 levels. On the smooth
picture, the back is drawn alone; the profile of its error across the outline, averaged along it,
should be within 3 levels of a straight line: shadows around an object stay, an outline must not.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.common import Pixels, header, kodak, read_rgb
from benchmarks.composites import reduced, rgba, sprite_files
from proxyimg_codec import encode
from proxyimg_codec.bench.sprites import Sprite, scaled, solid
from proxyimg_codec.encoder.shapes.masks import Region
from proxyimg_codec.io import raster

Mask = NDArray[np.bool_]
Reals = NDArray[np.float64]

SIDE, SIZE = 384, (0.35, 0.6)
"""Longer side of composites in pixels, and shares of the shorter one that sprites take."""

SMOOTH = 24.0
"""Standard deviation of the blur of smooth backs, in pixels."""

RINGS = 6
"""Rings of 1 px that are measured on each side of an outline."""

ALLOWED, GHOST = 2.0, 3.0
"""Levels that colours alone may be worse by than the decoded error, and of a profile."""

CHECK = 8
"""Side of the squares of checkerboards in pixels."""


class Case(NamedTuple):
    """A sprite and the backs that it lies on.

    Attributes:
        name: Name of the sprite.
        own: uint8 [H, W, 4] the sprite in its place, with straight alpha.
        photo: uint8 [H, W, 3] back.
        smooth: uint8 [H, W, 3] smooth back.
    """

    name: str
    own: Pixels
    photo: Pixels
    smooth: Pixels

    @property
    def mask(self) -> Mask:
        """Hard mask of the sprite, bool [H, W]."""
        return np.asarray(self.own[..., 3] >= 128)

    def on(self, back: Pixels) -> Pixels:
        """The sprite on a back, uint8 [H, W, 3]."""
        alpha = self.own[..., 3:] / 255
        return np.asarray(np.rint(alpha * self.own[..., :3] + (1 - alpha) * back), np.uint8)


def cases(data: Path, count: int, seed: int) -> Iterator[Case]:
    """Yields sprites in places that `seed` chooses, on Kodak pictures."""
    rng = np.random.default_rng(seed)
    files, photos = sprite_files(data), kodak(data)
    found = 0
    for i in rng.permutation(len(files)):
        cut_out = solid(rgba(files[i]))
        if cut_out is None:
            continue
        photo = reduced(read_rgb(photos[found % len(photos)]), SIDE)
        shape = photo.shape[:2]
        small = scaled(cut_out, float(rng.uniform(*SIZE)) * min(shape))
        y, x = (
            int(rng.integers(RINGS, n - m - RINGS))
            for n, m in zip(shape, small.shape, strict=False)
        )
        smooth = cv2.GaussianBlur(photo, (0, 0), SMOOTH)
        yield Case(files[i].stem, Sprite(small, x, y).on(shape), photo, np.asarray(smooth))
        found += 1
        if found == count:
            return


def depth(mask: Mask) -> NDArray[np.int64]:
    """Number of the ring of each pixel, int [H, W]: 1, 2 .. inside a mask, -1, -2 .. outside."""
    inside, outside = (
        np.ceil(cv2.distanceTransform(m.astype(np.uint8), cv2.DIST_L2, 5)) for m in (mask, ~mask)
    )
    return np.asarray(inside - outside, np.int64)


def rings(error: Reals, mask: Mask) -> Reals:
    """Mean of an error [H, W] in the rings 1 .. `RINGS` inside a mask; NaN where there is none."""
    at = depth(mask)
    return np.array([error[at == k].mean() if (at == k).any() else np.nan
                     for k in range(1, RINGS + 1)])  # fmt: skip


def profile(error: Reals, mask: Mask) -> Reals:
    """Means of errors [H, W, 3], with their sign, in the rings from inside to outside: [n, 3].

    They are less a straight line for each channel: what is filled may be a little brighter.
    """
    at = depth(mask)
    numbers = [k for k in range(RINGS, -RINGS - 1, -1) if k and (at == k).any()]
    means = np.array([error[at == k].mean(0) for k in numbers])
    place = np.arange(len(means))
    lines = np.polynomial.polynomial.polyfit(place, means, 1)
    return np.asarray(means - np.polynomial.polynomial.polyval(place, lines).T)


class Score(NamedTuple):
    """Result of a case.

    Attributes:
        alone: [RINGS] mean difference of the object alone from its own colours, in levels.
        decoded: [RINGS] mean error of the decoded composite.
        ghost: Largest value of the profile of the back alone, in levels.
    """

    alone: Reals
    decoded: Reals
    ghost: float

    @property
    def clean(self) -> bool:
        """Whether all rings but the first are as good as they should be."""
        return bool(np.nanmax((self.alone - self.decoded)[1:]) < ALLOWED)


def score(case: Case, coder: str, effort: int, quality: float, folder: Path | None = None) -> Score:
    """Encodes the composites of a case, and measures what is drawn alone."""

    def encoded(back: Pixels) -> tuple[Pixels, dict[str, Pixels]]:
        mixed = case.on(back)
        masks = [Region("object", case.mask)]
        image = encode(mixed, masks=masks, effort=effort, quality=quality, texture=coder)
        drawn = {"": image.render()}
        return mixed, drawn | {v: image.render(layers=[v]) for v in ("back", "object")}

    def between(one: Pixels, other: Pixels) -> Reals:
        return one[..., :3].astype(np.float64) - other[..., :3]

    mixed, drawn = encoded(case.photo)
    smooth = encoded(case.smooth)[1]
    if folder:
        parts = [case.own, drawn["object"], smooth[""], smooth["back"]]
        raster.write(folder / f"{case.name}-{coder}.png", np.hstack([_on_checks(v) for v in parts]))
    seen = case.mask & (drawn["object"][..., 3] > 0)
    alone, decoded = (
        rings(np.abs(between(*pair)).mean(2), seen)
        for pair in ((drawn["object"], case.own), (drawn[""], mixed))
    )
    ghost = profile(between(smooth["back"], case.smooth), case.mask)
    return Score(alone, decoded, float(np.abs(ghost).max()))


def _on_checks(pixels: Pixels) -> Pixels:
    """Picture [H, W, 3 or 4] over a checkerboard, three times as large."""
    y, x = np.indices(pixels.shape[:2]) // CHECK
    ground = np.where((x + y) % 2, 96, 224)[..., None]
    alpha = pixels[..., 3:] / 255 if pixels.shape[2] == 4 else np.ones((1, 1, 1))
    flat = np.rint(pixels[..., :3] * alpha + ground * (1 - alpha)).astype(np.uint8)
    return flat.repeat(3, 0).repeat(3, 1)


def report(coder: str, scores: list[Score]) -> None:
    """Prints the means of rings, and how many cases are as good as they should be."""
    for name in ("decoded", "alone"):
        mean = np.nanmean([getattr(s, name) for s in scores], axis=0)
        print(f"{coder} {name:8s} " + " ".join(f"{v:6.2f}" for v in mean))
    ghosts = [s.ghost for s in scores]
    print(f"{coder}: {sum(s.clean for s in scores)} of {len(scores)} objects within {ALLOWED:g} "
          f"levels of the decoded error from the second ring on; {sum(g <= GHOST for g in ghosts)} "
          f"backs within {GHOST:g} levels, worst {max(ghosts):.1f}", flush=True)  # fmt: skip


def main() -> None:
    """Entry point."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("data", type=Path, help="folder with kodak, clipart and emoji")
    parser.add_argument("--count", type=int, default=10)
    parser.add_argument("--seed", type=int, default=0, help="which sprites, and where")
    parser.add_argument("--effort", type=int, default=1)
    parser.add_argument("--quality", type=float, default=75)
    coders = ("pyramid", "implicit")
    parser.add_argument("--coders", nargs="+", choices=coders, default=coders)
    parser.add_argument("--pictures", type=Path, metavar="DIR", help="where to put pictures: "
                        "sprite, object alone, smooth composite, its back alone")  # fmt: skip
    args = parser.parse_args()
    print(header(args.data))
    if args.pictures:
        args.pictures.mkdir(parents=True, exist_ok=True)
    chosen = list(cases(args.data, args.count, args.seed))
    for coder in args.coders:
        report(coder, [score(v, coder, args.effort, args.quality, args.pictures) for v in chosen])


if __name__ == "__main__":
    main()

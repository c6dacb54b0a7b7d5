"""New textures by score distillation with the small denoiser, and the paper's ablation of it.

    python -m benchmarks.generate DATA --denoiser denoiser.pt --judge judge.pt [--pictures DIR]
        [--only SECTIONS] [--steps N] [--threads N]

Sections, with commas between them:

- ``pairs``: ten times, one layer of a Kodak picture, cut to 256x256, is turned into one class. What
  it is taken for by a classifier that was trained apart, and how well the denoiser itself predicts
  the noise in it (the less, the more likely), before and after, in the file that comes out.
- ``ablation``: one of them by the distillation of all pixels, of the pixels of the layer, and of
  its texture (ProxyImg, ablation of generative editing): pictures, and the same figures.

`training.denoiser` and `training.emoji_classifier` make the two networks. DATA has ``kodak/`` and
``kodak_masks/``.
"""

from __future__ import annotations

import argparse
import math
import time
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from benchmarks.common import header, read_rgb
from proxyimg_codec import Image, encode, from_bytes
from proxyimg_codec.generate.crops import crops
from proxyimg_codec.generate.denoiser import Denoiser, load
from proxyimg_codec.generate.distill import Distillation
from proxyimg_codec.generate.find_guide import guide_for
from proxyimg_codec.generate.guide import Wishes
from proxyimg_codec.generate.parameters import Colours, Made, within
from proxyimg_codec.generate.pixel_guide import angles
from proxyimg_codec.generate.run import Run
from proxyimg_codec.generate.scene import Scene, scene_of
from proxyimg_codec.generate.settings import Settings
from proxyimg_codec.io import raster
from training import emoji_classifier
from training.emoji_groups import CLASSES

SIDE = 256
PAIRS = (
    ("kodim23", 1, "flags"), ("kodim23", 1, "people"), ("kodim02", 1, "flags"),
    ("kodim02", 1, "people"), ("kodim23", 2, "flags"), ("kodim23", 2, "faces"),
    ("kodim15", 1, "flags"), ("kodim15", 1, "faces"), ("kodim04", 1, "flags"),
    ("kodim04", 1, "faces"),
)  # fmt: skip
"""Pictures, labels of their objects, and classes of the section ``pairs``."""

ABLATED = ("kodim23", 1, "flags")
CROPS, TIMES = 64, (0.2, 0.4, 0.6, 0.8)
RATE = 0.02
"""Learning rate of pixels."""


class Figures(NamedTuple):
    """Figures of a scene.

    Attributes:
        probability: Mean probability of a class, by the classifier.
        error: Mean squared error of the noise that the denoiser finds if it is told the class, less
            that if it is not told any.
    """

    probability: float
    error: float


class Judges(NamedTuple):
    """Networks that judge."""

    classifier: emoji_classifier.Classifier
    denoiser: Denoiser

    @torch.no_grad()
    def figures(self, image: Tensor, scene: Scene, name: str) -> Figures:
        """Figures of crops of a scene [3, h, w], on their own random numbers."""
        random = torch.Generator().manual_seed(1234)
        views, _ = crops(image, scene, CROPS, self.denoiser.shape.side, random)
        label = CLASSES.index(name)
        found = torch.softmax(self.classifier(views.clamp(0, 1)), 1)[:, label].mean()
        errors = []
        for time_ in TIMES:
            times = torch.full((CROPS,), time_)
            cos, sin = angles(times)
            x = 2 * views - 1
            noise = torch.randn(x.shape, generator=random)
            for told in (label, len(CLASSES)):
                v = self.denoiser(cos * x + sin * noise, times, torch.full((CROPS,), told))
                errors.append(float(((cos * noise - sin * x - v) ** 2).mean()))
        wanted, plain = errors[::2], errors[1::2]
        return Figures(float(found), float(np.mean(wanted) - np.mean(plain)))


def picture_of(data: Path, name: str, label: int) -> Image:
    """Square of a Kodak picture around an object, reduced to 256x256; its layer is ``object``."""
    pixels = read_rgb(data / "kodak" / f"{name}.png")
    mask = raster.read(data / "kodak_masks" / f"{name}.png").pixels[..., 0] == label
    rows, columns = np.flatnonzero(mask.any(1)), np.flatnonzero(mask.any(0))
    side = min(int(1.3 * max(np.ptp(rows), np.ptp(columns))), *pixels.shape[:2])
    y, x = (
        int(np.clip((v[0] + v[-1] - side) // 2, 0, n - side))
        for v, n in zip((rows, columns), pixels.shape[:2], strict=True)
    )
    cut = cv2.resize(pixels[y : y + side, x : x + side], (SIDE, SIDE), interpolation=cv2.INTER_AREA)
    own = mask[y : y + side, x : x + side].astype(np.float32)
    small = cv2.resize(own, (SIDE, SIDE), interpolation=cv2.INTER_AREA)
    return encode(cut, masks={"object": small > 0.5}, effort=2, quality=70)


def shown(image: Image, scene: Scene) -> Tensor:
    """Scene [3, h, w] of an image as decoders draw it."""
    pixels = image.render(region=scene.region, dtype=np.float32)
    return torch.from_numpy(np.ascontiguousarray(pixels.transpose(2, 0, 1)))


def scene_for(image: Image) -> Scene:
    """Scene of the layer ``object``."""
    return scene_of(image.picture, image.layers["object"].data, 2 * SIDE)


def pairs(args: argparse.Namespace, judges: Judges) -> None:
    """Prints the section ``pairs``."""
    print("| picture | class | before | after | error before | after | seconds (CPU) |")
    print("|---|---|---|---|---|---|---|")
    good = 0
    for name, number, wanted in PAIRS:
        before = picture_of(args.data, name, number)
        scene = scene_for(before)
        started, cpu = time.perf_counter(), time.process_time()
        made = before.layers["object"].generated(
            wanted, guide=str(args.denoiser), steps=args.steps, guidance=args.guidance
        )
        wall, cpu = time.perf_counter() - started, time.process_time() - cpu
        after = from_bytes(made.to_bytes())
        one, two = (judges.figures(shown(v, scene), scene, wanted) for v in (before, after))
        good += one.probability < 0.2 and two.probability > 0.8
        seconds = f"{wall:.0f} ({cpu:.0f})"
        print(f"| {name} {number} | {wanted} | {one.probability:.3f} | {two.probability:.3f} "
              f"| {one.error:+.4f} | {two.error:+.4f} | {seconds} |", flush=True)  # fmt: skip
        if args.pictures:
            both = np.concatenate([before.render(), after.render()], 1)
            raster.write(str(args.pictures / f"{name}-{number}-{wanted}.png"), both)
    print(f"\nfrom less than 0.2 to more than 0.8: {good} of {len(PAIRS)}")


class Pixels:
    """Pixels of a scene as parameters, without any texture."""

    def __init__(self, image: Tensor, scene: Scene) -> None:
        colours = image.reshape(3, -1).T[scene.index]
        self._values = colours.clone().requires_grad_()

    def groups(self) -> list[dict[str, Any]]:
        """Pixels; see `Parameters`."""
        return [{"params": [self._values], "lr": RATE}]

    def colours(self, share: float) -> Colours:
        """Colours of the pixels; see `Parameters`."""
        return Colours(*within(self._values))

    def extra(self) -> dict[str, Any]:
        """Nothing; see `Parameters`."""
        return {}

    def restore(self, extra: dict[str, Any]) -> None:
        """Does nothing; see `Parameters`."""

    def finished(self, effort: int, seed: int) -> Made:
        """Never called: pixels are no texture."""
        raise NotImplementedError  # pixels are only looked at


def ablation(args: argparse.Namespace, judges: Judges) -> None:
    """Prints the section ``ablation``."""
    name, number, wanted = ABLATED
    image = picture_of(args.data, name, number)
    scene = scene_for(image)
    start = shown(image, scene)
    settings = Settings(wanted, str(args.denoiser), steps=args.steps, guidance=args.guidance)
    everything = replace(
        scene, black=torch.zeros_like(start), share=torch.ones_like(scene.share),
        index=torch.arange(scene.share.numel()), matrix=None,
    )  # fmt: skip
    made = image.layers["object"].generated(
        wanted, guide=str(args.denoiser), steps=args.steps, guidance=args.guidance
    )
    results = {
        "pixels": distilled(everything, start, settings),
        "pixels of the layer": distilled(scene, start, settings),
        "texture": shown(from_bytes(made.to_bytes()), scene),
    }
    outside = (scene.share == 0)[None].expand(3, -1, -1)
    print("| what learns | probability | error | change outside | grain |")
    print("|---|---|---|---|---|")
    for label, found in {"nothing": start, **results}.items():
        figures = judges.figures(found, scene, wanted)
        change = float((found - start)[outside].abs().mean()) * 255
        print(f"| {label} | {figures.probability:.3f} | {figures.error:+.4f} | {change:.2f} "
              f"| {255 * grain(found, scene):.1f} |")  # fmt: skip
    if args.pictures:
        row = torch.cat([start, *results.values()], 2).clamp(0, 1).numpy().transpose(1, 2, 0)
        raster.write(str(args.pictures / "ablation.png"), np.rint(row * 255).astype(np.uint8))


def distilled(scene: Scene, start: Tensor, settings: Settings) -> Tensor:
    """Scene [3, h, w] after distillation of its pixels."""
    run = Run()
    work = Distillation(
        Pixels(start, scene), scene, guide_for(Wishes(settings, run)), settings, run
    )
    work.go("")
    with torch.no_grad():
        return work.image()


def grain(image: Tensor, scene: Scene) -> float:
    """Root mean square difference of pixels of the layer from the mean of 3x3 around them."""
    smooth = torch.nn.functional.avg_pool2d(image[None], 3, 1, 1)[0]
    away: NDArray[np.float32] = ((image - smooth) ** 2).mean(0)[scene.share > 0.99].numpy()
    return math.sqrt(float(away.mean()))


def main() -> None:
    """Runs the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("data", type=Path)
    parser.add_argument("--denoiser", type=Path, required=True)
    parser.add_argument("--judge", type=Path, required=True)
    parser.add_argument("--pictures", type=Path)
    parser.add_argument("--only", default="pairs,ablation")
    parser.add_argument("--steps", type=int, default=400)
    parser.add_argument("--guidance", type=float)
    parser.add_argument("--threads", type=int, default=2)
    args = parser.parse_args()
    torch.set_num_threads(args.threads)
    print(header(args.data))
    judges = Judges(emoji_classifier.load(args.judge), load(args.denoiser))
    if args.pictures:
        args.pictures.mkdir(parents=True, exist_ok=True)
    for section in args.only.split(","):
        {"pairs": pairs, "ablation": ablation}[section](args, judges)


if __name__ == "__main__":
    main()

"""Figures of the implicit coder: fitting, quantization, layers, speed and memory.

    python -m benchmarks.figures DATA [--only float quantized layers encode decode] [--quick]

DATA is a folder with kodak/ (24 PNG), kodak_masks/ (label PNGs), photo/ and photo2k/.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path

import numpy as np

from benchmarks.common import centre_crop, header, kodak, read_rgb, run_limited
from proxyimg_codec import encode
from proxyimg_codec.bench.paper import ours
from proxyimg_codec.encoder.implicit import fit
from proxyimg_codec.encoder.implicit.fit_problem import build
from proxyimg_codec.encoder.settings import Settings
from proxyimg_codec.encoder.shapes.mask_files import load_masks
from proxyimg_codec.io.psnr import psnr_8bit
from proxyimg_codec.io.samples import to_float

FLOAT_GRID = 83
FLOAT_STEPS = 16000
ENLARGED_STEPS = 24000
TARGETS = {"kodim23": 35.5, "kodim15": 33.5, "kodim05": 28.3}


def float_figures(data: Path, quick: bool) -> None:
    """Prints figures of one layer before quantization, of centre crops and enlarged photos."""
    print("\nfloat: 512x512 centre crops, one layer, before quantization")
    values = []
    for path in kodak(data):
        if quick and path.stem not in TARGETS:
            continue
        found = ours.direct(centre_crop(read_rgb(path)), FLOAT_GRID, FLOAT_STEPS)
        values.append(found.psnr)
        target = f" (target {TARGETS[path.stem]})" if path.stem in TARGETS else ""
        print(f"  {path.stem} {found.psnr:.2f} dB, {found.parameters} parameters, "
              f"{found.seconds:.1f} CPU-s{target}")  # fmt: skip
    print(f"  mean of {len(values)}: {np.mean(values):.2f} dB (target 31.5 over 24)")
    import cv2

    values = []
    for path in sorted((data / "photo").iterdir())[: 1 if quick else None]:
        pixels = read_rgb(path)
        crop = centre_crop(pixels, min(512, *pixels.shape[:2]))
        photo = cv2.resize(crop, (256, 256), interpolation=cv2.INTER_AREA)
        enlarged = cv2.resize(photo, (512, 512), interpolation=cv2.INTER_CUBIC)
        found = ours.direct(np.asarray(enlarged, np.uint8), FLOAT_GRID, ENLARGED_STEPS)
        values.append(found.psnr)
        print(f"  {path.stem}, 256 px enlarged to 512: {found.psnr:.2f} dB, "
              f"{found.seconds:.1f} CPU-s")  # fmt: skip
    print(f"  mean of {len(values)} enlarged photos: {np.mean(values):.2f} dB (target 39)")


def quantized_figures(data: Path, quick: bool) -> None:
    """Prints figures of files with 4-bit codes and 8-bit weights, and of the fits before."""
    settings = Settings(quality=47, effort=6, max_layers=1, feature_bits=4, net_bits=8)
    print(f"\nquantized: whole files, {settings}")
    drops = []
    for path in kodak(data):
        if quick and path.stem not in TARGETS:
            continue
        crop = centre_crop(read_rgb(path))
        shape = settings.network(crop.shape[0] * crop.shape[1], 3)
        problem = build(to_float(crop)[0], [None], shape, settings.spacing)
        half = settings.steps // 2
        state = fit.fit_float(problem, fit.make_trainer(problem, "cpu", 2), half, 0)
        out = ours.evaluate(problem, state).reshape(crop.shape)
        before = psnr_8bit(crop, np.rint(np.clip(out, 0, 1) * 255).astype(np.uint8)) or 99.0
        image = encode(crop, settings)  # begins with the same float fit
        after = psnr_8bit(crop, image.render()) or 99.0
        drops.append(before - after)
        size = len(image.to_bytes())
        print(f"  {path.stem} {after:.2f} dB in {size} bytes; float {before:.2f} dB")
    print(f"  mean drop {np.mean(drops):.2f} dB (target 1.9; kodim23: 33.5 dB in 27000 bytes)")


def layer_figures(data: Path, quick: bool) -> None:
    """Prints figures of layers from label maps, and of one layer interpolated to the same size."""
    print("\nlayers: PSNR of layered files against one layer at equal size (target -0.7 dB mean)")
    gaps = []
    for path in sorted((data / "kodak_masks").glob("*.png"))[: 4 if quick else None]:
        pixels = read_rgb(data / "kodak" / path.name)
        h, w = pixels.shape[:2]
        crop = centre_crop(pixels)
        y, x = (h - 512) // 2, (w - 512) // 2
        regions = []
        for region in load_masks(path, w, h):
            part = region.mask[y : y + 512, x : x + 512]
            if part.any():
                regions.append(type(region)(region.name, part))
        layered = encode(crop, masks=regions, effort=4, texture="implicit")
        size = len(layered.to_bytes())
        value = psnr_8bit(crop, layered.render()) or 99.0
        curve = []
        for quality in (44, 50, 56):
            single = encode(crop, quality=quality, max_layers=1, effort=4, texture="implicit")
            curve.append((len(single.to_bytes()), psnr_8bit(crop, single.render()) or 99.0))
        sizes, values = np.log([s for s, _ in curve]), [v for _, v in curve]
        slope, offset = np.polyfit(sizes, values, 1)
        one = float(slope * np.log(size) + offset)
        gaps.append(value - one)
        print(f"  {path.stem}: {len(layered.layers)} layers {size} bytes {value:.2f} dB, "
              f"one layer {one:.2f} dB: {gaps[-1]:+.2f}")  # fmt: skip
    print(f"  mean {np.mean(gaps):+.2f} dB")


ENCODE = """
import time
from benchmarks.common import centre_crop, read_rgb
from proxyimg_codec import encode
pixels = read_rgb({path!r})
pixels = centre_crop(pixels) if {crop} else pixels
t = time.perf_counter()
image = encode(pixels, texture="implicit")
n = pixels.shape[0] * pixels.shape[1]
print(f"{{pixels.shape[1]}}x{{pixels.shape[0]}}: {{time.perf_counter() - t:.1f}} s wall, "
      f"{{len(image.to_bytes()) * 8 / n:.3f}} bpp", n)
"""


def encode_figures(data: Path, quick: bool) -> None:
    """Prints time and memory of encoding at defaults in a process: 512x512 and a large photo."""
    print("\nencode at defaults (targets: 40 s, 1.5 GB; 4 GB)")
    large = sorted((data / "photo2k").glob("*.webp"))[0]
    for path, crop in ((data / "kodak/kodim23.png", True), (large, False)):
        text, peak, cpu = run_limited(ENCODE.format(path=str(path), crop=crop))
        said, pixels = text.rsplit(" ", 1)
        print(f"  {said}, {cpu:.1f} CPU-s, {1e6 * cpu / int(pixels):.1f} CPU-us a pixel, "
              f"peak {peak:.2f} GB")  # fmt: skip


DECODE = """
import time
import proxyimg_codec as pxi
from proxyimg_codec.render import engines
t = time.process_time()
image = pxi.open({path!r})
[layer.texture.table for layer in image.layers]
loaded = time.process_time() - t
image.render(engine={engine!r}, region=(0, 0, 64, 64))
best = 9e9
for _ in range({runs}):
    image.cache.clear()
    t = time.process_time()
    image.render(engine={engine!r}, scale={scale})
    best = min(best, time.process_time() - t)
n = image.width * image.height * {scale} ** 2
print(f"open {{loaded:.3f}} s, render {{best:.3f}} s = {{n / best / 1e6:.2f}} Mpx/s, "
      f"both {{n / (best + loaded) / 1e6:.2f}} Mpx/s")
"""


def decode_figures(data: Path, quick: bool) -> None:
    """Prints CPU times of opening (entropy decoding) and rendering on one thread."""
    import tempfile

    print("\ndecode 512x512, one thread (targets: numpy 0.7, ort 2 Mpx/s; 4096x4096 in 1 GB)")
    with tempfile.TemporaryDirectory() as folder:
        for name, layers in (("one layer", 1), ("default layers", 4)):
            path = Path(folder) / "a.pxi"
            crop = centre_crop(read_rgb(data / "kodak/kodim23.png"))
            encode(crop, max_layers=layers, effort=3, texture="implicit").save(path)
            for engine in ("numpy", "ort", "native"):
                code = DECODE.format(path=str(path), engine=engine, runs=5, scale=1)
                text, _, _ = run_limited(code, threads=1)
                print(f"  {name}, {engine}: {text}")
        code = DECODE.format(path=str(path), engine="numpy", runs=1, scale=8)
        text, peak, _ = run_limited(code, threads=1)
        print(f"  4096x4096, numpy: {text}, peak {peak:.2f} GB")


SECTIONS: dict[str, Callable[[Path, bool], None]] = {
    "float": float_figures,
    "quantized": quantized_figures,
    "layers": layer_figures,
    "encode": encode_figures,
    "decode": decode_figures,
}


def main() -> None:
    """Runs the command line."""
    p = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    p.add_argument("data", type=Path, help="folder with kodak, kodak_masks, photo, photo2k")
    p.add_argument("--only", nargs="+", choices=list(SECTIONS), default=list(SECTIONS))
    p.add_argument("--quick", action="store_true", help="a few pictures")
    args = p.parse_args()
    print(header(args.data))
    for name in args.only:
        SECTIONS[name](args.data, args.quick)


if __name__ == "__main__":
    main()

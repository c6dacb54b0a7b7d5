"""Encoding beside other programs, and in bfloat16: python -m benchmarks.encoder PICTURE ...

`beside` encodes a picture alone, twice at once, and beside a busy process, in turn; the medians of
the ratios are printed. `bfloat16` encodes for MS-SSIM, which torch does, with convolutions in
float32 and in bfloat16. Both take the central 256x256 pixels of each picture.
"""

from __future__ import annotations

import argparse
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from proxyimg_codec.io.png import encode_ppm

from .common import Pixels, centre_crop, header, read_rgb

SIDE = 256
"""Side of the part of a picture that is encoded, in pixels."""

ENCODE = "import sys; from proxyimg_codec.cli import encode; sys.exit(encode.main(sys.argv[1:]))"
BUSY = "while True: pass"


def main() -> None:
    """Runs the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("pictures", type=Path, nargs="+")
    parser.add_argument("--only", choices=("beside", "bfloat16"))
    parser.add_argument("--effort", type=int, default=3)
    parser.add_argument("--runs", type=int, default=5)
    args = parser.parse_args()
    print(header(args.pictures[0].parent))
    for path in args.pictures:
        pixels = centre_crop(read_rgb(path), SIDE)
        if args.only != "bfloat16":
            print(f"{path.stem}: {beside(pixels, args.effort, args.runs)}", flush=True)
        if args.only != "beside":
            for name, fast in (("float32", False), ("bfloat16", True)):
                print(f"{path.stem} {name}: {precision(pixels, args.effort, fast)}", flush=True)


def beside(pixels: Pixels, effort: int, runs: int) -> str:
    """Ratios of encoding beside others to encoding alone, in a sentence."""
    alone, cpu, wall = [], [], []
    with tempfile.TemporaryDirectory() as folder:
        source = Path(folder) / "in.ppm"
        source.write_bytes(encode_ppm(pixels))

        def start(number: int) -> subprocess.Popen[bytes]:
            target = str(Path(folder) / f"{number}.pxi")
            words = [str(source), target, "-e", str(effort), "-f", "--quiet"]
            return subprocess.Popen([sys.executable, "-c", ENCODE, *words])

        for _ in range(runs):
            idle = spent([start(0)])
            alone.append(idle)
            cpu.append(spent([start(0), start(1)])[0] / (2 * idle[0]))
            busy = subprocess.Popen([sys.executable, "-c", BUSY])
            try:
                wall.append(spent([start(0)])[1] / idle[1])
            finally:
                busy.kill()
                busy.wait()
    seconds = [statistics.median(v) for v in zip(*alone, strict=True)]
    return (
        f"alone {seconds[0]:.2f} CPU-s in {seconds[1]:.2f} s; two at once take "
        f"{statistics.median(cpu):.2f} times the CPU time, one beside a busy process "
        f"{statistics.median(wall):.2f} times the wall time"
    )


def spent(processes: list[subprocess.Popen[bytes]]) -> tuple[float, float]:
    """CPU seconds and wall seconds of processes, just started, until all have ended."""
    started, cpu = time.perf_counter(), 0.0
    for process in processes:
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        if process.returncode:
            sys.exit("encoding failed")
        cpu += usage.ru_utime + usage.ru_stime
    return cpu, time.perf_counter() - started


def precision(pixels: Pixels, effort: int, fast: bool) -> str:
    """PSNR, bytes and CPU seconds of encoding with or without bfloat16, in a sentence."""
    import proxyimg_codec as pxi
    from proxyimg_codec.bench.measure import psnr
    from proxyimg_codec.encoder.pyramid import load
    from proxyimg_codec.encoder.pyramid.encode import NUMBER

    model = load.load(NUMBER)
    model.set_mode(fast=fast)
    try:
        started = time.process_time()
        image = pxi.encode(pixels, effort=effort, max_layers=1, tune="ms-ssim")
        seconds = time.process_time() - started
    finally:
        model.set_mode(fast=load.native_bfloat16())
    return (
        f"{psnr(pixels, image.render()):.2f} dB in {len(image.to_bytes())} bytes, "
        f"{seconds:.1f} CPU-s"
    )


if __name__ == "__main__":
    main()

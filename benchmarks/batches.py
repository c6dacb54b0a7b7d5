"""Time of encoding many pictures: in one thread, in two threads of a process, in two processes.

    python -m benchmarks.batches DATA [--side 256] [--effort 1]

DATA is a folder with kodak/ (24 PNG), of which copies are encoded whose longest side is `side`.
Besides the wall clock it prints CPU seconds, and those of the busiest thread: on a machine that
others use, too, these say how long it would take on idle cores. For processes that is their mean,
because they take one picture after the other.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

from benchmarks.common import header, kodak, read_rgb
from proxyimg_codec.io import raster

BATCH = "main([folder, '-o', out, *flags, '-j', '{}'])"
EACH = """for name in sorted(os.listdir(folder)):
    main([os.path.join(folder, name), '-o', out, *flags, '-j', '2'])"""
WAYS = {
    "one thread": (BATCH.format(1), 0),
    "two threads, one picture after the other": (EACH, 0),
    "two processes": (BATCH.format(2), 2),
}
"""What is run, and the number of processes that it starts."""

PROGRAM = """
import json, os, resource, sys, time
folder, out, *flags = sys.argv[1:]
if __name__ == "__main__":
    started = time.perf_counter()
    from proxyimg_codec.cli.encode import main
    {}
    wall = time.perf_counter() - started
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    thread = resource.getrusage(resource.RUSAGE_THREAD)
    spent = [v.ru_utime + v.ru_stime for v in (*used, thread)]
    print(json.dumps([wall, *spent]))
"""


def main() -> None:
    """Prints the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("data", type=Path)
    parser.add_argument("--side", type=int, default=256)
    parser.add_argument("--effort", default="1")
    args = parser.parse_args()
    print(header(args.data))
    print("| 24 pictures | wall s | CPU s | busiest thread, CPU s | times as fast |")
    print("|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place, "in")
        folder.mkdir()
        for path in kodak(args.data):
            pixels = read_rgb(path)
            step = -(-max(pixels.shape) // args.side)
            raster.write(folder / path.name, pixels[::step, ::step].copy())
        first = 0.0
        for name, (code, processes) in WAYS.items():
            out = f"{Path(place, name.split(',')[0])}/"
            wall, own, others, thread = run(code, folder, out, args.effort)
            busiest = max(thread, others / processes) if processes else thread
            first = first or busiest
            print(f"| {name} | {wall:.1f} | {own + others:.1f} | {busiest:.1f} "
                  f"| {first / busiest:.2f} |", flush=True)  # fmt: skip


def run(code: str, folder: Path, out: str, effort: str) -> tuple[float, float, float, float]:
    """Runs one way: seconds of wall clock, and CPU seconds of it, its children, its main thread."""
    program = Path(out[:-1] + ".py")
    program.write_text(PROGRAM.format(code.replace("\n", "\n    ")))
    command = [sys.executable, str(program), str(folder), out, "-e", effort, "--quiet"]
    root = str(Path(__file__).parents[1])
    paths = [root, *filter(None, [os.environ.get("PYTHONPATH")])]
    env = {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}
    env.pop("OMP_NUM_THREADS", None)
    ran = subprocess.run(command, env=env, stdout=subprocess.PIPE, check=True)
    wall, own, others, thread = json.loads(ran.stdout)
    return wall, own, others, thread


if __name__ == "__main__":
    main()

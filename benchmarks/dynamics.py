"""The simulation of motion over many steps: what it promises, and what it costs.

    OMP_NUM_THREADS=1 python -m benchmarks.dynamics [--steps N] [--nodes N] [--only PRESET ...]

Three layers (a figure with thin limbs, a disc and a sheet as large as a canvas of 512 x 512) move
by each preset in a loop of 4 s, with repeating forces. For each preset a line has

- energy: largest excess of the total energy over its initial value plus the work done so far by
  wind, impulses, drag and handles, relative to the largest total energy; it is bounded if not
  above 0;
- pins: largest displacement of a pinned node, px;
- area: largest relative change of the area of a layer, and least area of a triangle relative to
  rest, which is below 0 if one turned over;
- mean: displacement, mean over nodes and steps, px;
- loop: largest movement of a node from the last frame to the first, relative to the largest
  between other frames; a seam shows above 1;
- step: CPU ms of a step without these measures, least of 10 runs.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.common import header
from proxyimg_codec.animate.motion import PRESETS, Motion, preset
from proxyimg_codec.animate.simulate import Body, simulate
from proxyimg_codec.animate.system import System

Real = NDArray[np.float64]
Inside = Callable[[Real, Real], NDArray[np.bool_]]
CANVAS = (512, 512)


def figure(x: Real, y: Real) -> NDArray[np.bool_]:
    """Whether points x, y lie in a figure of head, trunk, arms and legs amid the canvas."""
    x = np.abs(x - 256)
    trunk = (np.hypot(x, y - 120) < 50) | ((x < 45) & (y > 160) & (y < 330))
    legs = (np.abs(x - 28) < 16) & (y >= 310) & (y < 470)
    return np.asarray(trunk | legs | ((np.abs(y - 210) < 14) & (x < 95)))


def layers(count: int) -> list[Body]:
    """Makes the three layers, with about `count` nodes in all."""
    shapes: dict[str, Inside] = {
        "figure": figure,
        "disc": lambda x, y: np.hypot(x - 256, y - 256) < 150,
        "sheet": lambda x, y: np.isfinite(x + y),
    }
    parts = {"figure": 0.22, "disc": 0.3, "sheet": 0.48}
    bodies = []
    for name, inside in shapes.items():
        pitch = 20.0
        for _ in range(4):
            body = mesh(name, inside, pitch)
            pitch *= np.sqrt(len(body.nodes) / (parts[name] * count))
        bodies.append(mesh(name, inside, pitch))
    return bodies


def mesh(name: str, inside: Inside, pitch: float) -> Body:
    """Makes a body of the triangles of a jittered lattice whose centres are inside a shape.

    Args:
        name: Name of the body.
        inside: Whether points x, y are inside the shape.
        pitch: Distance of nodes in pixels.
    """
    rise = pitch * np.sqrt(0.75)
    across, down = int(CANVAS[0] / pitch) + 2, int(CANVAS[1] / rise) + 2
    y, x = np.mgrid[:down, :across]
    nodes = np.stack([(x + y % 2 / 2) * pitch, y * rise], axis=2).reshape(-1, 2)
    nodes += np.random.default_rng(0).uniform(-0.15, 0.15, nodes.shape) * pitch
    a = (y * across + x)[:-1, :-1].ravel()
    b, c, d = a + 1, a + across, a + across + 1
    odd = (y % 2)[:-1, :-1].ravel() == 1
    upper = np.stack([a, b, np.where(odd, d, c)], axis=1)
    lower = np.stack([np.where(odd, a, b), d, c], axis=1)
    faces = np.concatenate([upper, lower])
    faces = faces[inside(*nodes[faces].mean(1).T)]
    used, index = np.unique(faces, return_inverse=True)
    return Body(name, nodes[used], index.reshape(-1, 3))


def measure(bodies: list[Body], motion: Motion, steps: int) -> str:
    """Simulates the steps of a motion, and returns the line of its measures."""
    system = System(bodies, motion, CANVAS, measured=True)
    still = system.w == 0
    for *_, led in system.curves:
        still[led] = False
    first, excess, top = system.energy(), -np.inf, 0.0
    pins, area, least, mean = 0.0, 0.0, np.inf, 0.0
    for _ in range(steps):
        system.step()
        energy = system.energy()
        excess, top = max(excess, energy - first - system.work), max(top, energy)
        away = system.x - system.rest
        pins = max(pins, float(np.abs(away[:, still]).max(initial=0)))
        mean += float(np.hypot(*away).mean()) / steps
        for body, part in zip(bodies, system.parts, strict=True):
            now = Body(body.name, system.x[:, part].T, body.faces).areas
            area = max(area, abs(now.sum() / body.areas.sum() - 1))
            least = min(least, float((now / body.areas).min()))
    return (
        f"energy {excess / top:+.1e}  pins {pins:.0e}  area {100 * area:4.1f} % {least:5.2f}  "
        f"mean {mean:4.1f} px"
    )


def seam(bodies: list[Body], motion: Motion) -> float:
    """Movement from the last frame to the first, relative to the largest between other frames."""
    frames = simulate(bodies, motion, canvas=CANVAS).displacements
    every = np.concatenate(list(frames.values()), axis=1)
    steps = np.abs(np.roll(every, -1, axis=0) - every).max((1, 2))
    return float(steps[-1] / steps[:-1].max())


def cost(bodies: list[Body], motion: Motion) -> float:
    """CPU milliseconds of a step: the least of 10 means over 100 steps."""
    system, spent = System(bodies, motion, CANVAS), []
    for _ in range(10):
        start = time.process_time()
        for _ in range(100):
            system.step()
        spent.append(10 * (time.process_time() - start))
    return min(spent)


def main() -> None:
    """Runs the command line: prints a line for each preset."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--steps", type=int, default=10_000)
    parser.add_argument("--nodes", type=int, default=1600)
    parser.add_argument("--only", nargs="+", choices=list(PRESETS), default=list(PRESETS))
    args = parser.parse_args()
    print(header(Path("synthetic")))
    bodies = layers(args.nodes)
    counts = ", ".join(f"{b.name} {len(b.nodes)}" for b in bodies)
    boxes = {b.name: (*b.nodes.min(0), *b.nodes.max(0)) for b in bodies}
    print(f"{args.steps} steps of each preset; nodes: {counts}")
    for name in args.only:
        motion = preset(name, boxes)
        line = measure(bodies, motion, args.steps)
        loop, step = seam(bodies, motion), cost(bodies, motion)
        print(f"{name:7s} {line}  loop {loop:.2f}  step {step:.2f} ms", flush=True)


if __name__ == "__main__":
    main()

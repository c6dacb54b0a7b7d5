"""Encoding that meets a target: a size of the whole file, or a PSNR of the decoded picture.

The size of a file is nearly exponential in the index of the quantization step, and so is the
squared error. Estimates of both from latents that are not refined lead to a step. After the first
rounds of refinement, estimates are better: the price of a bit is changed, or if they are far off,
refinement begins anew. What is coded is measured; if it misses, rounds at other prices follow.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from ...codec.write import serialized, to_bytes
from ...errors import UsageError
from ...model import Picture
from ...render.quality import psnr
from ...texture.latents import Latents
from ...texture.network import Floats
from ...texture.planes import Planes, encoded
from ..settings import Settings
from .encode import NUMBER, TRIAL, Job, Raster
from .goal import RATE_WEIGHT, Effort

SLOPES = {"size": (-0.013, -0.0095), "bpp": (-0.013, -0.0095), "psnr": (-0.013, -0.013)}
"""Usual change of a deviation, see `Aim.off`, by an index of the step, towards coarser and towards
finer steps."""

WITHIN = {"size": (-0.02, 0.0), "bpp": (-0.02, 0.0), "psnr": (-0.02, 0.02)}
"""Least and greatest deviation that is good enough."""

FIRST_STEP, LAST_STEP = 0, 640
"""Range of the index s of the quantization step 2**(s / 64)."""

PROBES, NEAR = 4, 32
"""Most steps at which pictures are analysed, and distance of steps between which latents are only
scaled."""

TRIES, CORRECTIONS = 12, 4
"""Most files that are measured, and how many of these have latents that began at the same step."""

FAR, FOLLOWS = 0.05, 0.11
"""Expected deviation from which on partly refined latents are given up, and by how much it falls
when the logarithm of the price of bits rises by 1. (To scale what is rounded loses 0.1 dB.)"""

DEAREST = 3.0
"""How many times as dear, or as cheap, bits may be as usual."""


class Aim(NamedTuple):
    """Target of an encoding.

    Attributes:
        kind: ``size`` in bytes, ``bpp`` in bits a pixel, or ``psnr`` in dB.
        wanted: The value.
        original: float32 [H, W, 4] in 0..1 with straight alpha: how the picture should look.
        fixed: Bytes of a file without the streams of its planes.
    """

    kind: str
    wanted: float
    original: Floats
    fixed: int

    def off(self, image: Picture) -> float:
        """Deviation: of the logarithm of the size, or of PSNR / 5 dB; positive if it is more."""
        if self.kind == "psnr":
            opaque = self.original[..., 3].min() == 1
            found = psnr(self.original[..., :3] if opaque else self.original, image)
            return ((99.0 if found is None else found) - self.wanted) / 5
        return self._by_size(len(to_bytes(image)))

    def expected(self, jobs: Sequence[Job], shown: Sequence[Raster]) -> float:
        """Estimate of `off` for latents as they are.

        Args:
            jobs: The latents of all rasters.
            shown: The first rasters, which show in the picture at rest.
        """
        if self.kind == "psnr":
            each = [_squared_error(*both) for both in zip(jobs, shown, strict=False)]
            error, count = map(sum, zip(*each, strict=True))
            return (10 * math.log10(255**2 * count / max(error, 1e-9)) - self.wanted) / 5
        return self._by_size(self.fixed + sum(map(_bytes, jobs)))

    @property
    def low(self) -> float:
        """Least deviation that is good enough."""
        return WITHIN[self.kind][0]

    @property
    def high(self) -> float:
        """Greatest deviation that is good enough."""
        return WITHIN[self.kind][1]

    @property
    def middle(self) -> float:
        """Deviation to aim at."""
        return (self.low + self.high) / 2

    def worth(self, error: float) -> float:
        """Rank of a deviation that is not good enough; 0 if it is of no use."""
        if self.kind == "psnr":
            return max(1 - abs(error) / 0.1, 0)
        return math.exp(error) if error < 0 else 0

    def _by_size(self, size: float) -> float:
        pixels = self.original[..., 0].size
        return math.log((8 * size / pixels if self.kind == "bpp" else size) / self.wanted)


def aimed(
    rasters: Sequence[Raster], shown: int, picture_of: Callable[[Sequence[Planes]], Picture],
    original: Floats, settings: Settings, effort: Effort, tick: Callable[[int], None],
) -> Picture:  # fmt: skip
    """Encodes rasters so that the picture made of them meets the target of the settings.

    On `KeyboardInterrupt` refinement stops, and the picture has the latents found so far.

    Args:
        rasters: The rasters.
        shown: Number of rasters, the first ones, that show in the picture at rest.
        picture_of: Makes the picture of the planes of all rasters.
        original: float32 [H, W, 4] in 0..1 with straight alpha: how the picture should look.
        settings: Settings with a target.
        effort: Duration of refinement.
        tick: Called with the number of samples of a window after each step of its refinement.

    Raises:
        UsageError: The target is out of reach.
    """
    assert settings.target is not None, "there is a target"
    aim = Aim(*settings.target, original, _fixed_bytes(picture_of, len(rasters)))
    search = _Search(aim, rasters, shown, settings, effort)
    step: int | None = search.estimated()
    best: tuple[float, Picture] | None = None
    for turn in range(TRIES):
        whole = search.refine(step, first=not turn, tick=tick)
        image = picture_of([job.planes(keep=True) for job in search.jobs])
        error = aim.off(image)
        if not whole or aim.low <= error <= aim.high:
            return image
        if aim.worth(error) > (aim.worth(best[0]) if best else 0):
            best = error, image
        if step is not None:
            search.seen.append((step, error))
        step = search.next(error, turn)
        if any(step == s for s, _ in search.seen):
            break
    if best is None:
        raise UsageError(f"target {aim.kind} {aim.wanted:g} is out of reach for this picture")
    return best[1]


class _Search:
    """Search for the step that meets a target.

    Attributes:
        jobs: Latents of all rasters.
        seen: Steps at which latents began, and deviations of what they became.
    """

    def __init__(
        self, aim: Aim, rasters: Sequence[Raster], shown: int, settings: Settings, effort: Effort
    ) -> None:
        self.aim, self.rasters, self.shown = aim, rasters, shown
        self.settings, self.effort = settings, effort
        self.jobs: list[Job] = []
        self.seen: list[tuple[int, float]] = []

    def estimated(self) -> int:
        """Step that seems right before anything is refined; latents are those of one near it."""
        step, tried = self.settings.step, list[tuple[int, float]]()
        for _ in range(PROBES):
            self._begin(step)
            tried.append((step, self._expected()))
            better = self._between(tried)
            if abs(better - step) <= NEAR:
                break
            step = better
        return better

    def refine(self, step: int | None, first: bool, tick: Callable[[int], None]) -> bool:
        """Refines latents.

        Args:
            step: Index of the step at which to begin; None to go on with what was refined.
            first: Whether latents are there that were not refined, and the step is an estimate.
            tick: As for `aimed`.

        Returns:
            Whether refinement ran to its end.
        """
        if step is None:
            parts = [[Effort(-(-self.effort.steps // 4), 1)]] * len(self.jobs)
        else:
            parts = [_parts(r.effort(self.effort), r.structural) for r in self.rasters]
            if first:
                for job in self.jobs:
                    job.rescale(step)
            else:
                self._begin(step)
        stages = list(itertools.zip_longest(*parts))
        try:
            self._run(stages[0], tick)
            if first and len(stages) > 1 and stages[1][0]:
                error = self._refined()
                if abs(error) > FAR:
                    self._begin(self._moved(error, self.jobs[0].step))
                    self._run(stages[0], tick)
                    error = self._refined()
                self._pay(error / FOLLOWS)
            for stage in stages[1:]:
                self._run(stage, tick)
        except KeyboardInterrupt:
            return False
        return True

    def _run(self, stage: Sequence[Effort | None], tick: Callable[[int], None]) -> None:
        """Refines the latents of each raster that has a part in a stage."""
        for job, part in zip(self.jobs, stage, strict=True):
            if part:
                job.refine_all(part, self.settings.seed, tick)

    def _refined(self) -> float:
        """Deviation from what is aimed at that is expected of latents that are partly refined."""
        for job in self.jobs:
            job.find_shifts()
        return self._expected()

    def next(self, error: float, turn: int) -> int | None:
        """Prepares for another try after a deviation.

        Returns:
            The step at which to begin anew; None if prices have changed, for a round more.
        """
        done, step = self.jobs[0].done, self.jobs[0].step
        by = (error + self._gain(done, done + 1) - self.aim.middle) / _follows(self.aim.kind, step)
        ended = step == (LAST_STEP if error > 0 else FIRST_STEP)
        if turn % CORRECTIONS < CORRECTIONS - 1 and not ended and self._pay(by):
            return None
        return self._between([(s, e - self.aim.middle) for s, e in self.seen])

    def _pay(self, by: float) -> bool:
        """Raises the price of bits by a logarithm; False if it would be too far from the usual."""
        price = self.jobs[0].price * math.exp(by)
        fits = 1 / DEAREST <= price / RATE_WEIGHT <= DEAREST
        for job in self.jobs:
            job.price = min(max(price, RATE_WEIGHT / DEAREST), RATE_WEIGHT * DEAREST)
        return fits

    def _begin(self, step: int) -> None:
        self.jobs.clear()  # they make room first
        jobs = self.settings.jobs
        self.jobs += [Job(NUMBER, r.bordered(step), step, jobs) for r in self.rasters]

    def _expected(self) -> float:
        """Deviation from what is aimed at that is expected of latents once they are refined."""
        gain = self._gain(self.jobs[0].done, self.effort.rounds)
        return self.aim.expected(self.jobs, self.rasters[: self.shown]) + gain - self.aim.middle

    def _gain(self, done: int, rounds: int) -> float:
        kind, step = self.aim.kind, self.jobs[0].step
        return _gained(kind, rounds, step) - _gained(kind, done, step)

    def _moved(self, error: float, step: int) -> int:
        """Step at which a deviation at another is likely 0."""
        return _bounded(step - error / SLOPES[self.aim.kind][error < 0])

    def _between(self, tried: Sequence[tuple[int, float]]) -> int:
        """Step at which the deviation is likely 0, by those at other steps."""
        over = max((t for t in tried if t[1] > 0), default=None)
        under = min((t for t in tried if t[1] <= 0), default=None)
        if over is None or under is None or over[0] >= under[0]:
            return self._moved(tried[-1][1], tried[-1][0])
        share = over[1] / (over[1] - under[1])
        return _bounded(over[0] + min(max(share, 0.1), 0.9) * (under[0] - over[0]))


def _bounded(step: float) -> int:
    return min(max(round(step), FIRST_STEP), LAST_STEP)


def _parts(effort: Effort, structural: bool) -> list[Effort]:
    """Parts of refinement, between which the step is corrected."""
    first = 0 if structural else min(effort.rounds // 2, TRIAL)
    rest = effort._replace(rounds=effort.rounds - first)
    return [effort._replace(rounds=first), rest] if first else [rest]


def _gained(kind: str, rounds: int, step: int) -> float:
    """Usual change of a deviation by rounds of refinement, as measured on five photographs."""
    if not rounds:
        return 0.0
    coarser = (step - 320) / 100
    if kind == "psnr":
        return (0.152 - 0.037 * coarser) * (1 - 0.7 * 2.0**-rounds)
    return 0.021 + 0.0285 * coarser + (0.011 if rounds == 1 else 0)


def _follows(kind: str, step: int) -> float:
    """Fall of a deviation when the logarithm of the price rises by 1, with one round to come."""
    return 0.075 if kind == "psnr" else max(0.06 + 0.03 * (step - 320) / 100, 0.02)


def _fixed_bytes(picture_of: Callable[[Sequence[Planes]], Picture], count: int) -> int:
    """Bytes of a picture whose planes are tiny, without their streams."""
    zeros = np.zeros((9, 4, 4), np.int32)
    tiny = encoded(Latents((zeros,), zeros[:3]), (8, 8), 320)
    return len(serialized(picture_of([tiny] * count))) - count * len(tiny.packed["data"])


def _bytes(job: Job) -> float:
    """Estimate of the bytes of the streams of a job's planes."""
    plane = np.rint(job.latents[-1][: 1 if job.raster.grey else 3])
    mean = np.abs(np.diff(plane, axis=2)).mean() if plane.shape[2] > 1 else 1.0
    return (job.bits + plane.size * math.log2(2 * math.e * (mean + 0.3))) / 8


def _squared_error(job: Job, raster: Raster) -> tuple[float, int]:
    """Sum of the squared errors of samples, in levels of 8 bits, by the weights of a raster.

    Returns:
        The sum, and the number of samples.
    """
    error = np.rint(job.samples() * np.float32(255))
    error -= raster.samples
    by_pixel = np.einsum("yxc,yxc->yx", error, error)
    if raster.weight is not None:
        by_pixel *= raster.weight
    components = 1 if raster.grey else 3
    return float(by_pixel.sum(dtype=np.float64)) * components / 3, by_pixel.size * components

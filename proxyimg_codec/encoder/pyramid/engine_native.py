"""Engine of the encoder in the compiled kernel (`native/refine.h`), without torch.

`engine_torch` is its judge.
"""

from __future__ import annotations

import ctypes as ct
import functools
from collections.abc import Callable, Sequence
from importlib import resources
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import LimitError
from ...native import kernel
from ...texture.grid import Grid
from ...texture.network import Floats
from ...texture.registered_model import (
    STEP_ORIGIN,
    Context,
    Synthesis,
    registered,
    registration,
)
from ...texture.synthesis import axis_filters, wavelet
from ...texture.watch import WATCH
from .curvature import bends
from .filters import analysis_wavelet
from .goal import FIRST_SHARE, HESITATION, RAMP, SURE, Effort, Goal
from .shifts import SHIFTS

CONTEXT = (
    "first", "first_bias", "second", "second_bias", "causal", "mix", "mix_bias", "luma",
    "luma_bias", "from_luma", "from_luma_bias", "chroma", "chroma_bias",
)  # fmt: skip
SYNTHESIS = (
    "linear", "in", "in_bias", "between", "between_bias", "out", "out_bias", "gain",
)  # fmt: skip

ANALYSIS = SYNTHESIS[:-1]

SPARSE = (3, 1)
"""Distance of the latents, down and across, from which shifts of the scale index are found."""

STRIP = 256
"""Rows whose colours are converted at once, which bounds memory."""


class _Weights(ct.Structure):
    """Mirrors `struct RefinedWeights`."""

    _fields_ = [
        *((n, ct.c_void_p) for n in (*CONTEXT, *SYNTHESIS)),
        *((n, ct.c_int32) for n in ("context", "hidden")),
        ("shifts", ct.c_float * 2),
    ]


class _Refine(ct.Structure):
    """Mirrors `struct Refine`."""

    _fields_ = [
        *((n, ct.c_void_p) for n in ("weights", "latents", "support", "free", "picture")),
        *((n, ct.c_void_p) for n in ("weight", "bends", "colour", "axis")),
        *(
            (n, ct.c_int32)
            for n in ("levels", "rows", "columns", "rounds", "threads", "done", "sure", "ramp")
        ),
        *((n, ct.c_float) for n in ("step", "price", "share", "hesitation")),
        *((n, ct.c_void_p) for n in ("slopes", "cost")),
        ("watch", WATCH),
        ("listener", ct.c_void_p),
    ]


class _Analysis(ct.Structure):
    """Mirrors `struct Analysis`."""

    _fields_ = [
        *((n, ct.c_void_p) for n in ANALYSIS),
        *((n, ct.c_int32) for n in ("hidden", "rows", "columns", "threads")),
        *((n, ct.c_void_p) for n in ("planes", "found")),
    ]


@functools.lru_cache(maxsize=2)
def analysis_weights(number: int, step: int) -> list[dict[str, Floats]]:
    """Weights of the analysis of each set of levels, with the biases at a step."""
    name = f"{registration(number).file}-analysis.npz"
    file = resources.files("proxyimg_codec.models").joinpath(name)
    with file.open("rb") as stream, np.load(stream) as stored:
        given = {k: v.astype(np.float32) for k, v in stored.items()}
    t, out = np.float32((step - STEP_ORIGIN) / 128), []
    for k, refined in enumerate(_weights(number, step)):
        own = {"to_planes": given["to_planes"], "gain": refined["gain"]}
        own["linear"] = analysis_wavelet() + given[f"levels.{k}.analysis_delta"]
        for name, layer in (("in", "first"), ("between", "second"), ("out", "third")):
            own[name] = given[f"levels.{k}.analysis.{layer}.weight"]
            own[f"{name}_bias"] = given[f"levels.{k}.analysis.{layer}.bias"]
        own["in_bias"] = own["in_bias"] + given[f"levels.{k}.analysis.by_step"] * t
        out.append({n: np.ascontiguousarray(v, np.float32) for n, v in own.items()})
    return out


@functools.lru_cache(maxsize=2)
def _weights(number: int, step: int) -> list[dict[str, Floats]]:
    """Weights of each set of levels, with the biases at a step."""
    model = registered(number)
    return [_weights_at(*each, step) for each in zip(model.context, model.synthesis, strict=True)]


def _weights_at(context: Context, synthesis: Synthesis, step: int) -> dict[str, Floats]:
    t = np.float32((step - STEP_ORIGIN) / 128)
    out = {name: getattr(context, name).floats for name in CONTEXT}
    out["first_bias"] = out["first_bias"] + context.first_by_step.floats * 128 * t
    for name, own in (("in", "first"), ("between", "second"), ("out", "third")):
        out[name] = getattr(synthesis, own).floats
        out[f"{name}_bias"] = getattr(synthesis, f"{own}_bias").floats
    out["in_bias"] = out["in_bias"] + synthesis.first_by_step.floats * t
    out["linear"] = wavelet() + synthesis.delta.floats
    out["gain"] = np.exp(synthesis.gain.floats + synthesis.gain_by_step.floats * t)
    return {name: np.ascontiguousarray(v, np.float32) for name, v in out.items()}


class Task:
    """Task of the kernel; holds what its structure points to.

    Args:
        goal: Goal of refinement.
        latents: float32 [9, h, w] latents of levels 1, 2, ..., then the lowest planes [3, h, w];
            whole numbers, contiguous; results take their place.
        threads: Number of threads.
        bending: Whether latents move, for which it takes curvatures.
        fields: Other fields of the structure.
    """

    def __init__(
        self, goal: Goal, latents: Sequence[Floats], threads: int, bending: bool = True,
        **fields: Any,
    ) -> None:  # fmt: skip
        self._kept: list[Any] = []
        count = len(latents) - 1
        sets = _weights(goal.model, goal.step)
        levels = (_Weights * count)()
        for k in range(count):
            own = sets[min(k, len(sets) - 1)]
            for name in (*CONTEXT, *SYNTHESIS):
                setattr(levels[k], name, kernel.pointer(own[name]))
            levels[k].context, levels[k].hidden = len(own["mix"]), len(own["between"])
            for group in range(2):
                levels[k].shifts[group] = goal.shifts[2 * k + group] / 8
        self._kept += [sets, levels, latents]
        rows, columns = goal.picture.shape[1:]
        bent = bends((rows, columns), count, goal.weight) if bending else None
        colour = registered(goal.model).to_colour.floats
        self.structure = _Refine(
            weights=ct.cast(levels, ct.c_void_p), latents=self._table(latents, np.float32),
            support=self._table(goal.support, np.float32), free=self._table(goal.free, np.bool_),
            picture=self._array(goal.picture), weight=self._array(goal.weight),
            bends=self._table(bent, np.float32),
            colour=self._array(colour), axis=self._array(axis_filters().astype(np.float32)),
            levels=count, rows=rows, columns=columns, threads=threads, ramp=RAMP,
            step=2.0 ** (goal.step / 64), price=goal.price, share=FIRST_SHARE,
            hesitation=HESITATION, done=goal.done, sure=SURE,
            **fields,
        )  # fmt: skip

    def _array(self, array: NDArray[Any] | None) -> int | None:
        if array is None:
            return None
        self._kept.append(array := np.ascontiguousarray(array))
        return kernel.pointer(array)

    def _table(self, arrays: Sequence[NDArray[Any]] | None, kind: type) -> Any:
        if arrays is None:
            return None
        if any(a.dtype != kind for a in arrays):
            raise ValueError(f"the kernel takes {kind.__name__} here")
        table = (ct.c_void_p * len(arrays))(*map(self._array, arrays))
        self._kept.append(table)
        return ct.cast(table, ct.c_void_p)

    def run(self, name: str) -> None:
        """Calls a function of the kernel.

        Raises:
            LimitError: The kernel cannot allocate what it needs.
        """
        _call(name, self.structure)


def _call(name: str, structure: ct.Structure) -> None:
    lib = kernel.library()
    assert lib is not None, "check available() first"
    if getattr(lib, f"pxi_{name}")(ct.byref(structure)):
        raise LimitError("there is not enough memory to refine a pyramid")


def analysed(number: int, picture: Floats, step: int, grid: Grid, threads: int) -> list[Floats]:
    """Analyses samples; see `engine_torch.analysed`.

    Raises:
        LimitError: The kernel cannot allocate what it needs.
    """
    sets = analysis_weights(number, step)
    matrix = sets[0]["to_planes"] / np.float32(2.0 ** (step / 64))
    low = np.empty((3, *picture.shape[1:]), np.float32)
    for row in range(0, len(low[0]), STRIP):
        rows = slice(row, row + STRIP)
        low[:, rows] = np.tensordot(matrix, picture[:, rows], 1)
    low -= 128 * matrix.sum(1)[:, None, None]
    found = []
    for level in range(1, grid.levels + 1):
        own = sets[min(level, len(sets)) - 1]
        out = np.empty((12, *grid.at(level)), np.float32)
        low = np.ascontiguousarray(low, np.float32)
        task = _Analysis(
            *(kernel.pointer(own[n]) for n in ANALYSIS), len(own["between"]), *low.shape[1:],
            threads, kernel.pointer(low), kernel.pointer(out),
        )  # fmt: skip
        _call("pyramid_analysis", task)
        low, high = out[:3], out[3:]
        high /= own["gain"][:, None, None]
        found.append(high)
    return [*found, low.copy()]


def improved(
    goal: Goal, latents: Sequence[Floats], effort: Effort, seed: int, threads: int,
    tick: Callable[[], None],
) -> tuple[list[Floats], BaseException | None]:  # fmt: skip
    """Moves latents by one where that lowers the cost, round after round.

    See `engine_torch.improved`; here are no steps, so nothing is random.

    Raises:
        LimitError: The kernel cannot allocate what it needs.
    """
    rounded = [np.rint(y) for y in latents]
    found = [np.array(y, np.float32, order="C") for y in goal.held(rounded, rounded)]
    if not effort.rounds:
        return found, None
    raised: list[BaseException] = []

    def heard(_: int | None, done: int, rounds: int) -> int:
        try:
            if done:
                tick()
        except BaseException as error:  # whatever it is, the kernel has to end before it goes on
            raised.append(error)
        return len(raised)

    Task(goal, found, threads, rounds=effort.rounds, watch=WATCH(heard)).run("refine")
    return found, raised[0] if raised else None


def bits_by_shift(goal: Goal, latents: Sequence[Floats], threads: int) -> NDArray[np.float64]:
    """Bits of a sample of integer latents under each shift of the scale index.

    See `engine_torch.bits_by_shift`.

    Raises:
        LimitError: The kernel cannot allocate what it needs.
    """
    given = [np.ascontiguousarray(y) for y in latents]
    out = np.zeros((2 * (len(given) - 1), len(SHIFTS)))
    Task(goal, given, threads, bending=False, cost=kernel.pointer(out)).run("refine_tally")
    return out


def slopes(
    goal: Goal, latents: Sequence[Floats], threads: int
) -> tuple[float, float, list[Floats]]:
    """Derives the cost of integer latents.

    Args:
        goal: Goal of refinement.
        latents: float32 [9, h, w] integer latents of levels 1, 2, ..., then the lowest planes.
        threads: Number of threads; results do not depend on it.

    Returns:
        Squared error in squares of the step, bits without those of the lowest planes, and the
        slopes of the cost by each latent; what its own bits alone would give is not in them.

    Raises:
        LimitError: The kernel cannot allocate what it needs.
    """
    given = [np.array(y, np.float32, order="C") for y in latents]
    found = [np.zeros_like(y) for y in given]
    cost = np.zeros(2)
    task = Task(goal, given, threads, cost=kernel.pointer(cost))
    task.structure.slopes = task._table(found, np.float32)
    task.run("refine_slopes")
    return float(cost[0]), float(cost[1]), found

"""Trainer that uses the compiled kernel (`native/train.h`)."""

from __future__ import annotations

import ctypes as ct

import numpy as np
from numpy.typing import NDArray

from ...native import kernel
from ...texture.network import Floats
from .fit_problem import Problem
from .state import State


class _Train(ct.Structure):
    """Training problem; mirrors `struct Train` of the kernel."""

    _fields_ = [
        ("net", kernel.Net),
        ("entries", kernel.Entries),
        ("n_codes", ct.c_int64),
        *((n, ct.c_void_p) for n in ("first", "coverage", "learn", "target")),
        *((n, ct.c_void_p) for n in ("codes", "codes_m", "codes_v")),
        *((n, ct.c_void_p) for n in ("weights", "weights_m", "weights_v")),
        *((n, ct.c_void_p) for n in ("prior_row", "prior_next", "prior_weight")),
        ("n_prior", ct.c_int64),
        *((n, ct.c_void_p) for n in ("plane", "code_steps", "row_steps")),
        *((n, ct.c_int32) for n in ("code_max", "weight_max", "threads")),
    ]


class NativeTrainer:
    """`Trainer` on the CPU, whose result does not depend on the number of threads.

    Args:
        problem: The fitting problem.
        jobs: Most threads.
    """

    def __init__(self, problem: Problem, jobs: int) -> None:
        self._problem = problem
        self._jobs = jobs
        self._done = 0
        self._moments: list[Floats] = []
        self._plane = np.concatenate(
            [np.full(p.size, k, np.uint8) for k, p in enumerate(problem.planes)]
        )

    def run(
        self, state: State, pixels: NDArray[np.int32], lr_codes: Floats, lr_net: Floats
    ) -> float:
        """Runs optimizer steps; see `Trainer.run`."""
        p, at, s = self._problem, kernel.pointer, self._problem.shape
        lib = kernel.library()
        assert lib is not None
        if not self._moments:
            self._moments = [np.zeros_like(a) for a in (state.codes,) * 2 + (state.weights,) * 2]
        m = self._moments
        # Threads wait for each other twice a step, which does not pay for small batches.
        threads = min(self._jobs, max(pixels.shape[1] // 1024, 1))
        task = _Train(
            kernel.Net(s.dim, s.octaves, s.hidden, s.depth, s.channels),
            kernel.Entries(at(p.base), at(p.stride), at(p.fx), at(p.fy)),
            p.codes,
            at(p.first), at(p.coverage), at(p.learn), at(p.target),
            at(state.codes), at(m[0]), at(m[1]),
            at(state.weights), at(m[2]), at(m[3]),
            at(p.prior.rows), at(p.prior.next), at(p.prior.weight), len(p.prior.rows),
            at(self._plane), at(state.code_steps), at(state.row_steps),
            _top(state.code_bits), _top(state.net_bits), threads,
        )  # fmt: skip
        steps, batch = pixels.shape
        loss: float = lib.pxi_train(
            ct.byref(task), at(pixels), steps, batch, self._done, at(lr_codes), at(lr_net)
        )
        self._done += steps
        return loss


def _top(bits: int) -> int:
    return (1 << (bits - 1)) - 1 if bits else 0

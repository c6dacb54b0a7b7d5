"""Worker processes of one thread each, so that CPU seconds compare and results repeat."""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from typing import TypeVar

from ..errors import LimitError

Task = TypeVar("Task")
Result = TypeVar("Result")

ONE_THREAD = dict.fromkeys(
    ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMEXPR_NUM_THREADS"), "1"
)


def run(
    work: Callable[[Task], Result],
    tasks: Sequence[Task],
    jobs: int,
    finished: Callable[[Result], None],
) -> None:
    """Runs tasks in processes of one thread each, in any order.

    If `finished` raises or the user interrupts, all processes are stopped at once.

    Args:
        work: Function of a task; it can be pickled.
        tasks: The tasks; at least one.
        jobs: Number of processes.
        finished: Called with each result.

    Raises:
        LimitError: A process was killed, most likely for want of memory.
    """
    before = {name: os.environ.get(name) for name in ONE_THREAD}
    os.environ.update(ONE_THREAD)
    try:
        context = multiprocessing.get_context("spawn")
        with ProcessPoolExecutor(min(jobs, len(tasks)), context, _start) as pool:
            try:
                for future in as_completed([pool.submit(work, t) for t in tasks]):
                    finished(future.result())
            except BaseException:  # Ctrl-C too must leave no worker behind
                for process in multiprocessing.active_children():
                    process.terminate()
                pool.shutdown(cancel_futures=True)
                raise
    except BrokenProcessPool:
        raise LimitError("a worker process was killed, most likely for want of memory; "
                         "try fewer --jobs") from None  # fmt: skip
    finally:
        for name, value in before.items():
            os.environ.pop(name) if value is None else os.environ.update({name: value})


def _start() -> None:
    """Prepares a worker: Ctrl-C is left to the main process, and OpenCV uses one thread."""
    import signal

    import cv2

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    cv2.setNumThreads(1)

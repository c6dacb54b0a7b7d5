"""Pools of workers on this machine; those of clusters are in `on_dask` and `on_ray`."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from types import FrameType
from typing import Protocol

from .work import Job, Outcome, perform

THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OPENCV_FOR_THREADS_NUM")
"""Variables that say how many threads libraries use."""


class Pool(Protocol):
    """Workers that do jobs.

    Attributes:
        width: Number of jobs that are handed out at once, done or not, which bounds memory.
        lone_retry: Whether a job that was lost may be tried again, as the only one.
    """

    width: int
    lone_retry: bool

    def submit(self, job: Job) -> Future[Outcome]:
        """Hands a job out; the future has an exception only if its worker was lost."""
        ...

    def close(self, ended: bool) -> None:
        """Ends the workers; at once if the batch `ended` before all was done."""
        ...


class Here:
    """This process, which does each job when it is handed out."""

    width = 1
    lone_retry = False

    def submit(self, job: Job) -> Future[Outcome]:
        """Does a job.

        Ctrl-C ends the batch. Encoding a single picture would take it as a wish for what is found
        so far, but that is not what the settings ask for, and must not be recorded as such.
        """
        future: Future[Outcome] = Future()
        main = threading.current_thread() is threading.main_thread()
        ours = main and signal.getsignal(signal.SIGINT) is signal.default_int_handler
        if ours:
            signal.signal(signal.SIGINT, _end)
        try:
            future.set_result(perform(job))
        finally:
            if ours:
                signal.signal(signal.SIGINT, signal.default_int_handler)
        return future

    def close(self, ended: bool) -> None:
        """Does nothing."""


class Processes:
    """Processes of this machine.

    They are started anew, not forked, because threads of libraries do not survive a fork.

    Args:
        count: Number of processes.
        threads: Threads that each may use.
    """

    lone_retry = True

    def __init__(self, count: int, threads: int) -> None:
        self.width = 2 * count
        self._count = count
        self._before = {name: os.environ.get(name) for name in THREADS}
        os.environ.update(dict.fromkeys(THREADS, str(threads)))
        self._pool = self._new()

    def _new(self) -> ProcessPoolExecutor:
        context = multiprocessing.get_context("spawn")
        return ProcessPoolExecutor(self._count, context, _start)

    def submit(self, job: Job) -> Future[Outcome]:
        """Hands a job out, to new processes if one was lost."""
        try:
            return self._pool.submit(_work, job)
        except BrokenProcessPool:
            self._pool.shutdown()
            self._pool = self._new()
            return self._pool.submit(_work, job)

    def close(self, ended: bool) -> None:
        """Ends the processes; if the batch `ended`, they tidy up what they were at."""
        if ended:
            for process in multiprocessing.active_children():
                process.terminate()
        self._pool.shutdown(cancel_futures=True)
        for name, value in self._before.items():
            os.environ.pop(name) if value is None else os.environ.update({name: value})


def _end(number: int, frame: FrameType | None) -> None:
    raise SystemExit(128 + number)


def _start() -> None:
    """Prepares a worker: Ctrl-C is left to the main process, without which it ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os.kill(os.getpid(), signal.SIGTERM)


def _work(job: Job) -> Outcome:
    """Does a job in a process of the pool."""
    try:
        return perform(job)
    except SystemExit as end:  # a signal; what was unfinished is removed by now
        os._exit(int(end.code or 0))

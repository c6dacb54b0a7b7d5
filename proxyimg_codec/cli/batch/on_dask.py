"""Workers of a Dask cluster that see the same folders as this machine."""

from __future__ import annotations

import logging
from concurrent.futures import Future

from ...errors import InputError, UnsupportedError
from .work import Job, Outcome, perform

PATIENCE = 10
"""Seconds to wait for a scheduler, and for a first worker."""


class OnDask:
    """A cluster. Where a worker is lost, the scheduler gives its jobs to another.

    It gives up a job with which several workers were lost, in turn, and with it those that waited
    at the same workers; so each of these is tried again alone.

    Args:
        address: Address of the scheduler, such as ``tcp://10.0.0.1:8786``.
        jobs: Pictures at once; None for all threads of the cluster.

    Raises:
        InputError: There is no scheduler, or it has no worker.
        UnsupportedError: Dask is not installed.
    """

    lone_retry = True

    def __init__(self, address: str, jobs: int | None) -> None:
        try:
            from distributed import Client
        except ImportError:
            raise UnsupportedError("--dask needs pip install 'proxyimg-codec[dask]'") from None
        for handler in logging.getLogger("distributed").handlers:
            handler.setLevel(logging.CRITICAL)  # tracebacks about what an error here says in a line
        try:
            self._client = Client(address, timeout=PATIENCE, set_as_default=False)
        except (OSError, ValueError, TypeError) as error:
            told = " ".join(str(error).split()) or "no answer"
            raise InputError(f"--dask {address}: there is no scheduler: {told}") from None
        try:
            self._client.wait_for_workers(1, timeout=PATIENCE)
        except TimeoutError:
            self._client.close()
            raise InputError(f"--dask {address}: the cluster has no workers; start some with "
                             f"'dask worker {address}'") from None  # fmt: skip
        threads = sum(self._client.nthreads().values())
        # One more for each thread, so that none waits for the next.
        self.width = 2 * threads if jobs is None else jobs
        self._executor = self._client.get_executor(pure=False)

    def submit(self, job: Job) -> Future[Outcome]:
        """Hands a job out."""
        future: Future[Outcome] = self._executor.submit(perform, job)
        return future

    def close(self, ended: bool) -> None:
        """Leaves the cluster; if the batch `ended`, jobs that nobody has begun are withdrawn."""
        self._executor.shutdown(wait=not ended)
        self._client.close()

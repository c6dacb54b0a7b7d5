"""Workers of a Ray cluster that see the same folders as this machine."""

from __future__ import annotations

import os
from concurrent.futures import Future
from typing import Any

from ...errors import InputError, UnsupportedError
from .work import Job, Outcome, perform

RETRIES = 3
"""Times that a job is given to another worker where its own was lost."""


class OnRay:
    """A cluster: that of RAY_ADDRESS, or the one that runs on this machine.

    Args:
        jobs: Pictures at once; None for all cores of the cluster.

    Raises:
        InputError: There is no cluster.
        UnsupportedError: Ray is not installed.
    """

    lone_retry = False

    def __init__(self, jobs: int | None) -> None:
        try:
            import ray
        except ImportError:
            raise UnsupportedError("--ray needs pip install 'proxyimg-codec[ray]'") from None
        address = os.environ.get("RAY_ADDRESS", "auto")
        try:
            ray.init(address=address, log_to_driver=False, logging_level="error")
        except (ConnectionError, ValueError, RuntimeError) as error:
            told = (str(error) or type(error).__name__).splitlines()[0]
            raise InputError(f"--ray: there is no cluster at {address!r} ({told}); 'ray start "
                             "--head' starts one, RAY_ADDRESS names another") from None  # fmt: skip
        cores = int(ray.cluster_resources().get("CPU", 1))
        self.width = 2 * cores if jobs is None else jobs
        self._ray = ray
        self._perform: Any = ray.remote(num_cpus=1, max_retries=RETRIES)(perform)

    def submit(self, job: Job) -> Future[Outcome]:
        """Hands a job out."""
        future: Future[Outcome] = self._perform.remote(job).future()
        return future

    def close(self, ended: bool) -> None:
        """Leaves the cluster, which ends the jobs that are not done."""
        self._ray.shutdown()

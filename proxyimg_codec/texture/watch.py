"""Progress of the kernel within a level: it calls back now and then, and can be stopped."""

from __future__ import annotations

import ctypes as ct
from typing import Any

from ..progress import listener, worked

WATCH = ct.CFUNCTYPE(ct.c_int, ct.c_void_p, ct.c_int, ct.c_int)
"""Type of the function that the kernel calls with who listens, which is null here, the steps done
and all steps; 1 stops it."""


class Watch:
    """Teller of the progress of a level.

    Args:
        amount: Amount of work that the whole level is.

    Attributes:
        function: Function for the kernel; null if nobody listens.
    """

    def __init__(self, amount: int) -> None:
        self._amount, self._told = amount, 0
        self._raised: BaseException | None = None
        self.function: Any = WATCH(self._hear) if listener() else WATCH()

    def _hear(self, _: int | None, done: int, steps: int) -> int:
        more = self._amount * done // steps - self._told
        self._told += more
        try:
            worked(more)
        except BaseException as error:  # whatever it is, the kernel has to end before it goes on
            self._raised = error
            return 1
        return 0

    def check(self) -> None:
        """Raises what was raised while the kernel told; otherwise tells that all is done."""
        if self._raised is not None:
            raise self._raised
        if self.function:
            worked(self._amount - self._told)

"""Half precision that fails is noticed: it is counted, and computed again in full."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import torch
from torch import Tensor, nn

from ..errors import InputError

TYPES = {"full": torch.float32, "half": torch.float16, "bfloat": torch.bfloat16}


class Careful:
    """Computation with modules that are kept in half precision.

    Args:
        modules: The modules; they are converted.
        kind: Type of their weights.

    Attributes:
        count: How often full precision was needed.
    """

    def __init__(self, modules: Sequence[nn.Module], kind: torch.dtype) -> None:
        self._modules, self._kind, self.count = modules, kind, 0
        self._convert(kind)

    def _convert(self, kind: torch.dtype) -> None:
        for module in self._modules:
            if any(p.dtype != kind for p in module.parameters()):
                module.to(kind)

    def __call__(
        self, attempt: Callable[[torch.dtype], tuple[Tensor, Tensor]]
    ) -> tuple[Tensor, Tensor]:
        """Results of `attempt`, which gets the type to compute with.

        Raises:
            InputError: They are not finite in full precision either.
        """
        found = attempt(self._kind)
        if _finite(found):
            return found
        if self._kind in (torch.float16, torch.bfloat16):
            self.count += 1
            self._convert(torch.float32)
            try:
                found = attempt(torch.float32)
            finally:
                self._convert(self._kind)
            if _finite(found):
                return found
        raise InputError("the guide's numbers are not finite; its model may be damaged")


def _finite(found: tuple[Tensor, Tensor]) -> bool:
    return all(bool(v.isfinite().all()) for v in found)

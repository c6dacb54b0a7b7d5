"""Decoder of the package with one fault.

As a command: ``python -m conformance.faults --fault NAME IN OUT [flags of pxi-decode]``.
"""

from __future__ import annotations

import argparse
import contextlib
from collections.abc import Iterator, Mapping, Sequence
from unittest.mock import patch

from proxyimg_codec.cli import decode

from . import basics, motion, poses, pyramids
from .basics import Patch

FAULTS: Mapping[str, list[Patch]] = {
    **basics.FAULTS,
    **poses.FAULTS,
    **pyramids.FAULTS,
    **motion.FAULTS,
}
"""Patches of each decoder with a fault."""


@contextlib.contextmanager
def fault(name: str) -> Iterator[None]:
    """Context in which the package has a fault."""
    with contextlib.ExitStack() as stack:
        for target, attribute, value in FAULTS[name]:
            stack.enter_context(patch.object(target, attribute, value))
        yield


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point; returns the exit code."""
    parser = argparse.ArgumentParser("conformance.faults", description="Decode wrongly.")
    parser.add_argument("--fault", choices=FAULTS, required=True)
    args, rest = parser.parse_known_args(argv)
    with fault(args.fault):
        return decode.main([*rest, "--engine", "numpy"])

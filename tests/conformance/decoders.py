"""The cases, and decoders that they are tried on."""

import contextlib
import io
import shlex
import sys

import numpy as np

from conformance import symbols
from conformance.cases import load
from conformance.faults import decoder as wrong_decoder
from conformance.judge import Ended
from proxyimg_codec.cli import decode

CASES = load()
BY_NAME = {case.name: case for case in CASES}


def in_process(source, target, flags, fault=None):
    """The package's decoder, or a wrong one, without a process of its own."""
    with contextlib.ExitStack() as stack:
        said = stack.enter_context(contextlib.redirect_stderr(io.StringIO()))
        if fault:
            stack.enter_context(wrong_decoder.fault(fault))
            flags = [*flags, "--engine", "numpy"]
        code = decode.main([str(source), str(target), "--quiet", *flags])
    return Ended(code, said.getvalue())


def own_latents(source):
    """The hash of the package's latents."""
    return Ended(0, symbols.digest(source.read_bytes()))


def problems(results):
    return [f"{r.case} {r.render}: {r.problem}" for r in results if not r.passed]


def command(*words):
    python = shlex.quote(sys.executable)
    return f"{python} {' '.join(words)} {{in}} {{out}} {{args}}"


def picture(*pixel, dtype=np.uint16, shape=(3, 5)):
    return np.broadcast_to(np.array(pixel, dtype), (*shape, len(pixel))).copy()

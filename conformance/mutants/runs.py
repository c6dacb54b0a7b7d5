"""Runs of a decoder with a fault, each in a process of its own."""

from __future__ import annotations

import importlib
import importlib.abc
import importlib.machinery
import importlib.util
import io
import json
import os
import resource
import signal
import sys
import tempfile
import traceback
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import CodeType

from ..cases import Case
from ..judge import Ended, judge

PACKAGE = "proxyimg_codec"
SYMBOLS = "conformance.symbols"
"""Module that hashes latents; it is imported again with the package."""

ROOT = Path(__file__).parents[2] / PACKAGE

MEMORY = 1 << 30
"""Most bytes of data that a run may hold, as in `conformance.runner`."""


IMPORT = 30.0
"""Most processor time in seconds for the import of the decoder."""


@dataclass(frozen=True)
class Fault:
    """Changed version of a module.

    Attributes:
        file: Path within the package.
        code: The compiled module.
    """

    file: str
    code: CodeType


@dataclass(frozen=True)
class Caught:
    """First case that a decoder fails.

    Attributes:
        case: Name of the case; empty if the decoder could not be imported.
        problem: Problem as in `judge.Result`, or ``hang``, ``crash`` or ``import``.
    """

    case: str
    problem: str


def run(cases: Sequence[Case], fault: Fault | None, seconds: Mapping[str, float]) -> Caught | None:
    """Tries cases in order until the decoder fails one.

    Args:
        cases: The cases.
        fault: Fault of the decoder; None for none.
        seconds: Processor time that each case may take.

    Returns:
        The case that failed; None if none did.
    """
    said, status = forked(lambda out: _try_all(cases, fault, seconds, out))
    if not said or not said[-1].startswith("{"):
        how = "hang" if status == -signal.SIGPROF else f"crash: status {status}"
        return Caught(said[-1] if said else "", how)
    end = json.loads(said[-1])
    return Caught(end["case"], end["problem"]) if end["problem"] else None


def forked(work: Callable[[io.TextIOBase], None]) -> tuple[list[str], int]:
    """Runs a function in a process of its own.

    Args:
        work: Function that writes lines to the file it is given.

    Returns:
        The lines; the exit status of the process, or the negative number of the signal that ended
        it.
    """
    source, target = os.pipe()
    with tempfile.TemporaryDirectory(prefix="pxi-mutants-") as folder, warnings.catch_warnings():
        # Threads of numpy's matrix products, of which newer Pythons warn, are not used here.
        warnings.simplefilter("ignore", DeprecationWarning)
        child = os.fork()
        if child == 0:
            status = 1
            try:
                os.close(source)
                tempfile.tempdir = folder
                with open(target, "w", encoding="utf-8", buffering=1) as out:
                    work(out)
                status = 0
            except BaseException:  # nothing may leave the child process
                traceback.print_exc()
            finally:
                os._exit(status)
        os.close(target)
        with open(source, encoding="utf-8") as lines:
            said = lines.read().splitlines()
        _, ended = os.waitpid(child, 0)
    return said, os.waitstatus_to_exitcode(ended)


def _try_all(
    cases: Sequence[Case], fault: Fault | None, seconds: Mapping[str, float], out: io.TextIOBase
) -> None:
    """Writes the name of each case before it runs, and at the end the problem as JSON."""
    name, problem = "", ""
    signal.setitimer(signal.ITIMER_PROF, IMPORT)
    try:
        decoder = Decoder(fault)
    except BaseException as error:
        problem = f"import: {error!r}"
    else:
        for case in cases:
            name = case.name
            print(name, file=out)
            signal.setitimer(signal.ITIMER_PROF, seconds[name])
            problem = decoder.problem(case)
            if problem:
                break
    print(json.dumps({"case": name, "problem": problem}), file=out)


class Decoder:
    """Decoder of the package, imported again into this process.

    The process must not be used for anything else afterwards.

    Args:
        fault: Fault of the decoder; None for none.
    """

    def __init__(self, fault: Fault | None) -> None:
        _confine()
        for name in [n for n in sys.modules if f"{n}.".startswith(f"{PACKAGE}.") or n == SYMBOLS]:
            del sys.modules[name]
        if fault is not None:
            sys.meta_path.insert(0, _Finder(fault))
        self._main = importlib.import_module(f"{PACKAGE}.cli.decode").main
        for lazy in ("api", "codec.unpack", "io.raster", "render.engines"):
            importlib.import_module(f"{PACKAGE}.{lazy}")
        self._digest = importlib.import_module(SYMBOLS).digest

    def problem(self, case: Case) -> str:
        """Problem of the first run of a case that fails; empty if none does."""
        for number in range(max(len(case.renders), 1)):
            result = judge(case, number, self._decode, ".npy", self._hash)
            if result.problem:
                return result.problem
        return ""

    def _decode(self, source: Path, target: Path, flags: Sequence[str]) -> Ended:
        words = [str(source), str(target), "--quiet", "--engine", "numpy", *flags]
        return _ended(lambda: Ended(self._main(words)))

    def _hash(self, source: Path) -> Ended:
        return _ended(lambda: Ended(0, self._digest(source.read_bytes())))


def _ended(work: Callable[[], Ended]) -> Ended:
    """Calls a function; turns any exception, including `SystemExit`, into exit code 1."""
    try:
        return work()
    except BaseException as error:
        return Ended(1, repr(error))


def _confine() -> None:
    """Sets plain numpy, no output, and a limit on memory for this process."""
    os.environ["PROXYIMG_NO_KERNEL"] = "1"
    warnings.resetwarnings()
    warnings.simplefilter("ignore")
    nowhere = os.open(os.devnull, os.O_RDWR)
    for stream in (0, 1, 2):
        os.dup2(nowhere, stream)
    sys.stdout = sys.stderr = io.TextIOWrapper(io.FileIO(1, "w", closefd=False))
    limit_memory()


def limit_memory() -> None:
    """Limits the memory of this process to `MEMORY` beyond what it holds already."""
    held = Path("/proc/self/statm")
    pages = int(held.read_text().split()[5]) if held.exists() else 0
    data = MEMORY + pages * resource.getpagesize()
    for what, most in ((resource.RLIMIT_DATA, data), (resource.RLIMIT_CORE, 0)):
        hard = resource.getrlimit(what)[1]
        most = most if hard == resource.RLIM_INFINITY else min(most, hard)
        resource.setrlimit(what, (most, most))


class _Finder(importlib.abc.MetaPathFinder):
    """Finder of the module with a fault."""

    def __init__(self, fault: Fault) -> None:
        dotted = fault.file.removesuffix(".py").replace("/", ".")
        self._name, self._fault = f"{PACKAGE}.{dotted}", fault

    def find_spec(
        self, fullname: str, path: object, target: object = None
    ) -> importlib.machinery.ModuleSpec | None:
        if fullname != self._name:
            return None
        loader = _Loader(fullname, str(ROOT / self._fault.file))
        loader.fault = self._fault
        return importlib.util.spec_from_file_location(fullname, loader.path, loader=loader)


class _Loader(importlib.machinery.SourceFileLoader):
    """Loader of the module with a fault."""

    fault: Fault

    def get_code(self, fullname: str) -> CodeType:
        return self.fault.code

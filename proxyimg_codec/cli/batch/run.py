"""Running of a batch: jobs are handed out, and what becomes of them is told in their order."""

from __future__ import annotations

import argparse
import contextlib
import hashlib
import json
import os
import secrets
import sys
import time
from collections import Counter
from collections.abc import Generator, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, wait
from concurrent.futures.process import BrokenProcessPool
from typing import IO, Any

from ..._version import __version__
from ...errors import InputError
from ..common import Bar, jobs_of, printable
from ..places import check_target
from . import records
from .pools import Here, Pool, Processes
from .tool import Tool
from .work import FAILED, MADE, SAME, Job, Outcome

PLACES = ("files", "inputs", "out", "force", "quiet", "json", "report", "resume", "jobs", "dask",
          "ray", "batch")  # fmt: skip
"""What a command line holds that does not change what is made of an input."""


def run_batch(tool: Tool, args: argparse.Namespace, found: list[tuple[str, str]]) -> int:
    """Makes an output of each input, and tells of each in the order of the inputs.

    Args:
        tool: The tool.
        args: The command line.
        found: Each input with its output, in the folder `args.out`.

    Returns:
        The exit code of the first input that failed; 0 if none did.

    Raises:
        InputError: The folder, the report or the cluster cannot be used.
        UnsupportedError: A package for the cluster is not installed.
    """
    started = time.perf_counter()
    with records.locked(args.out), contextlib.ExitStack() as stack:
        for folder in {os.path.dirname(output) for _, output in found}:
            os.makedirs(folder or ".", exist_ok=True)
        report = _opened(stack, args, found)
        pool = pool_of(args, len(found))
        flow = stack.enter_context(contextlib.closing(outcomes(_jobs(tool, args, found), pool)))
        bar = Bar(len(found), "pictures", args.quiet)
        stack.callback(bar.close)
        counts: Counter[str] = Counter()
        first = 0
        for outcome in _in_order(flow):
            counts[outcome.state] += 1
            first = first or outcome.code
            _tell(tool, args, found[outcome.place], outcome, bar, report)
            bar.advance(1)
    if not args.quiet:
        told = ", ".join(f"{counts[state]} {said}" for state, said in (
            (MADE, "made"), (SAME, "up to date"), (FAILED, "failed")))  # fmt: skip
        print(f"{args.out}: {told}, {time.perf_counter() - started:.1f} s", file=sys.stderr)
    return first


def pool_of(args: argparse.Namespace, count: int) -> Pool:
    """Pool of workers that a command line asks for, for some number of jobs.

    Raises:
        InputError, UnsupportedError: A cluster cannot be used.
    """
    if args.dask is not None:
        from .on_dask import OnDask

        return OnDask(args.dask, args.jobs)
    if args.ray:
        from .on_ray import OnRay

        return OnRay(args.jobs)
    cores = jobs_of(args)
    processes = min(cores, count)
    return Here() if processes == 1 else Processes(processes, max(1, cores // processes))


def _jobs(tool: Tool, args: argparse.Namespace, found: list[tuple[str, str]]) -> Iterator[Job]:
    """Jobs of a batch, in order. They name all files from the root, for workers elsewhere."""
    away = args.dask is not None or args.ray
    cores = jobs_of(args)
    threads = 1 if away else max(1, cores // len(found))
    settings = {k: _whole(v) for k, v in sorted(vars(args).items()) if k not in PLACES}
    told = {k: records.digest_of(v) if _is_file(v) else v for k, v in settings.items()}
    recipe = f"{tool.prog} {__version__} {json.dumps(told, default=str)}"
    common = {
        "work": tool.work,
        "recipe": hashlib.sha256(recipe.encode("utf-8", "surrogateescape")).hexdigest(),
        "out": os.path.abspath(args.out) if away else args.out,
        "batch": secrets.token_hex(8),
    }
    same = _same_files(found)
    shared = {**vars(args), "files": [], "jobs": threads, "batch": True}
    if away:
        shared |= settings
    for place, (source, output) in enumerate(found):
        rivals = [source, *same.get(output, ())]
        if away:
            source, output = _reachable(source), os.path.abspath(output)
            rivals = [_reachable(v) for v in rivals]
        one = argparse.Namespace(**shared, input=source, output=output)
        one.inputs = rivals
        yield Job(place, args=one, **common)


def _is_file(value: Any) -> bool:
    """Whether the value of a flag is a model in a file, and not the name of one."""
    return isinstance(value, str) and value.lower().endswith(".onnx") and os.path.isfile(value)


def _whole(value: Any) -> Any:
    """Value of a flag; if it is the name of a file, from the root."""
    return os.path.abspath(value) if _is_file(value) else value


def _reachable(name: str) -> str:
    return name if "://" in name else os.path.abspath(name)


def _same_files(found: list[tuple[str, str]]) -> dict[str, list[str]]:
    """Inputs that are the file of an output, by output."""
    inputs: dict[tuple[int, int], list[str]] = {}
    for source, _ in found:
        with contextlib.suppress(OSError):
            status = os.stat(source)
            inputs.setdefault((status.st_dev, status.st_ino), []).append(source)
    same = {}
    for _, output in found:
        with contextlib.suppress(OSError):
            status = os.stat(output)
            same[output] = inputs.get((status.st_dev, status.st_ino), [])
    return same


def outcomes(jobs: Iterable[Job], pool: Pool) -> Generator[Outcome]:
    """Has jobs done by a pool, and yields what becomes of them as it comes.

    A worker that is lost takes along all that were with it; each of these is tried again as the
    only one, so that it is known which of them it was.
    """
    waiting: dict[Future[Outcome], Job] = {}
    suspects: list[Job] = []
    done = False

    def collected() -> Iterator[Outcome]:
        for future in wait(waiting, return_when=FIRST_COMPLETED).done:
            job, error = waiting.pop(future), _lost(future)
            if error is None:
                yield future.result()
            elif pool.lone_retry:
                suspects.append(job)
            else:
                yield _failed(job, error)

    try:
        for job in jobs:
            while len(waiting) >= pool.width:
                yield from collected()
            waiting[pool.submit(job)] = job
        while waiting:
            yield from collected()
        for job in suspects:
            future = pool.submit(job)
            error = _lost(future)
            yield future.result() if error is None else _failed(job, error)
        done = True
    finally:
        pool.close(not done)


def _lost(future: Future[Outcome]) -> BaseException | None:
    """Error by which a job was lost; None if it was done.

    Raises:
        InputError: The whole cluster is gone.
    """
    try:
        return future.exception()
    except CancelledError:
        raise InputError("the cluster is gone; what is made stays, and --resume goes "
                         "on") from None  # fmt: skip


def _failed(job: Job, error: BaseException) -> Outcome:
    """Outcome of a job whose worker was lost."""
    name = job.args.input
    if isinstance(error, BrokenProcessPool):
        told = f"{name}: its process was killed, most likely for want of memory; try fewer --jobs"
    else:
        words = " ".join(str(error).split())[:300]
        told = f"{name}: its worker was lost or cannot do it: {type(error).__name__}: {words}"
    return Outcome(job.place, FAILED, error=told, code=6)


def _in_order(found: Iterable[Outcome]) -> Iterator[Outcome]:
    """Yields outcomes in the order of their jobs."""
    early: dict[int, Outcome] = {}
    place = 0
    for outcome in found:
        early[outcome.place] = outcome
        while place in early:
            yield early.pop(place)
            place += 1


def _opened(
    stack: contextlib.ExitStack, args: argparse.Namespace, found: list[tuple[str, str]]
) -> IO[str] | None:
    """File of --report, which is open while the batch runs, so that what is done stands in it.

    Raises:
        UsageError: It is an input or output.
        InputError: It exists already, or cannot be written.
    """
    if args.report is None:
        return None
    check_target(args.report, args.force or args.resume, *(name for pair in found for name in pair))
    try:
        return stack.enter_context(open(args.report, "w", encoding="utf-8"))
    except OSError as error:
        raise InputError(f"{args.report}: cannot be written: {error.strerror}") from None


def _tell(
    tool: Tool,
    args: argparse.Namespace,
    pair: tuple[str, str],
    outcome: Outcome,
    bar: Bar,
    report: IO[str] | None,
) -> None:
    """Tells what became of an input, on stderr and in the report."""
    if not (args.quiet and tool.hush):
        for note in outcome.notes:
            bar.say(f"{tool.prog}: warning: {printable(note)}")
    if outcome.state == FAILED:
        bar.say(f"{tool.prog}: {printable(outcome.error)}")
    else:
        tool.tell(outcome.report, args, bar.say if outcome.state == MADE else _unsaid)
    if report is not None:
        told = {"input": pair[0], "output": pair[1], "state": outcome.state,
                "seconds": outcome.seconds, "warnings": outcome.notes, "error": outcome.error,
                "exit_code": outcome.code}  # fmt: skip
        report.write(json.dumps({**outcome.report, **told}) + "\n")
        report.flush()


def _unsaid(text: str) -> None:
    """Says nothing about what was made before."""

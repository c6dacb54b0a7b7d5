"""What a run of `pxi-bench rd` writes and prints."""

from __future__ import annotations

import platform
import statistics
from collections.abc import Sequence
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path

from .._version import __version__
from ..io.files import write_atomically
from . import summary
from .peers import Codec
from .plots import draw
from .rd import Failure, Source, Task, machine
from .rows import Row, to_csv


def header(
    command: str,
    tasks: Sequence[Task],
    sources: Sequence[Source],
    chosen: Sequence[Codec],
    jobs: int,
) -> str:
    """Command, versions of all that takes part, pictures and machine."""
    libraries = ", ".join(f"{n} {version(n)}" for n in ("numpy", "torch"))
    lines = [
        f"$ {command}",
        f"proxyimg-codec {__version__}, Python {platform.python_version()}, {libraries}",
        f"{len(sources)} pictures, {len(tasks)} measurements, {jobs} processes of one thread",
        machine(),
    ]
    for codec in chosen:
        mine = [t for t in tasks if t.codec.name == codec.name]
        pictures = len({t.source for t in mine})
        text = f"{codec.name}: {codec.settings}" + (f"; {mine[0].version}" if mine else "")
        if pictures < len(sources):
            why = "no label map" if codec.masks else "no transparency"
            text += f"; only {pictures} of {len(sources)} pictures ({why})"
        lines.append(text)
    return "\n".join(lines) + "\n"


def is_kodak(sources: Sequence[Source]) -> bool:
    """The pictures are kodim01 to kodim24."""
    return [s.path.stem for s in sources] == [f"kodim{i:02d}" for i in range(1, 25)]


class Log:
    """The measurements of a run, in a file from the moment they are made.

    Attributes:
        path: The CSV file.
        rows: What is measured, or still holds from an earlier run.
        failures: What went wrong.
        open_tasks: What was not known at the start.
    """

    def __init__(self, path: Path, tasks: Sequence[Task], old: Sequence[Row]) -> None:
        known = {row.key: row for row in old}
        self.path, self._total, self._given = path, len(tasks), len(old)
        self.failures: list[Failure] = []
        self.rows = [
            replace(known[task_key(t)], picture=t.source.path.stem)
            for t in tasks
            if task_key(t) in known
        ]
        self.open_tasks = [t for t in tasks if task_key(t) not in known]
        write_atomically(path, to_csv(self.rows).encode())
        self._file = path.open("a", encoding="utf-8")

    def add(self, result: Row | Failure) -> None:
        """Takes what came of one task."""
        if isinstance(result, Failure):
            self.failures.append(result)
            return
        self.rows.append(result)
        self._file.write(to_csv([result], head=False))
        self._file.flush()

    @property
    def complete(self) -> bool:
        """Every task has come to an end."""
        return len(self.rows) + len(self.failures) == self._total

    def close(self) -> None:
        """Leaves the file in the order of pictures, codecs and qualities."""
        self._file.close()
        self.rows.sort(key=lambda r: (r.picture, r.codec, r.quality))
        write_atomically(self.path, to_csv(self.rows).encode())

    def reuse_note(self, name: str) -> str:
        """How much of an older file still holds, and what of it was measured elsewhere."""
        reused = len(self.rows)
        text = f"{reused} measurements reused from {name}"
        if self._given > reused:
            text += f"; {self._given - reused} others of it are not of this run's pictures, "
            text += "codecs, settings, versions and qualities"
        elsewhere = sorted({row.machine for row in self.rows} - {machine()})
        if elsewhere:
            text += f"; CPU seconds of some are from {' and '.join(elsewhere)}"
        return text + "\n"


def task_key(task: Task) -> tuple[object, ...]:
    """As `Row.key`, of what is still to be measured."""
    codec = task.codec
    return task.source.digest, codec.name, codec.settings, task.version, task.quality


def write(
    out: Path,
    rows: Sequence[Row],
    codecs: Sequence[Codec],
    folder: str,
    rates: tuple[float, float],
    published: bool,
) -> str:
    """Writes tables and plots to a folder.

    Returns:
        The tables.
    """
    results = summary.collect(rows, codecs)
    curves = [r.average("PSNR") for r in results]
    if published:
        results += summary.published()
    text = summary.tables(results, rates)
    write_atomically(out / "summary.csv", summary.to_csv(results, rates).encode())
    write_atomically(out / "summary.md", text.encode())
    count = len({row.picture for row in rows})
    title = f"{folder}: mean of {count} pictures" if count > 1 else f"{folder}: one picture"
    # Small pictures need more bits a pixel: most of the curves should be seen.
    ends = [curve[-1][0] for curve in curves if curve]
    usual = statistics.median(ends) if ends else 0.0
    for metric, name in (("PSNR", "psnr"), ("MS-SSIM", "msssim")):
        paths = [out / f"{name}{suffix}" for suffix in (".png", ".svg")]
        draw(results, metric, title, max(1.25 * rates[1], usual), paths)
    return text

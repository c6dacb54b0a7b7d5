"""Output of a run of `pxi-bench rd`: tables, plots and the log of measurements."""

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
    """Text with the command, all versions, the number of pictures, and the machine."""
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
    """Whether the pictures are called kodim01 to kodim24."""
    return [s.path.stem for s in sources] == [f"kodim{i:02d}" for i in range(1, 25)]


class Log:
    """Log of the measurements of a run; each is written to a file as soon as it is made.

    Attributes:
        path: The CSV file.
        rows: Measurements of this run, and those of an earlier run that are still valid.
        failures: Tasks that failed.
        open_tasks: Tasks without a valid measurement at the start.
    """

    def __init__(self, path: Path, tasks: Sequence[Task], old: Sequence[Row]) -> None:
        perceptual = any(task.perceptual for task in tasks)
        known = {row.key: row for row in old if row.perceptual or not perceptual}
        self.path, self._total, self._given = path, len(tasks), len(old)
        self.failures: list[Failure] = []
        self.rows = [
            replace(known[task_key(t)], picture=t.source.path.stem)
            for t in tasks
            if task_key(t) in known
        ]
        self.open_tasks = [t for t in tasks if task_key(t) not in known]
        write_atomically(path, to_csv(self.rows).encode(errors="backslashreplace"))
        self._file = path.open("a", encoding="utf-8", errors="backslashreplace")

    def add(self, result: Row | Failure) -> None:
        """Adds the result of one task."""
        if isinstance(result, Failure):
            self.failures.append(result)
            return
        self.rows.append(result)
        self._file.write(to_csv([result], head=False))
        self._file.flush()

    @property
    def complete(self) -> bool:
        """Whether every task has a result."""
        return len(self.rows) + len(self.failures) == self._total

    def close(self) -> None:
        """Closes the file, and sorts it by picture, codec and quality."""
        self._file.close()
        self.rows.sort(key=lambda r: (r.picture, r.codec, r.quality))
        write_atomically(self.path, to_csv(self.rows).encode(errors="backslashreplace"))

    def reuse_note(self, name: str) -> str:
        """Text on the measurements reused from an older file, and on machines other than this."""
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
    """Key of a task, equal to `Row.key` of its measurement."""
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

    Args:
        out: The folder.
        rows: All measurements.
        codecs: The codecs in the order of the tables.
        folder: Name of the picture folder, for titles.
        rates: Least and greatest rate, in bits per pixel, for BD-rates.
        published: Whether to add the published curves.

    Returns:
        The tables as Markdown.
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
    # Small pictures need more bits per pixel; then the plot is wider, to show most of the curves.
    ends = [curve[-1][0] for curve in curves if curve]
    usual = statistics.median(ends) if ends else 0.0
    for metric, name in summary.measured(results).items():
        paths = [out / f"{name}{suffix}" for suffix in (".png", ".svg")]
        draw(results, metric, title, max(1.25 * rates[1], usual), paths)
    return text

"""Report of `pxi-bench paper`, as Markdown and HTML with the same content, and plots."""

from __future__ import annotations

import csv
import html
import io
import platform
import re
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

from ..._version import __version__
from ...io.files import write_atomically
from ..rd import machine
from .charts import plot
from .items import Row
from .tables import Table

STYLE = """body{font:15px/1.5 sans-serif;max-width:62em;margin:2em auto;padding:0 1em;color:#222}
table{border-collapse:collapse}td,th{padding:.2em .7em;border-bottom:1px solid #ddd;text-align:left}
td.n,th.n{text-align:right;font-variant-numeric:tabular-nums}img{max-width:100%}
"""


@dataclass(frozen=True)
class Part:
    """Section of a report.

    Attributes:
        name: Name of the section.
        title: Its title.
        table: Form of its table.
        rows: What was measured.
        absent: Why nothing was measured, instead.
        measured: Number of measurements that are there, and of all.
    """

    name: str
    title: str
    table: Table
    rows: Sequence[Row]
    absent: str = ""
    measured: tuple[int, int] = (0, 0)

    @property
    def remarks(self) -> list[str]:
        """Notes: on what is to come, conclusions, and those of the table."""
        there, planned = self.measured
        left = [f"Only {there} of {planned} measurements are there yet."] if there < planned else []
        return [*left, *self.table.conclusions(self.rows), *self.table.notes]


def header(command: str) -> list[str]:
    """Lines with the command, versions and the machine."""
    libraries = ", ".join(f"{n} {version(n)}" for n in ("numpy", "torch"))
    return [f"$ {command}",
            f"proxyimg-codec {__version__}, Python {platform.python_version()}, {libraries}",
            f"{machine()}; each measurement in a process of one thread"]  # fmt: skip


def write(out: Path, parts: Sequence[Part], head: Sequence[str]) -> None:
    """Writes ``report.md``, ``report.html``, and for each section a table of all rows and plots.

    Raises:
        InputError: A file cannot be written.
    """
    for part in parts:
        if part.rows:
            write_atomically(out / f"{part.name}.csv", to_csv(part.rows).encode())
            for kind in ("svg", "png"):
                drawn = plot(part.table, part.rows, _capital(part.title), kind)
                write_atomically(out / f"{part.name}.{kind}", drawn)
    write_atomically(out / "report.md", markdown(parts, head).encode())
    write_atomically(out / "report.html", page(parts, head).encode())


def to_csv(rows: Sequence[Row]) -> str:
    """All rows as CSV text, with a column for each key."""
    out = io.StringIO()
    keys = list(dict.fromkeys(k for row in rows for k in row))
    writer = csv.DictWriter(out, keys, lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return out.getvalue()


def markdown(parts: Sequence[Part], head: Sequence[str]) -> str:
    """The report as Markdown."""
    lines = ["# The paper's tables, made again", "", "```", *head, "```", ""]
    for part in parts:
        lines += [f"## {_capital(part.title)}", ""]
        if part.absent:
            lines += [f"Not measured: {part.absent}", ""]
            continue
        table = part.table.lines(part.rows)
        names = len(part.table.rows)
        lines.append("| " + " | ".join(table[0]) + " |")
        lines.append("|" + "---|" * names + "--:|" * (len(table[0]) - names))
        lines += ["| " + " | ".join(line) + " |" for line in table[1:]]
        lines += ["", f"![{part.title}]({part.name}.svg)", ""]
        lines += [f"- {note}" for note in part.remarks] + [""]
    return "\n".join(lines)


def page(parts: Sequence[Part], head: Sequence[str]) -> str:
    """The report as HTML."""
    title = "The paper's tables, made again"
    out = [f"<!doctype html><html lang='en'><meta charset='utf-8'><title>{title}</title>",
           f"<style>{STYLE}</style><h1>{title}</h1>",
           f"<pre>{html.escape(chr(10).join(head))}</pre>"]  # fmt: skip
    for part in parts:
        out.append(f"<h2>{html.escape(_capital(part.title))}</h2>")
        if part.absent:
            out.append(f"<p>Not measured: {html.escape(part.absent)}</p>")
            continue
        table, names = part.table.lines(part.rows), len(part.table.rows)
        for i, line in enumerate(table):
            tag = "td" if i else "th"
            cells = (f"<{tag}{' class=n' if k >= names else ''}>{html.escape(text)}</{tag}>"
                     for k, text in enumerate(line))  # fmt: skip
            out.append(("" if i else "<table>") + f"<tr>{''.join(cells)}</tr>")
        image = f"<img src='{part.name}.svg' alt='{html.escape(part.title)}'>"
        out.append(f"</table><p>{image}</p><ul>")
        out += [f"<li>{_marked(note)}</li>" for note in part.remarks]
        out.append("</ul>")
    return "\n".join([*out, "</html>", ""])


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]


def _marked(note: str) -> str:
    """HTML of a note, whose only marks are emphasis and code."""
    text = re.sub(r"\*(.+?)\*", r"<em>\1</em>", html.escape(note, quote=False))
    return re.sub(r"`(.+?)`", r"<code>\1</code>", text)

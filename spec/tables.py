"""The generated parts of the chapters: `python -m spec.tables` checks them, `--write` renews them.

A generated part stands between a line `<!-- NAME -->` and a line `<!-- end -->`.
"""

from __future__ import annotations

import argparse
import functools
import re
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from proxyimg_codec.container import head, layr, meta, netw, texr
from proxyimg_codec.container.fields import Field
from proxyimg_codec.entropy import arrays
from proxyimg_codec.image import from_bytes

from .dump import dump, values

FOLDER = Path(__file__).parent
EXAMPLE = FOLDER / "example.pxi"

FIELDS = {
    "HEAD": head.FIELDS,
    "LAYR": layr.FIELDS,
    "NETW": netw.FIELDS,
    "TEXR": texr.FIELDS,
    "BLOCK": meta.FIELDS,
    "iNFO": meta.INFO_FIELDS,
}

SMALL = np.array([[[20, 21, 22, 0], [20, 21, 20, 23]]])
SMALL_STORED = np.array([[True, True, True, False], [True, True, True, True]])
SMALL_BITS = 5
"""The worked example of the entropy coder."""


def number(value: int) -> str:
    """An integer, as a power of two where that is shorter."""
    size = abs(value)
    for offset, suffix in ((0, ""), (1, " - 1")):
        if size > 1 << 12 and (size + offset).bit_count() == 1:
            power = f"2^{(size + offset).bit_length() - 1}{suffix}"
            return power if value > 0 else f"-({power})" if suffix else f"-{power}"
    return str(value)


def fields_table(fields: tuple[Field, ...]) -> Iterator[str]:
    """Lines of the table of a chunk."""
    yield "| Key | Type | Range | Meaning |"
    yield "|---|---|---|---|"
    for f in fields:
        several = f"array of {f.items or 'any number of'} integers"
        kind = {"int": "integer", "str": "string", "bin": "bytes", "ints": several}[f.kind]
        yield f"| `{f.key}` | {kind} | {number(f.low)} .. {number(f.high)} | {f.meaning} |"


def small_example() -> Iterator[str]:
    """Lines of the worked example of the entropy coder."""
    for name, row, kept in zip(("values", "      "), SMALL[0], SMALL_STORED, strict=True):
        cells = (str(v) if k else "." for v, k in zip(row, kept, strict=True))
        yield f"{name}  " + " ".join(c.rjust(2) for c in cells)
    yield "bytes   " + arrays.encode(SMALL, SMALL_BITS, SMALL_STORED).hex(" ")


def pixels() -> Iterator[str]:
    """Rows of the example picture in hexadecimal."""
    for row in from_bytes(EXAMPLE.read_bytes()).render(engine="numpy"):
        yield " ".join(bytes(p).hex() for p in row)


def fenced(lines: Iterator[str]) -> Iterator[str]:
    """Lines as a block of plain text."""
    yield "```text"
    yield from lines
    yield "```"


PARTS: dict[str, Callable[[], Iterator[str]]] = {
    **{f"fields {k}": functools.partial(fields_table, v) for k, v in FIELDS.items()},
    "example": lambda: fenced(small_example()),
    "dump": lambda: fenced(dump(EXAMPLE.read_bytes())),
    "values": lambda: fenced(values(from_bytes(EXAMPLE.read_bytes()))),
    "pixels": lambda: fenced(pixels()),
}
"""Every generated part by name."""

_PART = re.compile(r"^<!-- ([^\n]+) -->\n(.*?)^<!-- end -->\n", re.M | re.S)


def chapters() -> list[Path]:
    """The files of the specification."""
    return sorted(FOLDER.glob("*.md"))


def shown() -> dict[str, str]:
    """Every generated part as it stands in the chapters."""
    return {m[1]: m[2] for path in chapters() for m in _PART.finditer(path.read_text("utf-8"))}


def wanted(name: str) -> str:
    """A generated part as the code makes it."""
    return "".join(f"{line}\n" for line in PARTS[name]())


def write() -> None:
    """Renews all generated parts."""
    for path in chapters():
        text = path.read_text("utf-8")
        new = _PART.sub(lambda m: f"<!-- {m[1]} -->\n{wanted(m[1])}<!-- end -->\n", text)
        if new != text:
            path.write_text(new, "utf-8")


def main(argv: list[str] | None = None) -> int:
    """Entry point; returns the exit code."""
    parser = argparse.ArgumentParser(prog="spec.tables", description=__doc__)
    parser.add_argument("--write", action="store_true", help="renew the chapters")
    if parser.parse_args(argv).write:
        write()
    stale = [name for name, text in shown().items() if text != wanted(name)]
    for name in stale:
        print(f"not as the code says: {name}", file=sys.stderr)
    return 1 if stale else 0


if __name__ == "__main__":
    sys.exit(main())

"""The generated parts of the chapters, and the registry: checks them, or renews them (`--write`).

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

from proxyimg_codec.api import from_bytes
from proxyimg_codec.container import (
    head,
    layr,
    mesh,
    meta,
    motn,
    netw,
    plan,
    pose,
    texr,
    tree,
    undo,
)
from proxyimg_codec.container.fields import Field
from proxyimg_codec.container.file import parse
from proxyimg_codec.entropy import arrays
from proxyimg_codec.geometry import boundary, deltas
from proxyimg_codec.geometry import mesh as meshes
from proxyimg_codec.geometry.connectivity import Border

from . import pyramid, registry
from .dump import dump, values

FOLDER = Path(__file__).parent
EXAMPLE = FOLDER / "example.pxi"
REGISTRY = FOLDER / "registry.json"

FIELDS = {
    "HEAD": head.FIELDS,
    "LAYR": layr.FIELDS,
    "MESH": mesh.FIELDS,
    "POSE": pose.FIELDS,
    "NETW": netw.FIELDS,
    "TEXR": texr.FIELDS,
    "TEXR shared": texr.SHARED_FIELDS,
    "TEXR pyramid": texr.PYRAMID_FIELDS,
    "PLAN": plan.FIELDS,
    "BLOCK": meta.FIELDS,
    "cICp": meta.CICP_FIELDS,
    "iNFO": meta.INFO_FIELDS,
    "tREE": tree.FIELDS,
    "mOTN": motn.FIELDS,
    "uNDO": undo.FIELDS,
}

KEYS = ("HEAD", "LAYR", "MESH", "POSE", "NETW", "PLAN", "mOTN")
"""Chunks besides TEXR that the program in the chapters reads."""

SMALL = np.array([[[20, 21, 22, 0], [20, 21, 20, 23]]])
SMALL_STORED = np.array([[True, True, True, False], [True, True, True, True]])
SMALL_BITS = 5
"""Worked example of the entropy coder: values, stored positions, bits a value."""

SIGNED = (0, -1, 3, -6, 20000)
"""Worked example of signed integers."""

MESH = meshes.Mesh.build(
    meshes.Base(
        (2, 1), (1024, 1024),
        np.array([(0, 0), (24, 0), (24, 16), (0, 16), (10, 8)], np.uint8),
        np.array([(0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)], np.int32),
    )
).split([np.array([True, False, False, False])])  # fmt: skip
"""Worked example of a mesh."""


def number(value: int) -> str:
    """Formats an integer, as a power of two if that is shorter."""
    size = abs(value)
    for offset, suffix in ((0, ""), (1, " - 1")):
        if size > 1 << 12 and (size + offset).bit_count() == 1:
            power = f"2^{(size + offset).bit_length() - 1}{suffix}"
            return power if value > 0 else f"-({power})" if suffix else f"-{power}"
    return str(value)


def fields_table(fields: tuple[Field, ...]) -> Iterator[str]:
    """Yields the lines of the table of fields of a chunk."""
    yield "| Key | Type | Range | Meaning |"
    yield "|---|---|---|---|"
    for f in fields:
        kind = {
            "int": "integer",
            "str": "string",
            "bin": "bytes",
            "ints": f"array of {f.items or 'any number of'} integers",
            "strs": "array of any number of strings",
        }[f.kind]
        yield f"| `{f.key}` | {kind} | {number(f.low)} .. {number(f.high)} | {f.meaning} |"


def keys_table() -> Iterator[str]:
    """Yields lines of Python with the keys of the chunks that the program in the chapters reads."""
    yield "KEYS = {"
    for kind in KEYS:
        yield f'    "{kind}": "{" ".join(f.key for f in FIELDS[kind])}",'
    yield '    "TEXR": ('
    for _, fields in sorted(texr.CODERS.items()):
        yield f'        "{" ".join(f.key for f in fields)}",'
    yield "    ),"
    yield "}"


def small_example() -> Iterator[str]:
    """Yields the lines of the worked example of the entropy coder."""
    for name, row, kept in zip(("values", "      "), SMALL[0], SMALL_STORED, strict=True):
        cells = (str(v) if k else "." for v, k in zip(row, kept, strict=True))
        yield f"{name}  " + " ".join(c.rjust(2) for c in cells)
    yield "bytes   " + arrays.encode(SMALL, SMALL_BITS, SMALL_STORED).hex(" ")


def signed_example() -> Iterator[str]:
    """Yields the lines of the worked example of signed integers."""
    classes, raw = deltas.encode(np.array([SIGNED]))
    sizes = [min(abs(v).bit_length(), 15) for v in SIGNED]
    bits = "".join(f"{byte:08b}" for byte in raw)
    pieces, at = [], 0
    for size in sizes:
        count = 32 if size == 15 else size
        pieces.append(bits[at : at + count])
        at += count
    yield "integers   " + " ".join(map(str, SIGNED))
    yield "classes    " + " ".join(map(str, sizes))
    yield "           " + classes.hex(" ")
    yield "deltas     " + raw.hex(" ")
    yield "bits       " + " ".join(p or "-" for p in [*pieces, bits[at:]])


def boundary_example() -> Iterator[str]:
    """Yields the lines of the worked example of a boundary."""
    fields = parse(EXAMPLE.read_bytes()).layers[1]
    count = sum(fields["segments"])
    rows = deltas.decode(fields["classes"], fields["deltas"], 6, count, "")
    shape = boundary.decode(fields, "")
    assert shape is not None, "the disc has a boundary"
    (path,) = shape.paths
    yield f"unit       {fields['unit']}"
    yield f"segments   {plain(fields['segments'])}"
    yield "classes    " + fields["classes"].hex(" ")
    yield "deltas     " + fields["deltas"].hex(" ")
    for k, row in enumerate(rows):
        name = f"d{'xy'[k % 2]} of 3 k" + (f" + {k // 2}" if k > 1 else "")
        yield f"{name:14}" + " ".join(f"{v:4}" for v in row)
    yield "points     " + " ".join(map(plain, path))


def plain(row: object) -> str:
    """Formats a row of integers as (1, 2)."""
    return str(tuple(np.asarray(row).tolist()))


def mesh_example() -> Iterator[str]:
    """Yields the lines of the worked example of a mesh."""
    fields, base, refined = MESH.fields, MESH.base, MESH.refined
    residuals = deltas.decode(fields["classes"], fields["deltas"], 2, fields["vertices"], "")
    yield "origin     " + plain(fields["origin"]) + "  step " + plain(fields["step"])
    for key in ("symbols", "classes", "deltas", "splits"):
        yield f"{key:10} {fields[key].hex(' ')}"
    yield "symbols    " + " ".join(map(str, mesh_symbols()))
    yield "residuals  " + " ".join(map(plain, residuals.T))
    yield "vertices   " + " ".join(map(plain, base.vertices))
    yield "triangles  " + " ".join(map(plain, base.triangles))
    yield "split      " + " ".join(str(int(v)) for v in MESH.splits[0])
    yield "midpoints  " + " ".join(map(plain, refined.parents[len(base.vertices) :]))
    yield "faces      " + " ".join(map(plain, refined.faces[:5]))
    yield "           " + " ".join(map(plain, refined.faces[5:]))


def mesh_symbols() -> list[int]:
    """Symbols of the worked example of a mesh."""
    count = MESH.fields["gates"]
    coded = arrays.decode(MESH.fields["symbols"], (1, 1, count), 4, np.ones((1, count), bool))
    return [int(v) for v in coded.ravel()]


def mesh_steps() -> Iterator[str]:
    """Yields the rows of the table that shows how the gates of that mesh are decoded."""
    yield "| Gate | Near | Expected | Ranked | Symbol | Triangle |"
    yield "|---|---|---|---|---|---|"
    border = Border(len(MESH.base.vertices))
    for x, y in MESH.base.vertices:
        border.add(int(x), int(y))
    triangles = iter(MESH.base.triangles.tolist())
    border.place_triangle(*next(triangles))
    symbols = iter(mesh_symbols()[3:])
    while (gate := border.next_gate()) is not None:
        edge, near = gate
        symbol, known = next(symbols), border.ranked(edge, near)
        row = [plain(edge), str(near), plain(border.predicted(edge, near))]
        row += [" ".join(map(str, known)) or "none", str(symbol)]
        corners = next(triangles) if symbol else None
        yield "| " + " | ".join([*row, plain(corners) if corners else "none"]) + " |"
        if corners:
            border.place_triangle(*corners)


def pixels() -> Iterator[str]:
    """Yields the rows of the example picture in hexadecimal."""
    for row in from_bytes(EXAMPLE.read_bytes()).render(engine="numpy"):
        yield " ".join(bytes(p).hex() for p in row)


def fenced(lines: Iterator[str], language: str = "text") -> Iterator[str]:
    """Yields lines as a fenced code block."""
    yield f"```{language}"
    yield from lines
    yield "```"


PARTS: dict[str, Callable[[], Iterator[str]]] = {
    **{f"fields {k}": functools.partial(fields_table, v) for k, v in FIELDS.items()},
    "keys": lambda: fenced(keys_table(), "python"),
    "example": lambda: fenced(small_example()),
    "signed": lambda: fenced(signed_example()),
    "boundary": lambda: fenced(boundary_example()),
    "mesh": lambda: fenced(mesh_example()),
    "mesh steps": mesh_steps,
    "scales": lambda: fenced(pyramid.scales(), "python"),
    "levels": registry.levels_table,
    "registry chunks": registry.chunks_table,
    "registry numbers": registry.numbers_table,
    "models": pyramid.models,
    "registered": lambda: fenced(pyramid.registered(), "python"),
    "layout": pyramid.layout,
    "pyramid": lambda: fenced(pyramid.example()),
    "pyramid steps": pyramid.steps,
    "dump": lambda: fenced(dump(EXAMPLE.read_bytes())),
    "values": lambda: fenced(values(from_bytes(EXAMPLE.read_bytes()))),
    "pixels": lambda: fenced(pixels()),
}
"""Functions that generate the parts, by the name of the part."""

_PART = re.compile(r"^<!-- ([^\n]+) -->\n(.*?)^<!-- end -->\n", re.M | re.S)


def chapters() -> list[Path]:
    """Files of the specification: README, then the chapters by number."""
    return [FOLDER / "README.md", *sorted(FOLDER.glob("[0-9]*.md"), key=_number)]


def _number(chapter: Path) -> int:
    """Number of a chapter."""
    return int(chapter.name.partition("-")[0])


def shown() -> dict[str, str]:
    """Generated parts as they stand in the chapters, by name."""
    return {m[1]: m[2] for path in chapters() for m in _PART.finditer(path.read_text("utf-8"))}


def wanted(name: str) -> str:
    """Generated part as the code makes it."""
    return "".join(f"{line}\n" for line in PARTS[name]())


def registry_text() -> str:
    """Text of `registry.json` as the code makes it, with the ids in the chapters."""
    text = "".join(path.read_text("utf-8") for path in chapters())
    ids = re.findall(r"^\*\*\[([A-Z]{3}-\d+)\]\*\* ", text, re.M)
    return registry.as_json(FIELDS, ids)


def write() -> None:
    """Renews all generated parts and `registry.json`."""
    for path in chapters():
        text = path.read_text("utf-8")
        new = _PART.sub(lambda m: f"<!-- {m[1]} -->\n{wanted(m[1])}<!-- end -->\n", text)
        if new != text:
            path.write_text(new, "utf-8")
    REGISTRY.write_text(registry_text(), "utf-8")


def main(argv: list[str] | None = None) -> int:
    """Entry point; returns the exit code."""
    parser = argparse.ArgumentParser(prog="spec.tables", description=__doc__)
    parser.add_argument("--write", action="store_true", help="renew the chapters")
    if parser.parse_args(argv).write:
        write()
    stale = [name for name, text in shown().items() if text != wanted(name)]
    if REGISTRY.read_text("utf-8") != registry_text():
        stale.append(REGISTRY.name)
    for name in stale:
        print(f"not as the code says: {name}", file=sys.stderr)
    return 1 if stale else 0


if __name__ == "__main__":
    sys.exit(main())

"""Measurements as rows of a CSV file, and which of an older file still hold."""

from __future__ import annotations

import csv
import io
import os
from collections.abc import Iterable
from dataclasses import asdict, dataclass, fields
from typing import Any

from ..errors import InputError
from ..io.files import read_bytes


@dataclass(frozen=True)
class Row:
    """One picture by one codec at one quality.

    Attributes:
        picture: Name of the file without suffix.
        digest: Hash of its pixels.
        width: In pixels.
        height: In pixels.
        codec: Name of the codec.
        settings: What is fixed in it.
        version: Of its libraries.
        machine: Where it ran.
        quality: In the codec's own measure.
        bytes: Size of the whole file.
        bpp: Its bits a pixel.
        psnr: In dB, see `measure.psnr`.
        ms_ssim: 0..1, see `measure.ms_ssim`.
        encode_s: CPU seconds of encoding, all threads together.
        decode_s: CPU seconds of decoding.
    """

    picture: str
    digest: str
    width: int
    height: int
    codec: str
    settings: str
    version: str
    machine: str
    quality: float
    bytes: int
    bpp: float
    psnr: float
    ms_ssim: float
    encode_s: float
    decode_s: float

    @property
    def key(self) -> tuple[Any, ...]:
        """What has to agree for a measurement to be that of the same thing."""
        return self.digest, self.codec, self.settings, self.version, self.quality


HEAD = [field.name for field in fields(Row)]
_TYPES = {"int": int, "float": float, "str": str}


def to_csv(rows: Iterable[Row], head: bool = True) -> str:
    """Rows as CSV text."""
    out = io.StringIO()
    writer = csv.DictWriter(out, HEAD, lineterminator="\n")
    if head:
        writer.writeheader()
    for row in rows:
        writer.writerow(asdict(row))
    return out.getvalue()


def read_csv(path: str | os.PathLike[str]) -> list[Row]:
    """The rows of a file that `to_csv` wrote; a last line that was cut short is left out.

    Raises:
        InputError: It cannot be read, or is something else.
    """
    text = read_bytes(path).decode("utf-8", "replace")
    whole = text[: text.rfind("\n") + 1]
    lines = csv.DictReader(io.StringIO(whole))
    if lines.fieldnames != HEAD:
        raise InputError(f"{path}: not an rd.csv of this version; its first line should name "
                         f"the columns {', '.join(HEAD)}")  # fmt: skip
    try:
        return [Row(**{f.name: _TYPES[str(f.type)](line[f.name]) for f in fields(Row)})
                for line in lines]  # fmt: skip
    except (TypeError, ValueError):
        raise InputError(f"{path}: line {lines.line_num} is damaged; remove it") from None

"""Measurements as rows of a CSV file, with a key to recognize them in a later run."""

from __future__ import annotations

import csv
import io
import os
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass, fields
from typing import Any

from ..errors import InputError
from ..io.files import read_bytes


@dataclass(frozen=True)
class Row:
    """Measurement of one picture by one codec at one quality.

    Attributes:
        picture: Name of the picture file without suffix.
        digest: Hash of shape and pixels.
        width: Width in pixels.
        height: Height in pixels.
        codec: Name of the codec.
        settings: Description of its fixed settings.
        version: Versions of its libraries.
        machine: Machine that it ran on.
        quality: Quality in the codec's own measure.
        bytes: Size of the whole file.
        bpp: Size in bits per pixel.
        psnr: PSNR in dB; see `measure.psnr`.
        ms_ssim: MS-SSIM, 0..1; see `measure.ms_ssim`.
        ssimulacra2: SSIMULACRA 2; see `measure.ssimulacra2`. None where it was not asked for.
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
    ssimulacra2: float | None
    encode_s: float
    decode_s: float

    @property
    def key(self) -> tuple[Any, ...]:
        """Key that is equal for measurements of the same picture, codec, version and quality."""
        return self.digest, self.codec, self.settings, self.version, self.quality

    @property
    def perceptual(self) -> bool:
        """Whether SSIMULACRA 2 was measured."""
        return self.ssimulacra2 is not None


HEAD = [field.name for field in fields(Row)]
_TYPES: dict[str, Callable[[str], Any]] = {
    "int": int,
    "float": float,
    "str": str,
    "float | None": lambda text: float(text) if text else None,
}


def to_csv(rows: Iterable[Row], head: bool = True) -> str:
    """Rows as CSV text, with a line of column names if `head`."""
    out = io.StringIO()
    writer = csv.DictWriter(out, HEAD, lineterminator="\n")
    if head:
        writer.writeheader()
    for row in rows:
        writer.writerow(asdict(row))
    return out.getvalue()


def read_csv(path: str | os.PathLike[str]) -> list[Row]:
    """Reads the rows of a file that `to_csv` wrote; an unfinished last line is ignored.

    Raises:
        InputError: The file cannot be read, is damaged, or is another kind of file.
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

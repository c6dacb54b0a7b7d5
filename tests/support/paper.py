"""Runs of `pxi-bench paper` with little effort."""

import json
from pathlib import Path
from typing import Any

from proxyimg_codec.bench.paper.items import Effort

TINY = Effort(1, 37, 48, 30, 5, 2, 4, 1, 20, 40, 2)


def rows_of(out: Path, section: str) -> list[dict[str, Any]]:
    """All rows that a run has saved of a section."""
    found = sorted((out / "items" / section).iterdir())
    return [row for path in found for row in json.loads(path.read_bytes())["rows"]]

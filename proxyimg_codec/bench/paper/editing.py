"""Section *editing*: edits as scripts, beside true results."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from ...errors import InputError, PxiError
from .edit_sets import Case, humanedit, oir_bench, operations
from .items import Earlier, Effort, Given, Item, Pixels, Row
from .tables import Column, Table, mean

MINIATURE = "miniature"

OUTSIDE = 9
"""Pixels from what an edit may change, beyond which the rest should stay as it is."""

NETWORKS = {"clip_i": "CLIP-I", "clip_t": "CLIP-T", "dino": "DINO", "lpips": "LPIPS"}


def conclusions(rows: Sequence[Row]) -> list[str]:
    """Sentences on what edits gain, and on the measures that are missing."""
    said = []
    grouped = TABLE.grouped(rows)
    for (source, kind, method), group in grouped.items():
        own, still = (mean(g, "l2") for g in (group, grouped.get((source, kind, "unchanged"), ())))
        if method == "pxi" and own is not None and still:
            said.append(f"{source}, {kind}: L2 is {own / still:.2f} times that of doing nothing.")
    lost = [head for key, head in NETWORKS.items() if mean(rows, key) is None]
    if rows and lost:
        said.append(f"Missing, because no weights were given (`--weights`): {', '.join(lost)}.")
    missing = [n for n in ("HumanEdit", "OIR-Bench") if n not in {r["set"] for r in rows}]
    if rows and missing:
        said.append(f"Missing, because the data folder does not hold them: {', '.join(missing)}.")
    return said


TABLE = Table(
    rows=("set", "edit", "method"),
    columns=(
        Column("l1", "L1", "{:.4f}"),
        Column("l2", "L2 ×10⁻³", "{:.3f}"),
        Column("ms_ssim", "MS-SSIM", "{:.4f}"),
        Column("gradients", "HOG distance", "{:.3f}"),
        Column("outside", "L1 outside", "{:.4f}"),
        *(Column(key, head, "{:.3f}") for key, head in NETWORKS.items()),
        Column("seconds", "CPU s", "{:.1f}"),
    ),
    charted="l2",
    conclusions=conclusions,
    notes=(
        "L1 and L2 are of colours in 0..1, against the true result; *outside* is against the "
        f"picture before, {OUTSIDE} px and more away from what the edit may change. *unchanged* is "
        "the picture before, *encoded* the same without an edit, for scale. CPU seconds are of "
        "encoding and editing.",
        "The miniature puts drawings on Kodak crops, so true results are known: the drawing added, "
        "removed, doubled, or moved to the other side. It has HumanEdit's layout, with the mask as "
        "the one layer, and a script of `pxi-edit` for each edit.",
        "`humanedit/` (Parquet files, or `metadata.jsonl` with the same columns) and `oir-bench/` "
        "(YAML files, `dataset/` and `mask/`) in the data folder are read as they are published; "
        "pictures count if `scripts/` in the folder has their edit script. The published results "
        "of HumanEdit were painted by people with a generative program: even a right edit differs.",
        "The paper's figures are of those sets and are not comparable with those of the miniature.",
    ),
)


def items(given: Given, effort: Effort) -> list[Item]:
    """Items of the miniature, and of ``humanedit/`` and ``oir-bench/`` if they are there.

    Raises:
        InputError: Pictures for the miniature are missing, or a set cannot be read.
    """
    from . import miniature

    with TemporaryDirectory() as folder:
        miniature.write(given, effort, Path(folder) / MINIATURE)
        cases = humanedit(Path(folder) / MINIATURE, MINIATURE)
    if (given.data / "humanedit").is_dir():
        cases += humanedit(given.data / "humanedit")
    if (given.data / "oir-bench").is_dir():
        cases += oir_bench(given.data / "oir-bench")
    weights = dict(given.weights)
    return [
        Item("editing", f"{case.source} {case.name}", "edit", f"{effort!r} {case.digest} {weights}",
             case.before, partial(_measure, case=case, weights=weights, effort=effort.effort))
        for case in cases
    ]  # fmt: skip


def _measure(
    pixels: Pixels, earlier: Earlier, *, case: Case, weights: Mapping[str, Path], effort: int
) -> list[Row]:
    from ...api import encode

    started = time.process_time()
    inserts = {e.get("op") for e in case.edits} <= {"insert"}
    layers = {"max_layers": 1} if inserts else {"masks": list(case.masks)}
    image = encode(pixels, effort=effort, jobs=1, **layers)
    with TemporaryDirectory() as folder:
        try:
            edited = image.edited(*operations(case, Path(folder)))
        except PxiError as error:
            raise InputError(f"script of {case.name}: {error}") from None
    seconds = time.process_time() - started
    shown = {"pxi": edited.render(), "encoded": image.render(), "unchanged": pixels}
    return [
        _row(case, method, picture, weights) | ({"seconds": round(seconds, 2)} if
                                                method == "pxi" else {})
        for method, picture in shown.items()
    ]  # fmt: skip


def _row(case: Case, method: str, shown: Pixels, weights: Mapping[str, Path]) -> Row:
    import cv2

    from ..features import distance
    from ..measure import ms_ssim
    from .judges import judged

    # What is seen before or after may be elsewhere than the mask says.
    changed = case.changed.copy()
    if case.after is not None:
        changed |= (case.after != case.before).any(2)
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * OUTSIDE + 1, 2 * OUTSIDE + 1))
    rest = cv2.dilate(changed.astype(np.uint8), disc) == 0
    row: Row = {"set": case.source, "edit": case.kind, "method": method}
    if rest.any():
        row["outside"] = round(_l1(shown[rest], case.before[rest]), 6)
    if case.after is not None:
        square = ((shown.astype(float) - case.after) ** 2).mean() / 255**2
        row |= {"l1": round(_l1(shown, case.after), 6), "l2": round(1000 * float(square), 5),
                "ms_ssim": round(ms_ssim(shown, case.after), 6),
                "gradients": round(float(distance(shown, case.after).mean()), 5)}  # fmt: skip
    return row | judged(weights, shown, case.after, case.prompt)


def _l1(one: Pixels, other: Pixels) -> float:
    return float(np.abs(one.astype(float) - other).mean() / 255)

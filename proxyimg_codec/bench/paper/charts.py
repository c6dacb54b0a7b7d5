"""Plots of sections: the mean of each line of a table, and its pictures as dots."""

from __future__ import annotations

import io
from collections.abc import Sequence

from ..plots import OTHER, STYLE
from .items import Row
from .tables import Table, mean

OURS = "#d62728"


def plot(table: Table, rows: Sequence[Row], title: str, kind: str) -> bytes:
    """Draws the charted column of a table.

    Args:
        table: Form of the table.
        rows: The rows.
        title: Title above the plot.
        kind: ``svg`` or ``png``.

    Returns:
        The file; the same rows give the same bytes.
    """
    import matplotlib
    from matplotlib.figure import Figure

    column = next(c for c in table.columns if c.key == table.charted)
    groups = [(n, g) for n, g in table.grouped(rows).items() if mean(g, column.key) is not None]
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(8.6, 1.2 + 0.26 * len(groups)), dpi=160, layout="constrained")
        axes = figure.add_subplot()
        for k, (names, group) in enumerate(groups):
            colour = OURS if any(n.startswith("pxi") for n in names) else OTHER
            dots = [r[column.key] for r in group if r.get(column.key) is not None]
            value = mean(group, column.key) or 0.0
            axes.plot(dots, [k] * len(dots), "o", color=colour, alpha=0.45, markersize=2.6)
            axes.plot(value, k, "D", color=colour, markersize=5.5)
            axes.annotate(column.form.format(value), (1.01, k), xycoords=("axes fraction", "data"),
                          va="center", color=colour, annotation_clip=False)  # fmt: skip
        axes.set_yticks(range(len(groups)), [", ".join(filter(None, n)) for n, _ in groups])
        axes.invert_yaxis()
        axes.set_xlabel(f"{column.head}: the mean, and each picture as a dot")
        axes.grid(color="#e6e6e6", linewidth=0.6)
        axes.set_axisbelow(True)
        axes.set_title(title, loc="left", fontsize=10.5)
        axes.spines[["top", "right"]].set_visible(False)
        out = io.BytesIO()
        figure.savefig(out, format=kind, metadata={"Date": None} if kind == "svg" else {})
    return out.getvalue()

"""Bars of the means of a section, with a dot for each picture."""

from __future__ import annotations

import io
from collections.abc import Sequence

from ..plots import OTHER, STYLE
from .items import Row
from .tables import Table, mean

OURS = "#d62728"


def bars(table: Table, rows: Sequence[Row], title: str, kind: str) -> bytes:
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
            ours = any(n.startswith("pxi") for n in names)
            value = mean(group, column.key) or 0.0
            axes.barh(k, value, color=OURS if ours else OTHER, alpha=0.75, height=0.72)
            dots = [r[column.key] for r in group if r.get(column.key) is not None]
            axes.plot(dots, [k] * len(dots), "o", color="black", markersize=2.2)
            axes.annotate(column.form.format(value), (max(value, *dots), k), (4, 0), va="center",
                          textcoords="offset points", fontsize=8)  # fmt: skip
        values = [r[column.key] for _, g in groups for r in g if r.get(column.key) is not None]
        least, most = min(values), max(values)
        axes.set_xlim(max(least - 0.25 * (most - least) - 1e-9, 0), most + 0.12 * (most - least))
        axes.set_yticks(range(len(groups)), [", ".join(filter(None, n)) for n, _ in groups])
        axes.invert_yaxis()
        axes.set_xlabel(f"{column.head}, mean; a dot is a picture")
        axes.set_title(title, loc="left", fontsize=10.5)
        axes.spines[["top", "right"]].set_visible(False)
        out = io.BytesIO()
        figure.savefig(out, format=kind, metadata={"Date": None} if kind == "svg" else {})
    return out.getvalue()

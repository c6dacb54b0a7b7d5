"""Rate–distortion plots."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .measure import smooth
from .summary import Curve, Results

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COLOURS = {
    "jpeg": "#b07aa1", "webp": "#59a14f", "jp2": "#9c755f", "jxl": "#e0a020",
    "avif420": "#76a9d8", "avif444": "#2b6cb0", "avif420-s0": "#17365c",
    "svt": "#3aa6a0",
    "pxi": "#d62728", "pxi-fast": "#f08a7c", "pxi-masks": "#8c1515", "pxi-implicit": "#ff9f40",
}  # fmt: skip
"""Colours of the curves: warm reds for our codec, a quiet colour for each of the others."""

OTHER, PUBLISHED = "#444444", "#8a8a8a"

STYLE: Any = {
    "font.size": 9, "axes.edgecolor": "#666666", "svg.hashsalt": "pxi", "svg.fonttype": "none",
}  # fmt: skip
"""Style of all plots; the fixed salt makes the same plot give the same SVG file."""

AXES = {"PSNR": "RGB PSNR (dB)", "MS-SSIM": "MS-SSIM (dB, −10 log₁₀(1 − MS-SSIM))",
        "SSIMULACRA 2": "SSIMULACRA 2"}  # fmt: skip


def draw(
    results: Sequence[Results], metric: str, title: str, most: float, paths: Sequence[Path]
) -> None:
    """Draws the averaged curves up to `most` bits per pixel, with its name at the end of each.

    Args:
        results: The codecs; published curves are thin and dashed.
        metric: ``PSNR`` or ``MS-SSIM``.
        title: Title above the plot.
        most: Right end of the plot in bits per pixel.
        paths: Files to write, whose suffixes decide the types.
    """
    import matplotlib
    from matplotlib.figure import Figure
    from matplotlib.ticker import MaxNLocator

    shown = [(one, one.average(metric)) for one in results]
    shown = [(one, curve) for one, curve in shown if curve and curve[0][0] < most]
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(8.6, 5.6), dpi=160)
        axes = figure.add_axes((0.075, 0.095, 0.7, 0.83))
        ends = []
        for one, curve in shown:
            points = [p for p in curve if p[0] <= most]
            line = [p for p in smooth(curve) if p[0] <= most]
            # Lines are interpolated as for BD-rates; dots are measurements.
            axes.plot(*zip(*line or points, strict=True), **_line(one))
            if not one.published:
                axes.plot(*zip(*points, strict=True), **_dots(one))
            ends.append((one, (line or points)[-1], _slope(line)))
        axes.set_xlim(0, most)
        if any(one.published for one, _ in shown):
            title += "; dashed: published figures"
        axes.set_title(title, loc="left", fontsize=10.5)
        axes.set_xlabel("bits a pixel, whole file")
        axes.set_ylabel(AXES[metric])
        axes.grid(color="#e6e6e6", linewidth=0.6)
        axes.set_axisbelow(True)
        axes.spines[["top", "right"]].set_visible(False)
        axes.yaxis.set_major_locator(MaxNLocator(integer=True))
        _name_curves(axes, ends, most)
        for path in paths:
            # Without a date the same measurements give the same file.
            dated = {"Date": None} if path.suffix == ".svg" else {}
            figure.savefig(path, metadata=dated)


def _colour(one: Results) -> str:
    return PUBLISHED if one.published else COLOURS.get(one.name, OTHER)


def _line(one: Results) -> dict[str, Any]:
    if one.published:
        return {"color": PUBLISHED, "linewidth": 0.9, "linestyle": (0, (4, 2)), "zorder": 2}
    return {"color": _colour(one), "linewidth": 2.2 if _ours(one) else 1.4,
            "zorder": 4 if _ours(one) else 3}  # fmt: skip


def _dots(one: Results) -> dict[str, Any]:
    return {"color": _colour(one), "linestyle": "", "marker": "o",
            "markersize": 4.5 if _ours(one) else 3.5, "zorder": 4 if _ours(one) else 3}  # fmt: skip


def _ours(one: Results) -> bool:
    return one.name.startswith("pxi")


def _label(one: Results, pictures: int) -> str:
    some = 0 < len(one.rows) < pictures
    return f"{one.label} ({len(one.rows)} of {pictures})" if some else one.label


def _slope(line: Curve) -> float:
    """Slope at the end of a curve, in dB per unit of the natural logarithm of the rate."""
    if len(line) < 20:
        return 0.0
    (r0, q0), (r1, q1) = line[-20], line[-1]
    return (q1 - q0) / math.log(r1 / r0) if r1 > r0 else 0.0


def _name_curves(
    axes: Axes, ends: Sequence[tuple[Results, tuple[float, float], float]], most: float
) -> None:
    """Writes names right of the plot at the height of the curves, moved apart as far as needed."""
    if not ends:
        return
    bottom, top = axes.get_ylim()
    gap = (top - bottom) / 26
    heights = [quality + slope * math.log(most / rate) for _, (rate, quality), slope in ends]
    order = sorted(range(len(ends)), key=heights.__getitem__)
    places: list[float] = []
    for i in order:
        height = min(max(heights[i], bottom), top)
        places.append(max(height, places[-1] + gap) if places else height)
    # Names that were pushed beyond the top move down again, and those below them as well.
    for i in range(len(places) - 1, -1, -1):
        places[i] = min(places[i], top if i == len(places) - 1 else places[i + 1] - gap)
    pictures = max(len(one.rows) for one, _, _ in ends)
    for i, place in zip(order, places, strict=True):
        one, end, _ = ends[i]
        axes.annotate(
            _label(one, pictures), end, (most * 1.04, place), va="center", annotation_clip=False,
            color="#666666" if one.published else _colour(one),
            weight="bold" if _ours(one) else "normal",
            arrowprops={"arrowstyle": "-", "color": _colour(one), "linewidth": 0.5, "alpha": 0.6,
                        "shrinkA": 0, "shrinkB": 1, "relpos": (0, 0.5)},
        )  # fmt: skip

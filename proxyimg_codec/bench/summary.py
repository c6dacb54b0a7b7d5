"""Curves, BD-rates and tables from rows of measurements."""

from __future__ import annotations

import csv
import io
import json
import math
import statistics
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from .measure import bd_rate, decibel, quality_at
from .peers import Codec
from .rows import Row

Curve = list[tuple[float, float]]

RATES = (0.2, 0.4, 0.64, 1.0)
"""Rates in bits per pixel at which tables state the quality."""

ANCHORS = ("jpeg", "webp", "avif420", "avif444", "avif420-s0")
"""Codecs that the printed tables compare with, as far as they took part."""

METRICS: dict[str, Callable[[Row], float]] = {
    "PSNR": lambda row: row.psnr,
    "MS-SSIM": lambda row: row.ms_ssim,
    "SSIMULACRA 2": lambda row: math.nan if row.ssimulacra2 is None else row.ssimulacra2,
}

TO_DB: dict[str, Callable[[float], float]] = {
    "PSNR": lambda value: value, "MS-SSIM": decibel, "SSIMULACRA 2": lambda value: value,
}  # fmt: skip
"""Scale of each metric: dB where it has one. MS-SSIM is averaged as it is, interpolated in dB."""


@dataclass(frozen=True)
class Results:
    """All measurements of one codec, or its published curve.

    Attributes:
        name: Name of the codec.
        label: Name in plots.
        rows: Measurements by picture; empty if published.
        published: Curves of the average by metric, MS-SSIM not in dB; empty if measured.
    """

    name: str
    label: str
    rows: Mapping[str, Sequence[Row]]
    published: Mapping[str, Curve]

    def curve(self, metric: str, picture: str) -> Curve:
        """Points (rate in bits per pixel, quality in dB) of one picture."""
        value, scale = METRICS[metric], TO_DB[metric]
        return [(row.bpp, scale(value(row))) for row in self.rows[picture]]

    def average(self, metric: str, pictures: Sequence[str] | None = None) -> Curve:
        """Points (rate, quality in dB) averaged over pictures, at settings that all of them have.

        Args:
            metric: ``PSNR`` or ``MS-SSIM``.
            pictures: Names of the pictures; None = all.
        """
        scale = TO_DB[metric]
        if self.published:
            return [(rate, scale(value)) for rate, value in self.published.get(metric, [])]
        names = list(self.rows) if pictures is None else pictures
        by_quality: dict[float, list[Row]] = {}
        for name in names:
            for row in self.rows[name]:
                by_quality.setdefault(row.quality, []).append(row)
        value = METRICS[metric]
        return [
            (statistics.fmean(r.bpp for r in rows), scale(statistics.fmean(map(value, rows))))
            for _, rows in sorted(by_quality.items())
            if len(rows) == len(names)
        ]


@dataclass(frozen=True)
class Comparison:
    """BD-rates of one codec against an anchor, in per cent.

    Attributes:
        mean: Mean of the BD-rates of the pictures; NaN if no picture has one.
        curve: BD-rate of the averaged curves; NaN if there is none.
        better: Number of pictures with fewer bits than the anchor.
        pictures: Number of pictures that have a BD-rate.
    """

    mean: float
    curve: float
    better: int
    pictures: int


def collect(rows: Sequence[Row], codecs: Sequence[Codec]) -> list[Results]:
    """Groups measurements by codec, in the order of the codecs, without those that have none."""
    out = []
    for codec in codecs:
        by_picture: dict[str, list[Row]] = {}
        for row in sorted(rows, key=lambda r: (r.picture, r.quality)):
            if row.codec == codec.name:
                by_picture.setdefault(row.picture, []).append(row)
        if by_picture:
            out.append(Results(codec.name, codec.label, by_picture, {}))
    return out


def measured(results: Sequence[Results]) -> dict[str, str]:
    """Metrics that were measured, each with its name in files."""
    some = next((row for one in results for rows in one.rows.values() for row in rows), None)
    return {
        metric: metric.lower().replace("-", "").replace(" ", "")
        for metric in METRICS
        if metric != "SSIMULACRA 2" or (some is not None and some.perceptual)
    }


def published() -> list[Results]:
    """Reads published curves of the 24 Kodak pictures; ``published.json`` names their sources."""
    entries = json.loads(Path(__file__).with_name("published.json").read_text("utf-8"))
    keys = {"PSNR": "psnr", "MS-SSIM": "ms_ssim"}
    return [
        Results(e["name"], e["label"], {}, {m: list(zip(e["bpp"], e[k], strict=True))
                                            for m, k in keys.items() if k in e})
        for e in entries
    ]  # fmt: skip


def compare(one: Results, anchor: Results, metric: str, rates: tuple[float, float]) -> Comparison:
    """Compares two codecs on the pictures that both have, at rates in bpp within `rates`."""
    common = [name for name in anchor.rows if one.published or name in one.rows]
    each = [
        bd_rate(one.curve(metric, n), anchor.curve(metric, n), rates)
        for n in common
        if not one.published
    ]
    each = [value for value in each if not math.isnan(value)]
    return Comparison(
        statistics.fmean(each) if each else math.nan,
        bd_rate(one.average(metric, common), anchor.average(metric, common), rates),
        sum(value < 0 for value in each),
        len(each),
    )


def seconds(results: Results) -> tuple[float, float]:
    """Median CPU seconds of encoding and decoding a picture; NaN if published."""
    rows = [row for rows in results.rows.values() for row in rows]
    if not rows:
        return math.nan, math.nan
    return statistics.median(r.encode_s for r in rows), statistics.median(r.decode_s for r in rows)


def to_csv(results: Sequence[Results], rates: tuple[float, float]) -> str:
    """All figures as CSV text, one per line: codec, measure, against, value, pictures."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(["codec", "measure", "against", "value", "pictures"])
    for one in results:
        n = len(one.rows)
        lines = [(f"psnr_at_{rate:g}_bpp", "", quality_at(one.average("PSNR"), rate), n)
                 for rate in RATES]  # fmt: skip
        lines += [
            (name, "", value, n)
            for name, value in zip(("encode_cpu_s", "decode_cpu_s"), seconds(one), strict=True)
        ]
        for metric in measured(results):
            for anchor in results:
                if anchor is not one and not anchor.published:
                    c = compare(one, anchor, metric, rates)
                    name = f"bd_{metric.lower().replace('-', '_').replace(' ', '')}"
                    lines += [
                        (f"{name}_mean_pct", anchor.name, c.mean, c.pictures),
                        (f"{name}_curve_pct", anchor.name, c.curve, n),
                        (f"{name}_better", anchor.name, c.better, c.pictures),
                    ]
        for measure, against, value, count in lines:
            if not math.isnan(value):
                writer.writerow([one.name, measure, against, f"{value:.5g}", count or ""])
    return out.getvalue()


def tables(results: Sequence[Results], rates: tuple[float, float]) -> str:
    """Tables for people, as Markdown."""
    parts = ["Quality at a rate, and median CPU seconds a picture", _quality_table(results)]
    anchors = [r for name in ANCHORS for r in results if r.name == name]
    anchors = anchors or [r for r in results if not r.published][:1]
    span = f"{rates[0]:g} to {rates[1]:g} bpp"
    for metric in measured(results):
        parts += [
            f"BD-rate by {metric} over {span}: mean of the pictures' (that of the mean curve) "
            "[pictures with fewer bits/compared]",
            _bd_table(results, anchors, metric, rates),
        ]
    return "\n\n".join(parts) + "\n"


def _quality_table(results: Sequence[Results]) -> str:
    head = ["codec", "pictures", *(f"dB at {r:g} bpp" for r in RATES), "encode s", "decode s"]
    lines = [head]
    for one in results:
        curve, times = one.average("PSNR"), seconds(one)
        cells = [_number(quality_at(curve, rate), ".2f") for rate in RATES]
        cells += [_number(t, ".3g") for t in times]
        lines.append([_name(one), str(len(one.rows) or ""), *cells])
    return _markdown(lines)


def _bd_table(
    results: Sequence[Results], anchors: Sequence[Results], metric: str, rates: tuple[float, float]
) -> str:
    lines = [["codec", *(f"vs {a.name}" for a in anchors)]]
    for one in results:
        if one.average(metric):
            lines.append([_name(one), *(_bd_cell(one, a, metric, rates) for a in anchors)])
    return _markdown(lines)


def _bd_cell(one: Results, anchor: Results, metric: str, rates: tuple[float, float]) -> str:
    if one is anchor:
        return "0"
    c = compare(one, anchor, metric, rates)
    if one.published:
        return _number(c.curve, "(+.1f)")
    if not c.pictures:
        return ""
    return f"{c.mean:+.1f} {_number(c.curve, '(+.1f)')} [{c.better}/{c.pictures}]"


def _name(one: Results) -> str:
    return f"{one.label} (published)" if one.published else one.name


def _number(value: float, form: str) -> str:
    """Formats a number by `form`, which may be in brackets; NaN gives an empty string."""
    if math.isnan(value):
        return ""
    return f"({value:{form[1:-1]}})" if form[0] == "(" else f"{value:{form}}"


def _markdown(lines: Sequence[Sequence[str]]) -> str:
    widths = [max(len(line[i]) for line in lines) for i in range(len(lines[0]))]
    rule = [widths[0] * "-", *((w - 1) * "-" + ":" for w in widths[1:])]
    rows = [
        [line[0].ljust(widths[0]), *(c.rjust(w) for c, w in zip(line[1:], widths[1:], strict=True))]
        for line in lines
    ]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in [rows[0], rule, *rows[1:]])

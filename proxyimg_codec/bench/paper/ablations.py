"""Section *ablations*: parts of the paper's method left out, and its numbers varied."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

from ...encoder.implicit.node_problem import DEPTH, DIM, HIDDEN, OCTAVES, NodeOptions
from .items import Earlier, Effort, Given, Item, Pixels, Row
from .pictures import crops
from .tables import Column, Table, mean

METHOD = "edge + multi (the method)"

ABLATIONS = {
    "edge only": NodeOptions(local="none"),
    "edge + single": NodeOptions(local="single"),
    METHOD: NodeOptions(),
    "triangles only": NodeOptions(edge=False),
    "no feature encoding": NodeOptions(octaves=0),
    "inverse distance inside": NodeOptions(distance=True),
    "random code a node": NodeOptions(own_codes=True),
}
"""Variants of node sampling, by description; files cannot store the last two."""

SWEEPS = {
    "features of a code": {n: NodeOptions(dim=n) for n in (4, 8, DIM, 32)},
    "width": {n: NodeOptions(hidden=n) for n in (16, 32, HIDDEN, 128)},
    "hidden layers": {n: NodeOptions(depth=n) for n in (1, 2, DEPTH, 6)},
    "octaves": {n: NodeOptions(octaves=n) for n in (2, 5, OCTAVES, 12)},
}
"""Variants in which one number is another, by what it counts."""


def conclusions(rows: Sequence[Row]) -> list[str]:
    """Sentences on the parts of the method: what each of them gains or loses."""
    means = {names: mean(group, "psnr") for names, group in TABLE.grouped(rows).items()}
    whole = means.get(("parts", METHOD))
    if whole is None:
        return []
    return [
        f"{variant}: {value - whole:+.2f} dB against the method."
        for (study, variant), value in means.items()
        if study == "parts" and variant != METHOD and value is not None
    ]


TABLE = Table(
    rows=("study", "variant"),
    columns=(
        Column("psnr", "PSNR dB", "{:.2f}"),
        Column("parameters", "parameters", "{:.0f}"),
        Column("codes", "codes", "{:.0f}"),
        Column("seconds", "CPU s", "{:.1f}"),
    ),
    charted="psnr",
    conclusions=conclusions,
    paper=(
        {
            "study": "parts",
            "variant": "ProxyImg (paper)",
            "psnr": 36.99,
            "parameters": 59955,
            "codes": 263,
        },
    ),
    notes=(
        "All variants are node sampling, fitted in floating point with as many steps; one thing is "
        "changed at a time. The method has 16 features a code, four hidden layers of width 64, 10 "
        "octaves, and cells of o = 8 px.",
        "*Locality-sensitive codes* are those of the method: nodes sample a grid, so that near "
        "nodes have near codes. *A random code a node* gives each node a code of its own, which "
        "makes more parameters.",
        "The paper's pictures are others. Its 59,955 parameters are the 55,747 of the network and "
        "263 codes of 16 features, although its own spacing o = 8 gives the codes of the table. "
        "The numbers of parameters of two of its ablations do not decompose into a network and "
        "codes in this way, so nothing here is asserted of them.",
    ),
)


def items(given: Given, effort: Effort) -> list[Item]:
    """Items of crops of ``kodak/``; crops are half as wide as those of other sections.

    Raises:
        InputError: The folder is missing.
    """
    variants = {("parts", name): options for name, options in ABLATIONS.items()}
    for study, values in SWEEPS.items():
        variants |= {(study, str(n)): options for n, options in values.items()}
    return [
        Item("ablations", name, f"{study}, {variant}", repr(effort), pixels,
             partial(_measure, study=study, variant=variant, options=options, steps=effort.node))
        for name, pixels in crops(given.data / "kodak", effort.few, effort.side // 2)
        for (study, variant), options in variants.items()
    ]  # fmt: skip


def _measure(
    pixels: Pixels, earlier: Earlier, *, study: str, variant: str, options: NodeOptions, steps: int
) -> list[Row]:
    from . import ours

    if study != "parts" and options == NodeOptions():
        row = earlier[f"parts, {METHOD}"][0]  # the same fit
        return [{**row, "study": study, "variant": variant}]
    case = ours.Case("", pixels)
    problem = case.problem(options)
    found = ours.node(problem, steps)
    return [{
        "study": study, "variant": variant, "psnr": round(found.psnr, 4),
        "parameters": found.parameters, "codes": problem.codes, "seconds": round(found.seconds, 2),
    }]  # fmt: skip

"""The paper's tables, made again: `pxi-bench paper`; needs the ``bench`` extra.

A section is a module with `items` (what it measures), `TABLE` (how rows are shown) and notes. Each
item yields rows and is kept as a JSON file, so that an interrupted run goes on.
"""

SECTIONS = {
    "explicit": "explicit representations at ten shapes' worth of parameters",
    "implicit": "implicit representations at equal parameters",
    "resolution": "resolution freedom",
}
"""Titles of the sections that exist, by name, in the order of the report."""

MISSING = (
    "differentiable renderers (DiffVG, LIVE) and tracers", "compression", "ablations and sweeps",
    "geometry and texture editing", "animation",
)  # fmt: skip
"""Parts of the paper that have no section yet; reports name them."""

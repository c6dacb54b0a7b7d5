"""The paper's tables, made again: `pxi-bench paper`; needs the ``bench`` extra.

A section is a module with `items` (what it measures), `TABLE` (how rows are shown) and notes. Each
item yields rows and is kept as a JSON file, so that an interrupted run goes on.
"""

SECTIONS = {
    "explicit": "explicit representations at ten shapes' worth of parameters",
    "implicit": "implicit representations at equal parameters",
    "compression": "compression of photographs",
    "ablations": "ablations and parameter sweeps of node sampling",
    "editing": "geometry and texture editing",
    "resolution": "resolution freedom",
    "animation": "animation",
    "checks": "whether rivals reach their published figures",
}
"""Titles of the sections, by name, in the order of the report."""

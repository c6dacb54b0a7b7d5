"""Checks JSON against `motion.schema.json`."""

from __future__ import annotations

import json
from functools import cache
from importlib import resources
from typing import Any

from ..errors import UsageError
from ..io import json_schema


@cache
def schema() -> dict[str, Any]:
    """The published schema of motions; not to be changed."""
    text = resources.files(__package__).joinpath("motion.schema.json").read_text("utf-8")
    loaded: dict[str, Any] = json.loads(text)
    return loaded


def check(value: Any) -> None:
    """Checks the JSON value of a motion.

    Args:
        value: What `json.loads` gives.

    Raises:
        UsageError: It breaks a rule; the error names the place, such as ``layers.hair.pins[0]``,
            what is wrong, and what may be.
    """
    rules = schema()
    # What one of several keys is needed for is said better here than in general.
    json_schema.check(value, {k: v for k, v in rules.items() if k != "anyOf"}, rules["$defs"])
    if not any(key in value for rule in rules["anyOf"] for key in rule["required"]):
        raise UsageError("neither 'layers' nor 'preset' is given; one has to say what moves")

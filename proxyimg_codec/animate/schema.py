"""Check of JSON values against `motion.schema.json`."""

from __future__ import annotations

import json
from functools import cache
from importlib import resources
from typing import Any

from ..errors import UsageError
from ..io import json_schema


@cache
def schema() -> dict[str, Any]:
    """Returns the published JSON Schema of motions; it is cached, so it must not be changed."""
    text = resources.files(__package__).joinpath("motion.schema.json").read_text("utf-8")
    loaded: dict[str, Any] = json.loads(text)
    return loaded


def check(value: Any) -> None:
    """Checks the JSON value of a motion.

    Args:
        value: Value such as `json.loads` returns.

    Raises:
        UsageError: The value does not match the schema; the message says the place, such as
            ``layers.hair.pins[0]``, what is wrong, and what is allowed.
    """
    rules = schema()
    # This rule is checked here, for a better message than that of the general checker.
    json_schema.check(value, {k: v for k, v in rules.items() if k != "anyOf"}, rules["$defs"])
    if not any(key in value for rule in rules["anyOf"] for key in rule["required"]):
        raise UsageError("neither 'layers' nor 'preset' is given; one has to say what moves")

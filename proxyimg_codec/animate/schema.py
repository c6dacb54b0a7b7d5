"""Checks JSON against `motion.schema.json`, with the part of JSON Schema that it uses.

Unlike a general validator it needs nothing installed, refuses numbers that are not finite, and
says what is wrong in one line that names the place.
"""

from __future__ import annotations

import json
import math
from functools import cache
from importlib import resources
from typing import Any

from ..errors import UsageError

TYPES: dict[str, tuple[type, ...]] = {
    "object": (dict,),
    "array": (list,),
    "string": (str,),
    "boolean": (bool,),
    "number": (int, float),
    "integer": (int,),
}

ARTICLES = {"object": "an object", "array": "a list", "integer": "a whole number",
            "string": "a text", "number": "a number", "boolean": "true or false"}  # fmt: skip


@cache
def schema() -> dict[str, Any]:
    """The published schema of motions; not to be changed."""
    text = resources.files(__package__).joinpath("motion.schema.json").read_text("utf-8")
    loaded: dict[str, Any] = json.loads(text)
    return loaded


def check(value: Any, rule: dict[str, Any] | None = None, path: str = "") -> None:
    """Checks a JSON value.

    Args:
        value: What `json.loads` gives.
        rule: The schema it has to meet; by default that of motions.
        path: Where the value stands, such as ``layers.hair.pins[0]``.

    Raises:
        UsageError: It breaks a rule; the error names the path, what is wrong, and what may be.
    """
    rule = schema() if rule is None else rule
    if "$ref" in rule:
        rule = {**schema()["$defs"][rule["$ref"].rsplit("/", 1)[1]], **rule}
    place = f"{path}: " if path else ""
    if "type" in rule and not _is(value, rule["type"]):
        raise UsageError(f"{place}{_shown(value)} is not {ARTICLES[rule['type']]}")
    if "const" in rule and (value != rule["const"] or isinstance(value, bool)):
        raise UsageError(f"{place}{_shown(value)} must be {rule['const']}")
    if "enum" in rule and value not in rule["enum"]:
        raise UsageError(f"{place}{_shown(value)} is none of {', '.join(rule['enum'])}")
    if isinstance(value, int | float) and not isinstance(value, bool):
        _check_number(value, rule, place)
    elif isinstance(value, list):
        _check_size(len(value), rule, "Items", place)
        for i, item in enumerate(value):
            check(item, rule.get("items", {}), f"{path}[{i}]")
    elif isinstance(value, dict):
        _check_object(value, rule, path, place)
    if "anyOf" in rule and path:
        _check_any(value, rule["anyOf"], path)


def _is(value: Any, kind: str) -> bool:
    if isinstance(value, bool):
        return kind == "boolean"
    whole = isinstance(value, float) and value.is_integer()
    return isinstance(value, TYPES[kind]) or (kind == "integer" and whole)


def _check_number(value: float, rule: dict[str, Any], place: str) -> None:
    # A whole number may be too large for a float.
    if isinstance(value, float) and not math.isfinite(value):
        raise UsageError(f"{place}{value} is not a finite number")
    if "exclusiveMinimum" in rule and value <= rule["exclusiveMinimum"]:
        raise UsageError(f"{place}{value} is not positive")
    least, most = rule.get("minimum", -math.inf), rule.get("maximum", math.inf)
    if not least <= value <= most:
        least = rule.get("minimum", "more than 0")
        raise UsageError(f"{place}{_shown(value)} is out of range; {least} to {most} is possible")


def _check_size(size: int, rule: dict[str, Any], what: str, place: str) -> None:
    least, most = rule.get(f"min{what}", 0), rule.get(f"max{what}", math.inf)
    if not least <= size <= most:
        wanted = f"{least}" if least == most else f"{least} to {most}"
        raise UsageError(f"{place}has {size} {what.lower()} where {wanted} are possible")


def _check_object(value: dict[str, Any], rule: dict[str, Any], path: str, place: str) -> None:
    known, more = rule.get("properties", {}), rule.get("additionalProperties", {})
    for key, item in value.items():
        if key not in known and more is False:
            raise UsageError(f"{place}unknown key {key!r}; known are {', '.join(known)}")
        check(item, known.get(key, more), f"{path}.{key}" if path else key)
    needed = [*rule.get("required", ())]
    for key, others in rule.get("dependentRequired", {}).items():
        needed += others if key in value else ()
    for key in needed:
        if key not in value:
            raise UsageError(f"{place}{key!r} is missing")
    _check_size(len(value), rule, "Properties", place)
    if not path and not any(v["required"][0] in value for v in rule.get("anyOf", ())):
        raise UsageError("neither 'layers' nor 'preset' is given; one has to say what moves")


def _check_any(value: Any, rules: list[dict[str, Any]], path: str) -> None:
    """Checks against that one of several rules which the value seems meant for."""
    chosen = [schema()["$defs"][r["$ref"].rsplit("/", 1)[1]] for r in rules]
    plain = next(r for r in chosen if "enum" in r)
    objects = [r for r in chosen if "properties" in r]
    if isinstance(value, str):
        return check(value, plain, path)
    for rule in objects:
        if isinstance(value, dict) and (len(objects) == 1 or set(rule["properties"]) & set(value)):
            return check(value, rule, path)
    shapes = [", ".join(r["properties"]) for r in objects]
    raise UsageError(
        f"{path}: {_shown(value)} is neither one of {', '.join(plain['enum'])} nor an object with "
        f"{' or with '.join(shapes)}"
    )


def _shown(value: Any) -> str:
    """A value as JSON, cut if long."""
    try:
        text = json.dumps(value)
    except (TypeError, ValueError, RecursionError):
        text = repr(type(value).__name__)
    return text if len(text) <= 40 else text[:37] + "..."

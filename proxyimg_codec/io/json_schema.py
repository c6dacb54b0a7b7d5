"""Checker of JSON values against the part of JSON Schema that this package uses.

Unlike a general validator it needs no other package, refuses numbers that are not finite, and gives
an error message of one line that names the place.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping, Sequence
from typing import Any

from ..errors import UsageError

Rule = Mapping[str, Any]
"""A schema or a part of one."""

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


def check(
    value: Any,
    rule: Rule,
    definitions: Mapping[str, Rule] | None = None,
    *,
    whole_floats: bool = True,
) -> None:
    """Checks a JSON value against a schema.

    Known keywords are `type`, `const`, `enum`, `minimum`, `maximum`, `exclusiveMinimum` (only 0),
    `pattern`, `items`, `minItems`, `maxItems`, `properties`, `additionalProperties`, `required`,
    `dependentRequired`, `minProperties`, `maxProperties` and `$ref`; and `anyOf` of one definition
    with an enum and others with properties.

    Args:
        value: A value as `json.loads` returns it.
        rule: The schema.
        definitions: Schemas by name, which ``"$ref": "#/$defs/name"`` refers to.
        whole_floats: Whether 2.0 is an integer, as in JSON Schema.

    Raises:
        UsageError: The value breaks a rule. The message names the place, such as
            ``layers.hair.pins[0]``, the problem, and what is allowed.
    """
    _Check(definitions or {}, whole_floats).value(value, rule, "")


class _Check:
    """Check of one value."""

    def __init__(self, definitions: Mapping[str, Rule], whole_floats: bool) -> None:
        self._definitions, self._whole_floats = definitions, whole_floats

    def _named(self, reference: Rule) -> Rule:
        """Definition that a reference names."""
        return self._definitions[reference["$ref"].rsplit("/", 1)[1]]

    def value(self, value: Any, rule: Rule, path: str) -> None:
        """Checks the value at the place `path`."""
        if "$ref" in rule:
            rule = {**self._named(rule), **rule}
        place = f"{path}: " if path else ""
        self._kind(value, rule, place)
        if isinstance(value, int | float) and not isinstance(value, bool):
            _check_number(value, rule, place)
        elif isinstance(value, str):
            _check_text(value, rule, place)
        elif isinstance(value, list):
            _check_size(len(value), rule, "Items", place)
            for i, item in enumerate(value):
                self.value(item, rule.get("items", {}), f"{path}[{i}]")
        elif isinstance(value, dict):
            self._object(value, rule, path, place)
        if "anyOf" in rule:
            self._any_of(value, [self._named(r) for r in rule["anyOf"]], path, place)

    def _kind(self, value: Any, rule: Rule, place: str) -> None:
        """Checks `type`, `const` and `enum`."""
        kinds = rule.get("type", [])
        kinds = [kinds] if isinstance(kinds, str) else kinds
        if kinds and not any(self._is(value, kind) for kind in kinds):
            wanted = " or ".join(ARTICLES[kind] for kind in kinds)
            raise UsageError(f"{place}{_shown(value)} is not {wanted}")
        if "const" in rule and (value != rule["const"] or isinstance(value, bool)):
            raise UsageError(f"{place}{_shown(value)} must be {rule['const']}")
        if "enum" in rule and value not in rule["enum"]:
            raise UsageError(f"{place}{_shown(value)} is none of {', '.join(rule['enum'])}")

    def _is(self, value: Any, kind: str) -> bool:
        """Whether a value is of a type; booleans are not numbers."""
        if isinstance(value, bool):
            return kind == "boolean"
        whole = self._whole_floats and isinstance(value, float) and value.is_integer()
        return isinstance(value, TYPES[kind]) or (kind == "integer" and whole)

    def _object(self, value: dict[str, Any], rule: Rule, path: str, place: str) -> None:
        """Checks the keys and values of an object."""
        known, more = rule.get("properties", {}), rule.get("additionalProperties", {})
        for key, item in value.items():
            if key not in known and more is False:
                raise UsageError(f"{place}unknown key {key!r}; known are {', '.join(known)}")
            self.value(item, known.get(key, more), f"{path}.{key}" if path else key)
        needed = [*rule.get("required", ())]
        for key, others in rule.get("dependentRequired", {}).items():
            needed += others if key in value else ()
        for key in needed:
            if key not in value:
                raise UsageError(f"{place}{key!r} is missing")
        _check_size(len(value), rule, "Properties", place)

    def _any_of(self, value: Any, rules: Sequence[Rule], path: str, place: str) -> None:
        """Checks a value against the one of several rules that it seems to be meant for."""
        plain = next(r for r in rules if "enum" in r)
        objects = [r for r in rules if "properties" in r]
        if isinstance(value, str):
            return self.value(value, plain, path)
        for rule in objects:
            if isinstance(value, dict) and (len(objects) == 1 or {*rule["properties"]} & {*value}):
                return self.value(value, rule, path)
        shapes = [", ".join(r["properties"]) for r in objects]
        raise UsageError(
            f"{place}{_shown(value)} is neither one of {', '.join(plain['enum'])} nor an object "
            f"with {' or with '.join(shapes)}"
        )


def _check_number(value: float, rule: Rule, place: str) -> None:
    # Only floats are tested: a large integer cannot be converted to one.
    if isinstance(value, float) and not math.isfinite(value):
        raise UsageError(f"{place}{value} is not a finite number")
    if "exclusiveMinimum" in rule and value <= rule["exclusiveMinimum"]:
        raise UsageError(f"{place}{value} is not positive")
    least, most = rule.get("minimum", -math.inf), rule.get("maximum", math.inf)
    if not least <= value <= most:
        least = rule.get("minimum", "more than 0")
        raise UsageError(f"{place}{_shown(value)} is out of range; {least} to {most} is possible")


def _check_text(value: str, rule: Rule, place: str) -> None:
    if re.search(rule.get("pattern", ""), value) is None:
        raise UsageError(f"{place}{_shown(value)} does not match {rule['pattern']}")


def _check_size(size: int, rule: Rule, what: str, place: str) -> None:
    """Checks the number of items of a list, or of keys of an object."""
    least, most = rule.get(f"min{what}", 0), rule.get(f"max{what}", math.inf)
    if not least <= size <= most:
        wanted = f"{least}" if least == most else f"{least} to {most}"
        raise UsageError(f"{place}has {size} {what.lower()} where {wanted} are possible")


def _shown(value: Any) -> str:
    """Formats a value as JSON, cut if it is long."""
    try:
        text = json.dumps(value)
    except (TypeError, ValueError, RecursionError):
        text = repr(type(value).__name__)
    return text if len(text) <= 40 else text[:37] + "..."

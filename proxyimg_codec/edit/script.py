"""Edit scripts: operations in a JSON file, and the schema that describes them.

`python -m proxyimg_codec.edit.script` prints the schema.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from typing import Any

from ..errors import PxiError, UsageError
from ..model import Picture
from . import appearance, structure, transforms
from .operations import KINDS, OPERATIONS, run

__all__ = ["OPERATIONS", "appearance", "apply", "parse", "schema", "structure", "transforms"]


def apply(picture: Picture, operations: Iterable[Mapping[str, Any]], first: int = 1) -> Picture:
    """Applies all `operations` to a picture, in order.

    Args:
        picture: The picture.
        operations: The operations, as in a script.
        first: Number of the first operation in error messages.

    Raises:
        PxiError: An operation failed; the message begins with its number. It is a `UsageError` if
            the operation is unknown or cannot be done.
    """
    for number, values in enumerate(operations, first):
        try:
            picture = run(picture, values)
        except PxiError as error:
            error.args = (f"edit {number}: {error}",)
            raise
    return picture


def parse(text: str, where: str) -> list[Mapping[str, Any]]:
    """Reads the operations of a script; they are checked when they are applied.

    Args:
        text: The script, JSON.
        where: Name of the script in error messages.

    Raises:
        UsageError: The text is not JSON, or not a script.
    """
    try:
        script = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise UsageError(f"{where}: is not valid JSON: {error}") from None
    if not isinstance(script, dict) or script.get("version") != 1:
        raise UsageError(f'{where}: must be an object with "version": 1 and a list "edits"')
    edits = script.get("edits")
    if not isinstance(edits, list) or set(script) - {"version", "edits", "$schema"}:
        raise UsageError(f'{where}: must have a list "edits" and nothing else beside "version"')
    return edits


def schema() -> dict[str, Any]:
    """JSON schema of scripts."""
    variants = []
    for name, operation in OPERATIONS.items():
        properties: dict[str, Any] = {"op": {"const": name}}
        for key, parameter in operation.parameters.items():
            properties[key] = {**KINDS[parameter.kind], "description": parameter.meaning}
        variants.append(
            {
                "description": operation.meaning,
                "properties": properties,
                "required": ["op", *(k for k, p in operation.parameters.items() if p.needed)],
                "additionalProperties": False,
            }
        )
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "Edits of a .pxi picture",
        "type": "object",
        "properties": {
            "$schema": {"type": "string"},
            "version": {"const": 1},
            "edits": {"type": "array", "items": {"type": "object", "oneOf": variants}},
        },
        "required": ["version", "edits"],
        "additionalProperties": False,
    }


if __name__ == "__main__":
    print(json.dumps(schema(), indent=2))

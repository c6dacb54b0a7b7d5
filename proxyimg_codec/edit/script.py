"""Edit scripts: operations in a JSON file, and the schema that describes them.

`python -m proxyimg_codec.edit.script` prints the schema.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from typing import Any

from ..errors import PxiError, UsageError
from ..model import Picture
from . import appearance, complete, cut, generate, insert, merge, motion, structure, transforms
from .history import undone
from .operations import KINDS, OPERATIONS, run
from .positions import Positions

__all__ = [
    "OPERATIONS", "Row", "appearance", "apply", "complete", "cut", "generate", "insert", "merge",
    "motion", "parse", "schema", "structure", "transforms",
]  # fmt: skip


class Row:
    """A row of edits of one picture. Positions of layers are those before the first of them.

    Args:
        picture: The picture to edit.

    Attributes:
        picture: The picture after the edits so far.
    """

    def __init__(self, picture: Picture) -> None:
        self.picture = picture
        self._number = 0
        self._positions = [Positions.of(picture)]

    def apply(self, operation: Mapping[str, Any]) -> None:
        """Applies an operation, as in a script.

        Raises:
            PxiError: It failed; the message begins with its number in the row. It is a `UsageError`
                if the operation is unknown or cannot be done.
        """
        self._number += 1
        try:
            self.picture, positions = run(self.picture, operation, self._positions[-1])
        except PxiError as error:
            error.args = (f"edit {self._number}: {error}",)
            raise
        self._positions.append(positions)

    def undo(self, steps: int) -> None:
        """Takes back the last `steps` edits, also those before this row.

        Raises:
            PxiError: As `history.undone`.
        """
        self.picture = undone(self.picture, steps)
        del self._positions[max(1, len(self._positions) - steps) :]


def apply(picture: Picture, operations: Iterable[Mapping[str, Any]]) -> Picture:
    """Applies all `operations` to a picture, in order, as a `Row`.

    Args:
        picture: The picture.
        operations: The operations, as in a script.

    Raises:
        PxiError: As `Row.apply`.
    """
    row = Row(picture)
    for operation in operations:
        row.apply(operation)
    return row.picture


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

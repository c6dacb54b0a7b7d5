"""Mutation operators: small changes of a source that may make it wrong.

The operators are those of Offutt et al. 1996, "An Experimental Determination of Sufficient Mutant
Operators", and a few for arrays.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

_COMPARED: dict[type[ast.cmpop], type[ast.cmpop]] = {
    ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt, ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq, ast.Is: ast.IsNot, ast.IsNot: ast.Is, ast.In: ast.NotIn, ast.NotIn: ast.In,
}  # fmt: skip
_OPPOSED = (ast.Eq, ast.NotEq, ast.Is, ast.IsNot, ast.In, ast.NotIn)
"""Comparisons that `_COMPARED` replaces by their opposites."""

_COMPUTED: dict[type[ast.operator], type[ast.operator]] = {
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.FloorDiv, ast.FloorDiv: ast.Mult,
    ast.Div: ast.Mult, ast.Mod: ast.FloorDiv, ast.Pow: ast.Mult, ast.MatMult: ast.Mult,
    ast.LShift: ast.RShift, ast.RShift: ast.LShift, ast.BitAnd: ast.BitOr, ast.BitOr: ast.BitAnd,
}  # fmt: skip
_NAMES = (
    ("min", "max"), ("minimum", "maximum"), ("fmin", "fmax"), ("any", "all"), ("floor", "ceil"),
    ("argmin", "argmax"),
)  # fmt: skip
_RENAMED = {a: b for pair in _NAMES for a, b in (pair, pair[::-1])}

_NUMBERS = re.compile(r"(Ints|Floats|Reals|Values|NDArray\[np\.(u?int|float)\d+\]|int|float)$")
"""Pattern of result types that can be negated."""

_ELSEWHERE = {
    "kernel", "context_native", "synthesis_native", "native", "run_native", "cache", "_caching",
    "progress", "TYPE_CHECKING",
}  # fmt: skip
"""Names in code that changes no pixel: the compiled kernel, caches, reports of progress."""


@dataclass
class Change:
    """Replacement of a child of a node.

    Attributes:
        parent: The node.
        field: Name of the field that holds the child.
        index: Position in the field if that is a list.
        other: The replacement.
        operator: Name of the mutation operator.
        statement: The statement that contains the node.
        function: Qualified name of the function; empty at the level of the module.
    """

    parent: ast.AST
    field: str
    index: int | None
    other: Any
    operator: str
    statement: ast.stmt
    function: str

    def swap(self) -> None:
        """Makes the change; a second call undoes it."""
        here = getattr(self.parent, self.field)
        if self.index is None:
            setattr(self.parent, self.field, self.other)
            self.other = here
        else:
            here[self.index], self.other = self.other, here[self.index]


def changes(tree: ast.Module) -> list[Change]:
    """All changes of a source, in the order of its text.

    Statements about the compiled kernel or a cache are not changed. Neither are error messages,
    annotations, defaults of arguments, assertions, imports, and declarations of fields in classes.
    """
    return [change for statement in tree.body for change in _of_statement(statement, "", False)]


def _of_block(node: ast.AST, field: str, function: str, negative: bool) -> Iterator[Change]:
    """Yields changes of the statements in a field of a node, and removals of statements."""
    for index, statement in enumerate(getattr(node, field)):
        # Assignments to names are kept: without them, code that follows would only not run.
        droppable = isinstance(statement, ast.Raise | ast.AugAssign | ast.Continue | ast.Break) or (
            isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Call)
        )
        if isinstance(statement, ast.Assign):
            droppable = all(isinstance(t, ast.Subscript) for t in statement.targets)
        if droppable and not _elsewhere(statement):
            yield Change(node, field, index, ast.Pass(), "drop", statement, function)
        yield from _of_statement(statement, function, negative)


def _of_statement(statement: ast.stmt, function: str, negative: bool) -> Iterator[Change]:
    """Yields changes of a statement and of all in it.

    Args:
        statement: The statement.
        function: Qualified name of the function around it.
        negative: Whether that function returns numbers, which can be negated.
    """
    inside: Mapping[type, tuple[str, ...]] = {
        ast.For: ("body", "orelse"), ast.While: ("body",), ast.With: ("body",),
        ast.Try: ("body", "orelse", "finalbody"), ast.If: ("body", "orelse"),
    }  # fmt: skip
    if isinstance(statement, ast.FunctionDef):
        if not re.fullmatch(r"__(repr|str|hash)__", statement.name):
            name = f"{function}.{statement.name}".lstrip(".")
            result = ast.unparse(statement.returns) if statement.returns else ""
            yield from _of_block(statement, "body", name, bool(_NUMBERS.fullmatch(result)))
    elif isinstance(statement, ast.ClassDef):
        for part in statement.body:
            if isinstance(part, ast.FunctionDef):
                yield from _of_statement(part, f"{function}.{statement.name}".lstrip("."), False)
    elif isinstance(statement, ast.Raise | ast.Assert | ast.Import | ast.ImportFrom):
        return
    elif isinstance(statement, ast.If) and _elsewhere(statement.test):
        yield from _of_block(statement, "orelse", function, negative)
    elif isinstance(statement, tuple(inside)):
        for name in ("test", "iter"):
            if hasattr(statement, name):
                yield from _of_child(statement, name, None, statement, function)
        for field in inside[type(statement)]:
            yield from _of_block(statement, field, function, negative)
        for handler in getattr(statement, "handlers", []):
            yield from _of_block(handler, "body", function, negative)
    elif not _elsewhere(statement):
        if isinstance(statement, ast.Return) and statement.value is not None and negative:
            other = ast.UnaryOp(ast.USub(), statement.value)
            yield Change(statement, "value", None, other, "negative", statement, function)
        if isinstance(statement, ast.AugAssign):
            yield from _of_operator(statement, "op", None, statement, function)
        if not isinstance(statement, ast.Expr) or not isinstance(statement.value, ast.Constant):
            yield from _of_fields(statement, statement, function)


def _elsewhere(node: ast.AST) -> bool:
    """Whether a node is about things that change no pixel."""
    names = (getattr(part, "id", getattr(part, "attr", None)) for part in ast.walk(node))
    return not {*names}.isdisjoint(_ELSEWHERE)


def _of_fields(node: ast.AST, statement: ast.stmt, function: str) -> Iterator[Change]:
    """Yields changes of all parts of a node except annotations."""
    for field, value in ast.iter_fields(node):
        if field == "annotation":
            continue
        if isinstance(value, list):
            for index in range(len(value)):
                yield from _of_child(node, field, index, statement, function)
        elif isinstance(value, ast.AST):
            yield from _of_child(node, field, None, statement, function)


def _of_child(
    parent: ast.AST, field: str, index: int | None, statement: ast.stmt, function: str
) -> Iterator[Change]:
    """Yields changes of one part of an expression and of all in it."""
    node: Any = getattr(parent, field) if index is None else getattr(parent, field)[index]
    if isinstance(node, ast.JoinedStr) or not hasattr(node, "_fields"):
        return

    def to(other: Any, operator: str) -> Change:
        return Change(parent, field, index, other, operator, statement, function)

    if field in ("test", "ifs"):
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
            yield to(node.operand, "negate")
        elif not (isinstance(node, ast.Compare) and isinstance(node.ops[-1], _OPPOSED)):
            yield to(ast.UnaryOp(ast.Not(), node), "negate")
    elif isinstance(node, ast.UnaryOp) and not isinstance(node.operand, ast.Constant):
        yield to(node.operand, "unary")
    if isinstance(node, ast.Constant):
        yield from (to(ast.Constant(other), "constant") for other in _near(node.value))
    elif isinstance(node, ast.BoolOp):
        other = ast.Or() if isinstance(node.op, ast.And) else ast.And()
        yield Change(node, "op", None, other, "and/or", statement, function)
    elif isinstance(node, ast.BinOp):
        yield from _of_operator(node, "op", None, statement, function)
    elif isinstance(node, ast.Compare):
        for k in range(len(node.ops)):
            yield from _of_operator(node, "ops", k, statement, function)
    elif isinstance(node, ast.Name | ast.Attribute) and field == "func":
        place = "id" if isinstance(node, ast.Name) else "attr"
        name = _RENAMED.get(getattr(node, place))
        if name:
            yield Change(node, place, None, name, "name", statement, function)
    elif isinstance(node, ast.Slice):
        for bound in ("lower", "upper"):
            there = getattr(node, bound)
            if there is not None and getattr(there, "value", None) != 0:
                yield Change(node, bound, None, None, "slice", statement, function)
    yield from _of_fields(node, statement, function)


def _of_operator(
    node: ast.AST, field: str, index: int | None, statement: ast.stmt, function: str
) -> Iterator[Change]:
    """Yields the change of an operator."""
    old = getattr(node, field) if index is None else getattr(node, field)[index]
    kind = type(old)
    if kind in _COMPARED:
        yield Change(node, field, index, _COMPARED[kind](), "compare", statement, function)
    elif kind in _COMPUTED:
        yield Change(node, field, index, _COMPUTED[kind](), "arithmetic", statement, function)


def _near(value: Any) -> tuple[Any, ...]:
    """Constants to replace another by."""
    if isinstance(value, bool):
        return (not value,)
    return (value + 1, value - 1) if isinstance(value, int | float) else ()

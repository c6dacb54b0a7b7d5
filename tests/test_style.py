"""Style of the source that no linter checks: first words of docstrings, and lengths."""

import ast
import functools
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
MODULES = sorted(
    p for name in ("proxyimg_codec", "conformance") for p in (ROOT / name).rglob("*.py")
)
NAMES = [path.relative_to(ROOT).as_posix() for path in MODULES]

RIDDLE = re.compile(r"(What|How|Where|Which|Who|When|Why|Those|That|All that)\b")
"""First words of docstrings that ask a question or lack a noun."""

FUNCTION_LINES, FILE_LINES = 60, 400

Function = ast.FunctionDef | ast.AsyncFunctionDef
Documented = ast.Module | ast.ClassDef | Function


@functools.cache
def parts(path: Path) -> list[Documented]:
    """A module, its classes and its functions."""
    tree = ast.parse(path.read_text("utf-8"))
    return [node for node in ast.walk(tree) if isinstance(node, Documented)]


def name_of(part: Documented) -> str:
    return "module" if isinstance(part, ast.Module) else f"{part.name}, line {part.lineno}"


@pytest.mark.parametrize("path", MODULES, ids=NAMES)
def test_docstrings_begin_with_a_noun_or_a_verb(path):
    found = {name_of(part): ast.get_docstring(part) or "" for part in parts(path)}
    assert not {name: text for name, text in found.items() if RIDDLE.match(text)}


@pytest.mark.parametrize("path", MODULES, ids=NAMES)
def test_functions_fit_on_a_screen(path):
    functions = (part for part in parts(path) if isinstance(part, Function))
    lines = {name_of(f): (f.end_lineno or f.lineno) - f.lineno + 1 for f in functions}
    assert not {name: count for name, count in lines.items() if count > FUNCTION_LINES}


def test_files_of_the_package_are_short():
    package = (path for path in MODULES if path.is_relative_to(ROOT / "proxyimg_codec"))
    lines = {str(path): len(path.read_text("utf-8").splitlines()) for path in package}
    assert not {name: count for name, count in lines.items() if count > FILE_LINES}


def test_riddles_are_recognized():
    for text in ("What is found.", "Those of a layer.", "All that is drawn.", "How often."):
        assert RIDDLE.match(text)
    for text in ("Whether it is.", "All layers.", "Whatever.", "Returns what is found."):
        assert not RIDDLE.match(text)

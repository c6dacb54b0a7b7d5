"""Faults are made as they should be, and found; for all: `python -m conformance.mutants`."""

import ast
import json

import pytest

from conformance.cases import load
from conformance.mutants import __main__ as command
from conformance.mutants import inputs, record, verdicts
from conformance.mutants.runs import ROOT, Caught, Fault, forked, run
from conformance.mutants.source import Mutant, choose, mutants, mutated

FEW = (
    "layers", "bits-3", "hole", "alpha", "opacity", "region", "reduced", "diffusion", "lanes",
    "moves-loop-1", "closing-1", "overlaid", "turned", "beyond", "node-few", "pyramid-sample",
    "pyramid-odd", "pyramid-escapes", "pyramid-raw-bits", "pyramid-stretched", "pyramid-moved",
    "invalid-crc-head", "invalid-step-zero", "invalid-mesh-flat", "invalid-escapes-long",
    "invalid-type-digit", "limit-side",
)  # fmt: skip
"""Cases that run much of the decoder in little time."""

SEED = 4


@pytest.fixture(scope="module")
def suite():
    return verdicts.Suite([case for case in load() if case.name in FEW])


@pytest.fixture(scope="module")
def everything():
    return verdicts.all_mutants()


def changed(source, operator=None):
    """The bodies of all mutants of a source, as text."""
    found = [m for m in mutants("a.py", source) if operator in (None, m.operator)]
    return {ast.unparse(mutated(source, m.number)) for m in found}


@pytest.mark.parametrize(
    ("operator", "source", "wanted"),
    [
        ("compare", "x = a < b <= c", {"x = a <= b <= c", "x = a < b < c"}),
        ("compare", "x = a == b", {"x = a != b"}),
        ("compare", "x = a is None", {"x = a is not None"}),
        ("compare", "x = a in b", {"x = a not in b"}),
        ("arithmetic", "x = a + b * c", {"x = a - b * c", "x = a + b // c"}),
        ("arithmetic", "x <<= a", {"x >>= a"}),
        ("arithmetic", "x = a & b", {"x = a | b"}),
        ("constant", "x = f(7)", {"x = f(8)", "x = f(6)"}),
        ("constant", "x = True", {"x = False"}),
        ("constant", "x = 'text'", set()),
        ("negate", "if a:\n    b", {"if not a:\n    b"}),
        ("negate", "while not a:\n    b", {"while a:\n    b"}),
        ("negate", "x = a if b < c else d", {"x = a if not b < c else d"}),
        ("negate", "x = [a for a in b if a]", {"x = [a for a in b if not a]"}),
        ("negate", "x = a if b == c else d", set()),  # `compare` does the same
        ("and/or", "x = a and b", {"x = a or b"}),
        ("name", "x = np.minimum(a, b)", {"x = np.maximum(a, b)"}),
        ("name", "x = a.any()", {"x = a.all()"}),
        ("name", "x = minimum", set()),
        ("unary", "x = ~a", {"x = a"}),
        ("slice", "x = a[b:c]", {"x = a[:c]", "x = a[b:]"}),
        ("slice", "x = a[:]", set()),
        ("slice", "x = a[0::2]", set()),
        ("drop", "def f():\n    g()", {"def f():\n    pass"}),
        ("drop", "def f():\n    raise E", {"def f():\n    pass"}),
        ("drop", "def f():\n    a[b] = c", {"def f():\n    pass"}),
        ("drop", "def f():\n    a += b", {"def f():\n    pass"}),
        ("drop", "def f():\n    a = b", set()),
        ("drop", "for a in b:\n    continue", {"for a in b:\n    pass"}),
        ("negative", "def f() -> Ints:\n    return a", {"def f() -> Ints:\n    return -a"}),
        ("negative", "def f() -> str:\n    return a", set()),
    ],
)
def test_operators(operator, source, wanted):
    assert changed(source, operator) == wanted


@pytest.mark.parametrize(
    "source",
    [
        "def f(a: int = 3) -> Literal[1]:\n    '''Text of 1.'''\n    assert a > 1",
        "def f():\n    if kernel.available():\n        return a + 1\n    return b",
        "class A:\n    x: int = 1\n\n    def __repr__(self):\n        return a + 1",
        "if TYPE_CHECKING:\n    x = 1",
        "def f():\n    cache.put(a + 1)",
        "import a",
        "x = f'{a + 1}'",
    ],
)
def test_what_is_left_alone(source):
    assert changed(source) == set()


def test_messages_are_left_alone_but_their_raise_is_not():
    source = "def f():\n    raise E(f'{a + 1}', 7, a < b)"
    assert changed(source) == {"def f():\n    pass"}


def test_places_are_named():
    source = "class A:\n    def f(self):\n        if (a\n                > 1):\n            b()\n"
    found = mutants("a.py", source)
    assert {m.function for m in found} == {"A.f"}
    assert {m.lines for m in found} == {(3, 4), (5, 5)}
    assert found[-1].key == "a.py A.f: b() -> pass"
    twice = mutants("a.py", "def f():\n    g()\n    g()\n")
    assert [m.key for m in twice] == ["a.py f: g() -> pass", "a.py f: g() -> pass #2"]


def test_long_statements_are_shortened_around_the_change():
    source = f"x = ({'first, ' * 40}a + b, {'last, ' * 40})"
    (found,) = mutants("a.py", source)
    assert "a + b, last" in found.before
    assert "a - b, last" in found.after
    assert len(found.before) < 130


def many(functions, each):
    names = [(f"{f}.py", f"{f}{n}") for f in "ab" for n in range(functions)]
    return [
        Mutant(*name, (k, k), "drop", f"x{k}", "pass", k) for name in names for k in range(each)
    ]


def test_all_functions_have_their_share():
    chosen = choose(many(5, 7), 20, 0)
    per = [sum(m.function == f"{f}{n}" for m in chosen) for f in "ab" for n in range(5)]
    assert per == [2] * 10
    assert chosen == choose(many(5, 7), 20, 0)
    assert chosen != choose(many(5, 7), 20, 1)
    assert len(choose(many(1, 3), 20, 0)) == 6


def test_the_choice_in_a_function_does_not_depend_on_others():
    few, more = choose(many(1, 7), 4, 0), choose(many(5, 7), 20, 0)
    assert {*few} <= {*more}


def test_the_decoder_as_it_is_passes(suite):
    assert run(suite.cases, None, suite.record.caps) is None


def test_mutants_of_the_decoder_are_caught(suite, everything):
    chosen = choose([m for m in everything if m.function and suite.runs(m)], 8, SEED)
    assert len(chosen) == 8
    missed = [str(m) for m in chosen if suite.catches(m) is None]
    # Not all mutants are faults, and the whole suite is not run here.
    assert len(missed) <= 1, missed


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("while True: pass", "hang"),
        ("import os; os.kill(os.getpid(), 9)", "crash: status -9"),
        ("1 / 0", "import: ZeroDivisionError('division by zero')"),
        ("from .bits import *", "import: ModuleNotFoundError"),
    ],
)
def test_bad_endings_are_caught(suite, text, problem, monkeypatch):
    source = ROOT.joinpath("container/head.py").read_text()
    fields = source.replace("FIELDS = ", "def __getattr__(name):\n    pass\n\nFIELDS = ")
    code = compile(f"{fields}\n{text}\n", "head.py", "exec")
    if problem == "hang":
        # A limit of processor time holds while cases run, not while modules are imported.
        rest = ROOT.joinpath("render/view.py").read_text()
        code = compile(f"{rest}\n\ndef make_view(*_):\n    {text}\n", "view.py", "exec")
    fault = Fault("render/view.py" if problem == "hang" else "container/head.py", code)
    caps = dict.fromkeys(FEW, 0.2)
    caught = run(suite.cases, fault, caps)
    assert caught is not None
    assert caught.problem.startswith(problem)


def test_a_process_tells_how_it_ends():
    assert forked(lambda out: print("a\nb", file=out)) == (["a", "b"], 0)
    said, status = forked(lambda out: print(1 // 0, file=out))
    assert (said, status) == ([], 1)


def test_what_cases_run_is_recorded(suite):
    source = ROOT.joinpath("geometry/mesh.py").read_text().splitlines()
    flat = next(n for n, line in enumerate(source, 1) if "def refine(" in line)
    inside = next(n for n, line in enumerate(source, 1) if n > flat and "nodes = base" in line)
    meshed = suite.record.of("geometry/mesh.py", inside, inside)
    assert "closing-1" in meshed
    assert "layers" not in meshed
    assert suite.record.of("geometry/mesh.py", flat, flat) == {*FEW}  # runs at import
    assert suite.record.of("geometry/mesh.py", 100000, 100001) == set()


def test_a_decoder_that_fails_cannot_be_mutated(monkeypatch):
    (layers,) = load(pattern="layers")
    wrong = [type(layers)(**{**vars(layers), "renders": (), "error": "limit"})]
    with pytest.raises(RuntimeError, match="layers: the decoder itself fails: exit: code 0"):
        record.recorded(wrong)


class Catcher:
    """A suite that catches what it is told."""

    def __init__(self, *caught):
        self._caught = caught

    def catches(self, mutant):
        return Caught("case", "pixels") if mutant.number in self._caught else None


def test_verdicts_and_figures(tmp_path, monkeypatch, capsys):
    chosen = many(1, 4)[:4]
    monkeypatch.setattr(verdicts, "EQUIVALENT", tmp_path / "known.json")
    verdicts.EQUIVALENT.write_text(json.dumps({chosen[1].key: "the same"}))
    found = verdicts.judged(chosen, Catcher(0), lambda: Catcher(1, 2), print)
    assert [v.kind for v in found] == ["caught", "equivalent", "changes", "unknown"]
    assert [v.why for v in found][:3] == ["case: pixels", "the same", "case: pixels"]
    text, share = verdicts.summary(found, 5, 9)
    assert share == pytest.approx(1 / 3)
    assert "4 mutants: 1 caught, 1 survive though" in text
    assert "not reached: 5 of 9" in text
    assert capsys.readouterr().out.count("a.py:") == 4


@pytest.mark.parametrize(("wanted", "code"), [(0.5, 0), (1.01, 1)])
def test_the_command(wanted, code, suite, monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(command, "Suite", lambda cases: suite)
    monkeypatch.setattr(command, "WANTED", wanted)
    monkeypatch.setattr(inputs, "cases", list)
    report = tmp_path / "report.json"
    words = ["--count", "2", "--only", "render/view.py", "--json", str(report)]
    assert command.main(words) == code
    assert "2 mutants: " in capsys.readouterr().out
    assert len(json.loads(report.read_text())["mutants"]) == 2


def test_known_mutants_exist(everything):
    known = json.loads(verdicts.EQUIVALENT.read_text())
    assert all(known.values())
    assert known.keys() <= {m.key for m in everything}

"""The cases are what the generator makes."""

import re
from collections import Counter
from pathlib import Path

from conformance import make_cases
from conformance.cases import FOLDER
from conformance.make import __main__ as command
from conformance.make import generator
from conformance.make.kinds import KIND_OF, REFUSED, VALID
from conformance.make.refused import poses
from proxyimg_codec import from_bytes
from tests.conformance.decoders import BY_NAME, CASES


def test_the_generator_reproduces_the_cases():
    assert generator.differences() == []


def test_differences_are_noticed(tmp_path, capsys, monkeypatch):
    made = {n: generator.build()[n] for n in ("pixel", "invalid-empty", "limit-grid")}
    monkeypatch.setattr(generator, "build", lambda: made)
    generator.write(tmp_path)
    assert generator.differences(tmp_path) == []
    pixel, limit = tmp_path / "canvases" / "pixel", tmp_path / "refused-structure" / "limit-grid"
    (pixel / "input.pxi").write_bytes(b"other")
    (limit / "case.json").write_text("{}")
    (tmp_path / "refused-framing" / "invalid-empty").rename(tmp_path / "canvases" / "invalid-empty")
    wrong = [
        "canvases/invalid-empty", "refused-framing/invalid-empty", "canvases/pixel",
        "refused-structure/limit-grid",
    ]  # fmt: skip
    assert generator.differences(tmp_path) == wrong
    monkeypatch.setattr(generator.differences, "__defaults__", (tmp_path,))
    assert command.main(["--check"]) == 1
    said = [f"{place}: differs from what the generator makes" for place in wrong]
    assert capsys.readouterr().err.splitlines() == said
    generator.write(tmp_path)
    assert generator.differences(tmp_path) == []
    assert not (tmp_path / "canvases" / "invalid-empty").exists()


def test_no_case_replaces_another():
    found = [name for cases in (*VALID.values(), *REFUSED.values()) for name in cases]
    assert sorted(found) == [*BY_NAME]


def test_each_module_is_a_kind():
    for package, kinds in (("valid", VALID), ("refused", REFUSED)):
        modules = {f.stem for f in (Path(generator.__file__).parent / package).glob("[!_]*.py")}
        assert {kind.removeprefix("refused-") for kind in kinds} == modules - {"base"}


def test_the_description_counts_the_cases_of_each_kind():
    counts = Counter(KIND_OF.values())
    assert counts == Counter(case.kind for case in CASES)
    text = (FOLDER.parent / "README.md").read_text("utf-8")
    rows = re.findall(r"^\| `([a-z-]+)` \| (\d+) \|", text, re.M)
    assert {kind: int(count) for kind, count in rows} == counts


def test_the_name_in_descriptions_makes_cases_too():
    assert make_cases.__name__ == generator.PROVENANCE
    assert make_cases.main is command.main


def test_bases_of_refused_files_are_good():
    for base in {case.base for cases in REFUSED.values() for case in cases.values()}:
        assert from_bytes(base().data).render().any()
    base = poses.Posed()
    alone = base.tiny(poses.ALONE, poses.TRIANGLE)
    assert len(from_bytes(alone).layers["disc"].mesh.refined.faces) == 1

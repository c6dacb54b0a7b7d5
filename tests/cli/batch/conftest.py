"""A folder of texts, and a tool for them."""

import json
import os
from pathlib import Path

import pytest

from tests.support import batches
from tests.support.tools import one_line


@pytest.fixture
def here(tmp_path, monkeypatch):
    """An empty folder, where the test runs."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def texts(here):
    """texts(a="text", ...) writes in/a.txt and so on; 2 become in/sub/a.txt if named sub_a."""

    def write(**contents):
        for name, text in contents.items():
            path = Path("in", name.replace("_", "/") + ".txt")
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text)

    return write


@pytest.fixture
def copy(here, capsys):
    """copy("in", "-o", "out/", ..., code=0, lines=1): stderr, and the lines of the report."""

    def call(*words, code=0, lines=1, jobs=1):
        capsys.readouterr()
        report = ["--report", "report.jsonl", "-j", str(jobs)]
        given = [str(v) for v in words]
        again = "--resume" in given or "--force" in given
        if not again and os.path.exists("report.jsonl"):
            os.remove("report.jsonl")
        got = batches.main([*given, *report, *(["--quiet"] if code else [])])
        err = capsys.readouterr().err
        assert got == code, err
        if code:
            one_line("pxi-test", err, lines)
        told = Path("report.jsonl").read_text() if os.path.exists("report.jsonl") else ""
        return err, [json.loads(line) for line in told.splitlines()]

    return call


@pytest.fixture
def traced(here):
    """traced("end") counts the names that were ended, or begun."""

    def count(what):
        lines = Path("trace").read_text().splitlines() if os.path.exists("trace") else []
        return sorted(line.split()[1] for line in lines if line.startswith(what))

    return count

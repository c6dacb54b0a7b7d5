"""The package's decoder passes the suite."""

import json
import sys

import pytest

from conformance import runner, symbols
from tests.conformance.decoders import BY_NAME, CASES, in_process, own_latents, problems


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_package_decodes(case):
    assert problems(runner.run([case], in_process, digester=own_latents)) == []


def test_the_package_passes_as_a_command(tmp_path, capsys, at_root):
    report = tmp_path / "report.json"
    runs = (("alpha", "png"), ("invalid-crc-t*", "npy"), ("pixel", "npy"), ("pyramid-r*", "npy"))
    for pattern, kind in runs:
        options = ["--only", pattern, "--format", kind, "-j", "2", "--json", str(report)]
        assert runner.main(options) == 0
        assert "cases passed" in capsys.readouterr().out
    report = json.loads(report.read_text())
    assert (report["cases"], report["failed"], len(report["results"])) == (2, [], 3)
    assert report["results"][0]["passed"]
    assert report["results"][0]["peak"] < 0.05


def test_digests_of_refused_files(capsys, monkeypatch):
    for name, code in (("invalid-escapes-none", 4), ("unsupported-model", 5), ("pyramid", 0)):
        monkeypatch.setattr(sys, "argv", ["symbols", str(BY_NAME[name].input)])
        assert symbols.main() == code
    assert capsys.readouterr().out == f"{BY_NAME['pyramid'].latents}\n"

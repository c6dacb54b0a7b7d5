"""The runner runs commands, lists cases, and refuses senseless options."""

import json
import os
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from conformance import judge, runner
from conformance.cases import LEVELS, PROFILES
from conformance.processes import command_decoder, expand
from tests.conformance.decoders import BY_NAME, CASES, command
from tests.support.paths import ROOT


def test_wrong_latents_are_caught_as_a_command(capsys, at_root):
    good = command("-m", "proxyimg_codec.cli.decode")
    digest = f"{shlex.quote(sys.executable)} -c"
    for code, problem in (
        ("print('0' * 64)", f"latents: the hash is {'0' * 64} instead of"),
        ("pass", "latents: the hash is missing instead of"),
        ("import sys; sys.exit(3)", "exit: code 3 instead of 0"),
    ):
        wrong = f"{digest} {shlex.quote(code)} {{in}}"
        options = ["--decoder", good, "--latents", wrong, "--only", "pyramid-sample"]
        assert runner.main(options) == 1
        assert problem in capsys.readouterr().out


def test_a_hanging_decoder_is_stopped(capsys, at_root):
    wrong = command("-m", "conformance.faults", "--fault", "hangs")
    options = ["--decoder", wrong, "--only", "p*l", "--timeout", "0.3", "-j", "2"]
    assert runner.main(options) == 1
    assert "timeout: killed after 0.3 s" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("program", "problem"),
    [
        ("x = b'1' * (300 << 20)", "exit: code 1 instead of 0 (MemoryError)"),
        ("import os; os.kill(os.getpid(), 11)", "exit: killed by signal 11 instead of code 0"),
        ("pass", "output: no picture was written"),
        ("import sys; open(sys.argv[2], 'wb')", "output: neither a PNG nor an NPY file"),
        ("import sys; sys.exit('no\\ngood')", "exit: code 1 instead of 0 (good)"),
    ],
)
def test_bad_endings_are_named(program, problem):
    template = command("-c", shlex.quote(program))
    decoder = command_decoder(template, 20, 200 << 20)
    assert judge.judge(BY_NAME["pixel"], 0, decoder).problem.startswith(problem)


def listed(capsys, *options):
    """Names of the cases that the runner lists."""
    assert runner.main(["--list", *options]) == 0
    first, *lines = capsys.readouterr().out.splitlines()
    assert first.split() == ["case", "kind", "profile", "level", "title"]
    return [line.split()[0] for line in lines]


def test_cases_are_listed_by_profile_and_level(capsys):
    assert listed(capsys) == [case.name for case in CASES]
    for profile in PROFILES:
        for level in LEVELS:
            names = listed(capsys, "--profile", profile, "--level", str(level))
            for name in ("moved", "invalid-pose-rest"):
                assert (name in names) == (profile != "still")
            for name in ("moves-loop", "invalid-motion-none"):
                assert (name in names) == (profile == "moving")
            assert ("level-2-still" in names) == (level >= 2)
            assert ("level-3-posed" in names) == (level == 3 and profile != "still")
            assert "invalid-empty" in names
    assert listed(capsys, "--only", "level-*", "--level", "2", "--profile", "posed") == [
        "level-2-posed", "level-2-still",
    ]  # fmt: skip
    runner.main(["--list", "--only", "undo-0-2"])
    assert capsys.readouterr().out.splitlines()[1] == (
        "undo-0-2 metadata still       1  A history of version 0.2: a map, and bound to the prefix "
        "too (valid; CON-4, MET-18)"
    )


def test_only_cases_of_a_profile_and_level_are_run(capsys, tmp_path, at_root):
    report = tmp_path / "report.json"
    with pytest.raises(SystemExit, match="2"):
        runner.main(["--only", "moves-*", "--profile", "posed"])
    assert runner.main(["--only", "level-*-still", "--level", "2", "--json", str(report)]) == 0
    assert [r["case"] for r in json.loads(report.read_text())["results"]] == ["level-2-still"] * 2


def test_commands_are_expanded():
    words = expand("a 'b c' --in={in} {out} {args}", Path("x y"), Path("o"), ["--width", "3"])
    assert words == ["a", "b c", "--in=x y", "o", "--width", "3"]


@pytest.mark.parametrize(
    "options",
    [
        ["--decoder", "a {in} {out}"],
        ["--decoder", "a '{in} {out} {args}"],
        ["--decoder", "no-such-program {in} {out} {args}"],
        ["--only", "nothing"],
        ["--profile", "all"],
        ["--level", "4"],
        ["-j", "0"],
        ["--timeout", "0"],
    ],
)
def test_the_runner_refuses_senseless_options(options, capsys):
    with pytest.raises(SystemExit, match="2"):
        runner.main(options)


@pytest.mark.parametrize(
    "program",
    [
        ["conformance.runner", "--list"],
        ["conformance.runner", "--only", "pixel"],
        ["spec.dump", str(ROOT / "spec" / "example.pxi")],
    ],
    ids=" ".join,
)
def test_output_that_nobody_reads_is_dropped(program, at_root):
    """As ``| head -0`` does: the reader is gone before the first line."""
    read, write = os.pipe()
    os.close(read)
    command_line = [sys.executable, "-m", *program]
    ran = subprocess.run(command_line, stdout=write, stderr=subprocess.PIPE, text=True)
    os.close(write)
    assert ran.stderr == ""
    assert ran.returncode == 3

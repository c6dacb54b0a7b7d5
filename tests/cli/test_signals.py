"""What asks a tool to end does so, and nothing unfinished stays."""

import importlib
import os
import signal
import subprocess
import sys
import threading

import pytest

from proxyimg_codec.cli import bench, signals
from proxyimg_codec.cli.common import run
from tests.support.paths import ROOT
from tests.support.pictures import smooth

# Sends a signal to itself when the output is being written, and again while it tidies up.
SCRIPT = """
import os, shutil, signal, sys
from proxyimg_codec.cli import {tool}

signal.signal(signal.{name}, signal.SIG_DFL)

def ended(*args):
    os.kill(os.getpid(), signal.{name})

def removed(path, real=shutil.rmtree, **options):
    ended()
    real(path, **options)

shutil.rmtree = removed
{patch}
sys.exit({tool}.main(sys.argv[1:]))
"""
FSYNC = "os.fsync = ended"
FRAME = "from proxyimg_codec.export import clip; clip._ready = lambda *a: map(ended, [0])"
ADD = "from proxyimg_codec.export import clip_pictures as c; c.{0}.add = ended"


def ran(tool, patch, *args, name="SIGTERM"):
    """Runs a tool that gets a signal; its exit code and stderr, once no process of it has that."""
    script = SCRIPT.format(tool=tool, name=name, patch=patch)
    process = subprocess.Popen(
        [sys.executable, "-c", script, *map(str, args)],
        stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, cwd=ROOT,
    )  # fmt: skip
    text = process.communicate(timeout=60)[1].decode()
    return process.returncode, text


@pytest.mark.parametrize("old", [None, b"precious"])
@pytest.mark.parametrize(
    ("tool", "patch", "args", "output"),
    [
        ("decode", FSYNC, [], "a.png"),
        ("edit", FSYNC, ["--hide", "disc"], "a.pxi"),
        ("animate", FSYNC, ["--preset", "sway"], "a.pxi"),
        ("animate", FRAME, ["--preset", "sway"], "a.gif"),
        ("animate", ADD.format("Sheet"), ["--preset", "sway", "--sheet"], "a.png"),
        ("animate", ADD.format("Numbered"), ["--preset", "sway"], "a-%04d.png"),
    ],
)
def test_a_signal_leaves_all_as_it_was(small_pxi, tmp_path, tool, patch, args, output, old):
    if tool == "animate" and output.endswith(("gif",)):
        pytest.importorskip("av")
    name = output.replace("%04d", "0000")
    if old:
        (tmp_path / name).write_bytes(old)
    code, text = ran(tool, patch, small_pxi, tmp_path / output, *args, "-f")
    assert (code, text) == (143, f"pxi-{tool}: terminated\n")
    assert {p.name: p.read_bytes() for p in tmp_path.iterdir()} == ({name: old} if old else {})


@pytest.mark.parametrize(("name", "code"), [("SIGTERM", 143), ("SIGHUP", 129)])
def test_each_signal_has_its_exit_code(small_pxi, tmp_path, name, code):
    got, text = ran("decode", FSYNC, small_pxi, tmp_path / "a.png", name=name)
    assert got == code
    assert text.startswith("pxi-decode: ")
    assert os.listdir(tmp_path) == []


@pytest.mark.encoder
def test_encoding_ends(tmp_path):
    from proxyimg_codec.io.png import encode_ppm

    (tmp_path / "a.ppm").write_bytes(encode_ppm(smooth(21, 13)))
    code, text = ran("encode", FSYNC, tmp_path / "a.ppm", "-e", "1", "--layers", "1")
    assert (code, text.splitlines()[-1]) == (143, "pxi-encode: terminated")
    assert os.listdir(tmp_path) == ["a.ppm"]


@pytest.mark.encoder
def test_the_workers_of_a_benchmark_end_too(tmp_path):
    from proxyimg_codec.io.png import encode_ppm

    for name in ("imagecodecs", "matplotlib", "PIL"):
        pytest.importorskip(name)
    (tmp_path / "in").mkdir()
    (tmp_path / "in" / "a.ppm").write_bytes(encode_ppm(smooth(21, 13)))
    patch = "from proxyimg_codec.bench import report; report.Log.add = ended"
    args = ("rd", tmp_path / "in", "--out", tmp_path / "out", "--codecs", "jpeg", "-j", "2")
    code, text = ran("bench", patch, *args)
    assert (code, text.splitlines()[-1]) == (143, "pxi-bench: terminated")
    assert os.listdir(tmp_path / "out") == ["rd.csv"]


def test_what_others_ignore_or_handle_stays():
    """As `nohup` ignores SIGHUP; and nothing stays when the tool is done."""

    def mine(number, frame):
        raise AssertionError

    before = {number: signal.signal(number, mine) for number in signals.ENDING}
    try:
        assert (
            run("pxi-test", lambda: [signal.getsignal(n) for n in signals.ENDING].index(mine)) == 0
        )
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
        with signals.ending():
            assert signal.getsignal(signal.SIGTERM) not in (signal.SIG_DFL, mine)
            assert all(signal.getsignal(n) == mine for n in signals.ENDING[1:])
        assert signal.getsignal(signal.SIGTERM) == signal.SIG_DFL
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def test_a_tool_runs_in_any_thread():
    codes = []
    thread = threading.Thread(target=lambda: codes.append(run("pxi-test", lambda: None)))
    thread.start()
    thread.join()
    assert codes == [0]


TOOLS = [
    "animate", "bench", "decode", "edit", "encode", "info", "layers", "models", "validate",
]  # fmt: skip


def parsers(parser):
    """A parser and those of its subcommands."""
    yield parser
    for action in parser._subparsers._group_actions if parser._subparsers else ():
        for part in action.choices.values():
            yield from parsers(part)


@pytest.mark.parametrize("tool", TOOLS)
def test_help_prints_under_any_encoding(tool):
    parser = importlib.import_module(f"proxyimg_codec.cli.{tool}").arguments()
    texts = [p.format_help() for p in parsers(parser)]
    assert all(text.isascii() for text in texts)
    assert all("143 terminated" in text for text in texts[-1:])


def test_all_subcommands_are_looked_at():
    assert len(list(parsers(bench.arguments()))) == 3


@pytest.mark.parametrize(
    "setting", [{"PYTHONIOENCODING": "ascii"}, {"LC_ALL": "C", "PYTHONUTF8": "0"}]
)
@pytest.mark.parametrize("tool", [["bench"], ["bench", "rd"], ["bench", "paper"], ["encode"]])
def test_help_where_only_ascii_prints(tool, setting):
    environment = {**os.environ, "PYTHONCOERCECLOCALE": "0", **setting}
    command = [sys.executable, ROOT / "bin" / f"pxi-{tool[0]}", *tool[1:], "--help"]
    done = subprocess.run(command, env=environment, capture_output=True, timeout=60)
    assert (done.returncode, done.stderr) == (0, b"")
    assert b"usage: pxi-" in done.stdout

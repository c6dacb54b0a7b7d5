"""What the tools of the command line must do."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Ran:
    """What a tool left behind: exit code, bytes on stdout and text on stderr."""

    code: int
    out: bytes
    err: str


def one_line(prog: str, text: str, count: int = 1) -> None:
    """Asserts that stderr holds one line `prog: message`, after the usage if argparse refused.

    If several inputs fail, it holds `count` such lines.
    """
    lines = text.splitlines()
    if lines and lines[0].startswith("usage: "):
        lines = lines[-1:]
    assert len(lines) == count, text
    for line in lines:
        assert line.startswith(f"{prog}: ")
        assert len(line) > len(prog) + 10
    assert "Traceback" not in text

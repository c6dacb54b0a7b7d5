"""What the tools of the command line must do."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Ran:
    """What a tool left behind: exit code, bytes on stdout and text on stderr."""

    code: int
    out: bytes
    err: str


def one_line(prog: str, text: str) -> None:
    """Asserts that stderr holds one line `prog: message`, after the usage if argparse refused."""
    lines = text.splitlines()
    if lines and lines[0].startswith("usage: "):
        lines = lines[-1:]
    assert len(lines) == 1, text
    assert lines[0].startswith(f"{prog}: ")
    assert len(lines[0]) > len(prog) + 10
    assert "Traceback" not in text

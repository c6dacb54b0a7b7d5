"""A tool for tests of batches, whose work is quick and leaves a trace; workers import it."""

import argparse
import os
import signal
import time
from pathlib import Path

from proxyimg_codec.cli.batch.each import each
from proxyimg_codec.cli.batch.tool import Tool, add_batch
from proxyimg_codec.cli.common import parser
from proxyimg_codec.cli.places import add_files, check_target, parse
from proxyimg_codec.errors import InputError
from proxyimg_codec.io.files import read_bytes, write_atomically


def work(args: argparse.Namespace) -> dict:
    """Copies a text in capitals, unless the text says what else is to happen."""
    text = read_bytes(args.input).decode()
    check_target(args.output, args.force, *args.inputs)
    name = os.path.basename(args.input)
    begun = trace(args.trace, f"begin {name}")
    if "fails" in text:
        raise InputError("it fails")
    if "bug" in text:
        raise ZeroDivisionError("a bug")
    if "kills once" in text and begun.count(f"begin {name}") == 1:
        os.kill(os.getpid(), signal.SIGKILL)
    if "always kills" in text:
        os.kill(os.getpid(), signal.SIGKILL)
    if "waits" in text:
        stage = Path(args.output).with_name(".pxi-stage")
        try:
            stage.write_text("unfinished")
            while not os.path.exists(args.trace + ".go"):
                time.sleep(0.02)
        except KeyboardInterrupt:  # as the refinement of a pyramid does
            text = "what is found so far"
        finally:
            stage.unlink(missing_ok=True)
    write_atomically(args.output, (args.ending + text.upper()).encode())
    trace(args.trace, f"end {name}")
    return {"output": args.output, "length": len(text)}


def trace(path: str, line: str) -> list[str]:
    """Adds a line to a file that several processes write, and returns all."""
    with open(path, "ab", buffering=0) as file:
        file.write(f"{line}\n".encode())
    return Path(path).read_text().splitlines()


def takes(name: str) -> bool:
    """Whether a file is an input."""
    return name.endswith(".txt")


def check(args: argparse.Namespace) -> None:
    """Refuses nothing."""


def tell(report: dict, args: argparse.Namespace, say) -> None:
    """Says the length."""
    if not args.quiet:
        say(f"{report['output']}: {report['length']}")


def main(words: list[str]) -> int:
    """Runs the tool, as its command line says."""
    p = parser("pxi-test", "Copies texts.")
    add_files(p, "text", "text")
    add_batch(p)
    p.add_argument("-j", "--jobs", type=int)
    p.add_argument("-f", "--force", action="store_true")
    p.add_argument("--quiet", action="store_true")
    p.add_argument("--trace", default="trace")
    p.add_argument("--ending", default="")
    return each(Tool("pxi-test", ".out", takes, check, work, tell, hush=True), parse(p, words))


if __name__ == "__main__":
    import sys

    sys.exit(main(sys.argv[1:]))

"""pxi-models: lists models of other projects, checks and downloads them."""

from __future__ import annotations

import argparse
import json
import os
import shlex
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .common import Bar, parser, printable, run

if TYPE_CHECKING:
    from ..encoder.shapes.external_models.catalogue import Entry

USES = {
    "sam": "pxi-encode --segmenter {}",
    "saliency": "pxi-encode --segmenter {}",
    "depth": "pxi-encode --depth {}",
    "inpainting": "pxi-encode --background {}",
}
"""How a model for a purpose is used."""


def arguments() -> argparse.ArgumentParser:
    """Parser of the command line."""
    p = parser(
        "pxi-models",
        "List models of other projects that find layers, depth or what lies behind, check and\n"
        "download them. Nothing is downloaded but by `pxi-models get NAME`.",
    )
    p.add_argument("--json", action="store_true", help="print JSON")
    actions = p.add_subparsers(dest="action", metavar="ACTION", title="actions")
    listed = actions.add_parser("list", help="list the models that are known; the default")
    check = actions.add_parser("check", help="run a model on a small picture, and say what it is")
    check.add_argument("model", metavar="FILE", help="ONNX file, or the name of a known model; of "
                       "a SAM both files, or one with the other beside it", nargs="+")  # fmt: skip
    get = actions.add_parser("get", help="download a known model from where its project has it")
    get.add_argument("name", metavar="NAME", help="name of the model")
    get.add_argument("--to", metavar="FOLDER", help="folder to put it in; default is the cache")
    get.add_argument("-f", "--force", action="store_true", help="replace files that are there")
    get.add_argument("--quiet", action="store_true", help="print nothing but errors")
    for action in (listed, check, get):
        action.epilog, action.formatter_class = p.epilog, p.formatter_class
        action.add_argument("--json", action="store_true", default=argparse.SUPPRESS,
                            help="print JSON")  # fmt: skip
    return p


def main(argv: list[str] | None = None) -> int:
    """Entry point; returns the exit code."""
    args = arguments().parse_args(argv)
    work = {"check": check_model, "get": get_model}.get(args.action, list_models)
    return run("pxi-models", lambda: work(args))


def list_models(args: argparse.Namespace) -> None:
    """Prints the models that are known, and where they are."""
    from ..encoder.shapes.external_models.catalogue import ENTRIES, FOLDERS, folders

    facts = [_facts(known) for known in ENTRIES]
    if args.json:
        places = [str(folder) for folder in folders()]
        print(json.dumps({"folders": places, "models": facts}, indent=2))
        return
    print(f"{'name':24} {'for':10} {'size':>8}  {'licence':14} here")
    for f in facts:
        sizes = [file["bytes"] for file in f["files"]]
        size = "unknown" if None in sizes else f"{sum(sizes) / 1e6:.0f} MB"
        print(f"{f['name']:24} {f['for']:10} {size:>8}  {f['licence']:14} {_state(f)}")
        print(f"    {f['about']}; {f['project']}")
        for file in f["files"]:
            print(f"    {file['address']}")
    print(f"\nsought in {printable(', '.join(str(v) for v in folders()))}; {FOLDERS} adds folders")


def _facts(known: Entry) -> dict[str, Any]:
    """Facts about a known model, ready for JSON."""
    from ..encoder.shapes.external_models.catalogue import found, here
    from ..encoder.shapes.external_models.download import sha256

    files = []
    for file in known.files:
        path = found(file.name)
        files.append({
            "name": file.name, "address": file.address, "bytes": file.size,
            "sha256": file.sha256, "path": None if path is None else str(path),
            "sha256_found": None if path is None else sha256(path),
        })  # fmt: skip
    return {
        "name": known.name, "for": known.purpose, "about": known.about, "licence": known.licence,
        "project": known.project, "here": bool(here(known)), "files": files,
    }  # fmt: skip


def _state(facts: dict[str, Any]) -> str:
    """Words for whether a model is here, and whether its checksums are right."""
    if not facts["here"]:
        return "no"
    known = [f for f in facts["files"] if f["sha256"] is not None]
    if any(f["sha256"] != f["sha256_found"] for f in known):
        return "yes, but its SHA-256 is another"
    all_known = len(known) == len(facts["files"])
    return "yes, its SHA-256 is right" if all_known else "yes; its SHA-256 is not known"


def check_model(args: argparse.Namespace) -> None:
    """Runs a model on a small picture, and prints what it is.

    Raises:
        PxiError: It is no model of a known kind, or does not run.
    """
    from dataclasses import asdict

    from ..encoder.shapes.external_models.download import sha256
    from ..encoder.shapes.external_models.locate import locate
    from ..encoder.shapes.external_models.trial import tried

    paths = [p for name in args.model for p in locate(name)]
    trial = tried(paths)
    use = USES[trial.purpose].format(shlex.quote(os.pathsep.join(str(p) for p in paths)))
    sums = {str(p): sha256(p) for p in paths}
    if args.json:
        print(json.dumps({**asdict(trial), "use": use, "sha256": sums}, indent=2))
        return
    lines = [f"{trial.kind}: it works", *trial.tensors]
    lines.append(f"on a small picture, in {trial.seconds:.2f} s: {trial.result}")
    lines += [f"SHA-256 {value}  {name}" for name, value in sums.items()]
    lines.append(f"use it: {use}")
    print("\n".join(map(printable, lines)))


def get_model(args: argparse.Namespace) -> None:
    """Downloads a known model.

    Raises:
        PxiError: There is no such model, or it cannot be downloaded.
    """
    from ..encoder.shapes.external_models.catalogue import ENTRIES, cache_folder, entry
    from ..encoder.shapes.external_models.download import download, sha256
    from ..errors import UsageError

    known = entry(args.name)
    if known is None:
        names = ", ".join(e.name for e in ENTRIES)
        raise UsageError(f"get {args.name}: there is no such model; there are {names}")
    folder = cache_folder() if args.to is None else Path(args.to)
    report = []
    for file in known.files:
        target = folder / file.name
        kept = target.is_file() and not args.force
        if kept:
            got = sha256(target)
        else:
            _say(args, f"{file.address} ({known.licence})")
            with _Download(file.name, args.quiet or args.json) as progress:
                got = download(file, folder, progress)
        verdict = _verdict(file.sha256, got)
        _say(args, f"{target}: {'was there already; ' * kept}SHA-256 {got}, {verdict}")
        report.append({"path": str(target), "sha256": got, "checked": file.sha256 == got})
    if args.json:
        print(json.dumps({"name": known.name, "licence": known.licence, "files": report}, indent=2))


def _verdict(expected: str | None, got: str) -> str:
    """Words for how a checksum compares with the known one."""
    if expected is None:
        return "none is known to compare it with"
    return "as it should be" if expected == got else f"not {expected} as it should be"


def _say(args: argparse.Namespace, text: str) -> None:
    if not (args.quiet or args.json):
        print(printable(text), file=sys.stderr)


class _Download:
    """Progress bar of a download, which begins when the size is known.

    Args:
        label: What is shown before it.
        quiet: Whether nothing is shown.
    """

    def __init__(self, label: str, quiet: bool) -> None:
        self._label, self._quiet = label, quiet
        self._bar: Bar | None = None
        self._seen = 0

    def __enter__(self) -> _Download:
        return self

    def __call__(self, done: int, total: int | None) -> None:
        if self._bar is None:
            self._bar = Bar(total or 0, self._label, self._quiet)
        self._bar.advance(done - self._seen)
        self._seen = done

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.close()


if __name__ == "__main__":
    sys.exit(main())

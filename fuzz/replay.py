"""Runs the targets on their seeds, their corpus and other files, without fuzzing.

python -m fuzz.replay [FILE ...]
"""

from __future__ import annotations

import sys
from pathlib import Path

from fuzz import container, decode, edit, entropy, run


def main() -> None:
    """Runs all targets; an error that a target finds is raised."""
    more = [Path(p).read_bytes() for p in sys.argv[1:]]
    first = {
        "container": run.seeds(),
        "entropy": entropy.seeds(),
        "decode": run.seeds(),
        "edit": edit.seeds(),
    }
    for target in (container, entropy, decode, edit):
        name = target.__name__.rpartition(".")[2]
        corpus = sorted((run.ROOT / "fuzz" / "corpus" / name).glob("*"))
        files = [*first[name], *(p.read_bytes() for p in corpus), *more]
        for data in files:
            target.one_input(data)
        print(f"{name}: {len(files)} inputs", flush=True)


if __name__ == "__main__":
    main()

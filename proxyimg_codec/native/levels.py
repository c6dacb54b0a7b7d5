"""Choice of the compiled level of the core that this processor runs; needs no numpy.

The library holds the same functions compiled for several levels (`setup.py`); `levels.cpp` in it
tells what a processor lacks for one.
"""

from __future__ import annotations

import ctypes as ct
import os
from pathlib import Path
from typing import NamedTuple

LEVELS = ("native", "avx512", "avx2", "baseline")
"""Names of levels, the best first; ``native`` was compiled for one machine."""

NUMPY = "numpy"


class Choice(NamedTuple):
    """The core in use.

    Attributes:
        library: The library; None if numpy does its work.
        level: One of `LEVELS`, or ``numpy``.
        why: Reason why it is no better one; empty if there is none.
    """

    library: ct.CDLL | None
    level: str
    why: str

    def __str__(self) -> str:
        return f"core: {self.level}" + (f" ({self.why})" if self.why else "")


def chosen() -> Choice:
    """Loads the library, and chooses the best level that the processor runs.

    The environment variable PROXYIMG_CORE names one of `LEVELS` to be used instead, or ``numpy``;
    PROXYIMG_NO_KERNEL means the latter.
    """
    asked = os.environ.get("PROXYIMG_CORE", "")
    if os.environ.get("PROXYIMG_NO_KERNEL"):
        return Choice(None, NUMPY, "PROXYIMG_NO_KERNEL is set")
    if asked == NUMPY:
        return Choice(None, NUMPY, "PROXYIMG_CORE asks for it")
    library = _loaded()
    return Choice(None, NUMPY, library) if isinstance(library, str) else _best(library, asked)


def _loaded() -> ct.CDLL | str:
    """The library, or why there is none."""
    found = [
        p for end in ("so", "dll") if (p := Path(__file__).with_name(f"_kernel.{end}")).exists()
    ]
    if not found:
        return "the compiled core is not installed: build it with a C++20 compiler, or take a wheel"
    try:
        library = ct.CDLL(str(found[0]))
        library.pxi_lacking.restype, library.pxi_lacking.argtypes = ct.c_char_p, [ct.c_char_p]
    except (OSError, AttributeError) as error:
        return f"the compiled core does not load: {error}"
    return library


def _best(library: ct.CDLL, asked: str) -> Choice:
    there = [n for n in LEVELS if hasattr(library, f"pxi_decode_{n}")]
    if asked and asked not in there:
        return Choice(None, NUMPY, f"PROXYIMG_CORE={asked}: there are {', '.join(there)}, {NUMPY}")
    why = []
    for name in [asked] if asked else there:
        missing = library.pxi_lacking(name.encode())
        if missing is None:
            if asked:
                why.append("PROXYIMG_CORE asks for it")
            return Choice(library, name, "; ".join(why))
        why.append(f"the processor lacks {missing.decode()} for {name}")
    return Choice(None, NUMPY, "; ".join(why))

"""Statements of the specification that no case can test, with reasons."""

from __future__ import annotations

from collections.abc import Mapping

_PROGRAMS = "for programs that edit, copy or serve files, not for decoders"
_WRITER = "for writers"
_FORMAT = "for later versions of the specification"

UNTESTED: Mapping[str, str] = {
    "SCO-1": "says what conformance of files is",
    "SCO-2": "says what conformance of readers is: all cases together",
    "SCO-3": "says what conformance of writers is",
    "CON-10": f"{_PROGRAMS}: tests/edit/test_operations.py",
    "PYR-45": _PROGRAMS,
    "REN-13": "a permission",
    "REN-15": "a hint; decoders are asked for 16 bits in any case",
    "REN-16": "says which statements are exact: the cases of these have no other tolerance",
    "MET-3": _WRITER,
    "MET-9": _WRITER,
    "MET-10": _PROGRAMS,
    "MET-17": f"{_PROGRAMS}: tests/cli/test_edit_cli.py",
    "LEV-2": "for decoders of a lower profile, which run the cases of theirs alone",
    "LEV-4": _WRITER,
    "SEC-3": _WRITER,
    "SEC-14": f"{_PROGRAMS}: tests/cli/test_edit_cli.py",
    "SEC-15": "a permission, for files that break several statements; each case breaks one",
    "REG-1": f"{_PROGRAMS}: tests/test_desktop.py",
    "REG-2": f"{_PROGRAMS}: tests/test_desktop.py",
    "REG-4": _PROGRAMS,
    "REG-5": _PROGRAMS,
    "REG-6": "a permission",
    "REG-7": "for readers of fragment identifiers [REG-6]",
    "NUM-1": _WRITER,
    "NUM-3": _FORMAT,
    "NUM-4": f"a permission {_WRITER}; readers refuse these numbers like others [NUM-2]",
    "NUM-5": _FORMAT,
    "VER-2": _FORMAT,
    "VER-3": "holds from version 1.0 on",
}
"""Reasons by id."""

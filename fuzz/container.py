"""Fuzz target of the parser: bytes are a container or raise a `PxiError`.

What is parsed is written and must be read again alike.
"""

from __future__ import annotations

from fuzz import run

with run.imports(__name__):
    from proxyimg_codec.container import file
    from proxyimg_codec.errors import PxiError
    from proxyimg_codec.limits import Limits

LIMITS = Limits(chunks=256, metadata_bytes=1 << 14, references=1 << 10)
"""Limits that are so low that no input takes long."""


def one_input(data: bytes) -> None:
    """Parses a file, and the file that is written from it."""
    try:
        found = file.parse(data, LIMITS)
    except PxiError:
        return
    again = file.serialize(found)
    assert file.serialize(file.parse(again)) == again, "what is written is not read alike"


if __name__ == "__main__":
    run.main("container", one_input, run.seeds(1024), files=True)

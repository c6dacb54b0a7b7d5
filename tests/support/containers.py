"""Files with other values in their chunks."""

from dataclasses import replace

import pytest

from proxyimg_codec.container.file import parse, serialize
from proxyimg_codec.errors import FormatError


def refused(image, part, number, values, message, base=FormatError):
    """Asserts that a file with changed fields is refused."""
    container = parse(image.to_bytes())
    old = getattr(container, part)
    new = {**old, **values} if part == "head" else list(old)
    if part != "head":
        new[number] = {**old[number], **values}
        new = tuple(new)
    with pytest.raises(base, match=message):
        parse(serialize(replace(container, **{part: new})))

"""Small files that many tests read; `python -m tests.support.files` makes those in tests/data anew.

They are kept, and not encoded for each run, so that tests of the decoder need no encoder. Neither
has to be what the encoder makes of it today.
"""

from pathlib import Path

import numpy as np

from tests.support.paths import TESTS
from tests.support.pictures import disc, smooth

DATA = TESTS / "data"

SMALL = DATA / "small.pxi"
"""64x48 pixels with the layers back, bar and disc, of implicit textures."""

MOVING = DATA / "moving.pxi"
"""The same size and layers, of which the last two move."""


def masks() -> dict[str, np.ndarray]:
    """bool [48, 64]: the two masks of `SMALL`, which do not touch."""
    bar = np.zeros((48, 64), bool)
    bar[38:, 4:60] = True
    return {"disc": disc(64, 48), "bar": bar}


def write_small(path: Path) -> None:
    """Encodes it; needs the extra ``encode``."""
    from proxyimg_codec import encode
    from proxyimg_codec.encoder.shapes.masks import Region

    picture = smooth(64, 48)
    picture[masks()["bar"]] //= 2
    regions = [Region(name, masks()[name]) for name in ("bar", "disc")]
    encode(picture, masks=regions, effort=1, jobs=1, texture="implicit").save(path)


def write_moving(path: Path) -> None:
    """Makes it up."""
    from tests.support import moving

    moving.picture().save(path)


if __name__ == "__main__":
    DATA.mkdir(exist_ok=True)
    write_small(SMALL)
    write_moving(MOVING)

"""Refused files: faults of mattes."""

from __future__ import annotations

from collections.abc import Callable

from proxyimg_codec.model import Picture

from ..builders import Numbers
from ..valid.mattes import softened
from ..valid.views import pieces
from .base import Base, Row, refused
from .behind import aged

HEAD, BACK, DISC, BAR, BACK_TEXR, DISC_TEXR, BAR_TEXR, PLAN, OWN, MATTE, TAIL = range(11)
"""Positions of the chunks in the base file."""


class Mattes(Base):
    """Valid file of three layers, of which the one in the middle is soft."""

    def build(self, n: Numbers) -> Picture:
        """Makes the picture of the file."""
        return softened(n, pieces(n, {}), "disc")


def _version(version: tuple[int, int], count: int) -> Callable[[Base], bytes]:
    textures = BACK_TEXR, DISC_TEXR, BAR_TEXR
    return aged(version, count, textures, OWN, behind=0, matte=0)


# fmt: off
_MATTES: list[Row] = [
    ("invalid-matte", "a matte of planes that do not exist", "",
     lambda b: b.set(DISC_TEXR, matte=4)),
    ("invalid-matte-unused", "a matte that no view names", "",
     lambda b: b.set(DISC_TEXR, matte=0)),
    ("invalid-matte-size", "a matte with the size of the raster", "",
     lambda b: b.set(MATTE, size=[40, 30], support=b"")),
    ("invalid-matte-colour", "a matte in colour", "",
     lambda b: b.set(MATTE, components=3, lowest=[30] * 3)),
    ("invalid-matte-channels", "a matte in a file without alpha", "PYR-53",
     lambda b: b.set(HEAD, channels=3)),
    ("invalid-matte-alone", "a matte without planes behind", "",
     lambda b: b.set(DISC_TEXR, behind=0)),
    ("invalid-matte-unmix", "a matte beside what is unmixed", "",
     lambda b: b.set(DISC_TEXR, unmix=1)),
    ("invalid-matte-back", "a matte of the back layer of an opaque file", "CHK-3",
     lambda b: b.set(BACK_TEXR, part=[5, 3, 26, 24], cuts=[], unmix=0, behind=2, matte=3)),
    ("invalid-thirteen-values", "textures as of version 0.11", "CON-19", _version((0, 12), 13)),
    ("invalid-fourteen-values", "textures as of version 0.12 in a file of version 0.11", "CON-19",
     _version((0, 11), 14)),
]
# fmt: on

CASES = refused(_MATTES, Mattes)

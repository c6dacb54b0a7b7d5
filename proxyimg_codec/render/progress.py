"""Progress of a drawing, in output pixels: first planes are decoded, then they are drawn."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

from ..progress import heard
from ..texture.grid import Window
from ..texture.planes import Planes

SHARE = 0.75
"""Share of the whole that decoding takes where anything is decoded."""


class Progress:
    """Teller of progress.

    Args:
        pixels: Output pixels in all.
        tell: Function that is called with how many more pixels the work done so far is worth;
            None to tell nobody. What it raises ends the work.
    """

    def __init__(self, pixels: int, tell: Callable[[int], None] | None) -> None:
        self._pixels, self._tell = pixels, tell
        self._told = self._drawn = 0
        self._share = 0.0

    def _at(self, share: float) -> None:
        """Tells that a share of everything is done."""
        if self._tell:
            more = max(int(share * self._pixels) - self._told, 0)
            self._told += more
            self._tell(more)

    @contextmanager
    def decoding(self, needs: Sequence[tuple[Planes, Window]]) -> Iterator[None]:
        """Context of decoding what is needed.

        Args:
            needs: Planes, and the samples of their rasters that are needed.
        """
        # Positions of a level are a quarter of those of the finer one, and each is counted twice:
        # when its latents are read, and when samples are made of them.
        areas: dict[Planes, int] = {}
        for planes, window in needs:
            areas[planes] = max(areas.get(planes, 0), window.area)
        expected = max(sum(areas.values()) * 2 / 3, 1)
        done = 0

        def listen(amount: int) -> None:
            nonlocal done
            done += amount
            self._at(SHARE * min(done / expected, 1))

        with heard(listen):
            yield
        self._share = SHARE if done else 0.0

    def decode(self, needs: Sequence[tuple[Planes, Window]]) -> None:
        """Decodes the samples of rasters that are needed, as for `decoding`.

        The largest windows come first: what small ones leave of them would be made in pieces, each
        with what lies around it.
        """
        with self.decoding(needs):
            for planes, window in sorted(needs, key=lambda v: v[1].area, reverse=True):
                planes.samples(window)

    @contextmanager
    def drawing(self, pixels: int) -> Iterator[None]:
        """Context of drawing some output pixels, which may have to decode more."""
        with heard(lambda amount: self._at(0)):
            yield
        self._drawn += pixels
        self._at(self._share + (1 - self._share) * self._drawn / self._pixels)

"""Valid cases of implicit textures: masks, bits of codes, coding."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from unittest import mock

import numpy as np

from proxyimg_codec.codec.write import to_bytes
from proxyimg_codec.entropy import arrays, rans
from proxyimg_codec.model import Picture

from ..builders import (
    Numbers,
    ellipse,
    layer,
    network,
    picture,
    texture,
)
from ..registry import WHOLE, Build, Valid, Valids

CASES = Valids()
_case = CASES.case


@_case("Few codes stored, the others filled; steps so large that the fill's rounding shows",
       "texture: mask", "texture: diffusion", "entropy: masks")  # fmt: skip
def _diffusion(n: Numbers) -> Picture:
    sparse = n.integers(0, 5, (9, 13)) == 0
    few, one = np.zeros((14, 18), bool), np.zeros((7, 6), bool)
    few[(4, 4, 5, 6, 9), (4, 5, 4, 5, 9)] = one[4, 1] = True
    planes = [texture(n, grid=s.shape[::-1], bits=2, stored=s, reach=2) for s in (sparse, few, one)]
    return picture(
        (32, 24),
        [
            layer("back", (0, 0, 32, 24), planes[0]),
            layer("few codes", (6, 5, 26, 19), planes[1], ellipse((20, 15), (11, 8))),
            layer("one code", (2, 2, 12, 9), planes[2], ellipse((8, 7), (5, 4))),
        ],
        network(n, octaves=4),
    )


def _bits(bits: int) -> Build:
    """Builder of a layer whose codes and weights have `bits` bits."""

    def build(n: Numbers) -> Picture:
        back = layer("back", (0, 0, 14, 12), texture(n, grid=(7, 5), bits=bits))
        return picture((14, 12), [back], network(n, bits=bits))

    return build


for _b in range(2, 9):
    CASES[f"bits-{_b}"] = Valid(
        f"Codes and weights of {_b} bits", (f"codes: {_b} bits", f"weights: {_b} bits"),
        _bits(_b), [WHOLE],
    )  # fmt: skip


@_case("A large plane of mostly equal codes", "entropy: halving of counts", "entropy: lanes")
def _adaptation(n: Numbers) -> Picture:
    plane = texture(n, grid=(48, 40), bits=2)
    rare = n.integers(0, 15, plane.codes.shape) == 0
    plane = replace(plane, codes=np.where(rare, plane.codes, np.int8(-1)))
    return picture((32, 24), [layer("back", (0, 0, 32, 24), plane)], network(n))


@_case("Streams of 32 lanes: groups with more and with fewer symbols", "entropy: lanes", "entropy")
def _lanes(n: Numbers) -> bytes:
    back = layer("back", (0, 0, 16, 12), texture(n, dim=24, grid=(4, 3)))
    made = picture((16, 12), [back], network(n, dim=24, octaves=0))
    with mock.patch.object(arrays, "Encoder", partial(rans.Encoder, 5)):
        return to_bytes(made)

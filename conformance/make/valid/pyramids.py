"""Valid cases of pyramid textures, with random latents: they are independent of the encoder.

Streams and pictures depend on the weights of the registered model.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import partial
from unittest import mock

import numpy as np
from numpy.typing import NDArray

from proxyimg_codec.codec.write import to_bytes
from proxyimg_codec.container import plan
from proxyimg_codec.container.chunks import Chunk, read, write
from proxyimg_codec.container.fields import pack, unpack
from proxyimg_codec.entropy import rans
from proxyimg_codec.model import Picture
from proxyimg_codec.texture import planes, registered_model
from proxyimg_codec.texture.grid import Grid
from proxyimg_codec.texture.implicit import Box
from proxyimg_codec.texture.latents import Latents
from proxyimg_codec.texture.occlusion import Occlusion
from proxyimg_codec.texture.planes import Planes
from proxyimg_codec.texture.pyramid import PyramidTexture

from ..builders import (
    Numbers,
    layer,
    picture,
)  # fmt: skip
from ..registry import WHOLE, Valids

CASES = Valids()
_case = CASES.case
_Mask = NDArray[np.bool_]


def coded(
    n: Numbers,
    size: tuple[int, int],
    *,
    levels: int = 2,
    step: int = 256,
    components: int = 3,
    cell: int = 3,
    cells: _Mask | None = None,
    reach: int = 3,
    shifts: tuple[int, ...] | None = None,
    grey: int = 0,
    large: Sequence[int] = (),
    model: int = 2,
    tile: int = 0,
) -> Planes:
    """Planes of random latents.

    Args:
        n: Source of random numbers.
        size: Width and height of the raster in samples.
        levels: Number of levels of the pyramid.
        step: Quantization step in 1/64 octave: it is 2**(step / 64) levels of 8 bits.
        components: 1 for grey, 3 for colour.
        cell: Binary logarithm of the side of a cell in samples.
        cells: bool [rows, columns] cells that have latents; all by default.
        reach: Largest magnitude of a latent of level 1; about half of all latents are 0.
        shifts: Shifts of the scale index: luma and chroma of each level.
        grey: Number of the finest levels without chroma.
        large: Latents in the middle of level 1, from the left, channel by channel.
        model: Number of the registered model.
        tile: Binary logarithm of the side of a tile in positions; 0 = no tiles.
    """
    grid = Grid(size, levels, registered_model.registration(model).padded)
    most = max(round(60 * 2 ** (levels - step / 64)), 1)
    lowest = n.integers(-most, most, (3, *grid.at(levels)))
    lowest[1:] //= 4 if components == 3 else most + 1
    lowest[1:] *= components == 3
    found = []
    for level in range(1, levels + 1):
        shape = 9, *grid.at(level)
        values = n.integers(-reach, reach, shape) * n.integers(0, 1, shape)
        if components == 1 or level <= grey:
            values[3:] = 0
        if level == 1:
            for k, value in enumerate(large):
                values[k % 9, shape[1] // 2, k] = value
        found.append(values.astype(np.int32))
    latents = Latents(tuple(found), lowest.astype(np.int32))
    return planes.encoded(latents, size, step, cells, cell, components, model, shifts, tile)


def view(
    source: Planes,
    *,
    alpha: Planes | None = None,
    part: Box | None = None,
    cell: int = 0,
    mask: _Mask | None = None,
    cuts: Occlusion | None = None,
) -> PyramidTexture:
    """View of planes; by default of the whole raster."""
    return PyramidTexture(source, alpha, part or (0, 0, *source.size), cell, mask, cuts)


def one(shown: PyramidTexture, opaque: bool = True) -> Picture:
    """Picture of one layer that shows a view in its place."""
    _, _, w, h = shown.part
    return picture((w, h), [layer("back", (0, 0, w, h), shown)], opaque=opaque)


@_case("A raster of three levels", "pyramid", "render: whole",
       renders=[WHOLE, {"region": [5, 4, 9, 8]}])  # fmt: skip
def _pyramid(n: Numbers) -> Picture:
    return one(view(coded(n, (24, 18), levels=3)))


@_case("A grey raster", "pyramid: components")
def _pyramid_grey(n: Numbers) -> Picture:
    return one(view(coded(n, (20, 16), components=1)))


@_case("Colour and alpha", "pyramid: alpha", "alpha",
       renders=[WHOLE, {"width": 13}, {"width": 37}])  # fmt: skip
def _pyramid_alpha(n: Numbers) -> Picture:
    colour, alpha = coded(n, (20, 16)), coded(n, (20, 16), components=1, levels=3)
    return one(view(colour, alpha=alpha), opaque=False)


@_case("Grey and alpha, with other levels and another step", "pyramid: alpha",
       "pyramid: components")  # fmt: skip
def _pyramid_grey_alpha(n: Numbers) -> Picture:
    colour = coded(n, (11, 14), components=1)
    alpha = coded(n, (11, 14), components=1, levels=1, step=320)
    return one(view(colour, alpha=alpha), opaque=False)


@_case("A size that no power of two divides", "pyramid: size")
def _pyramid_odd(n: Numbers) -> Picture:
    return one(view(coded(n, (13, 7), levels=3)))


@_case("Levels that end on even and on odd samples, down and across", "pyramid: size",
       renders=[WHOLE, {"region": [11, 6, 18, 17]}])  # fmt: skip
def _pyramid_odd_levels(n: Numbers) -> Picture:
    return one(view(coded(n, (29, 23), levels=4)))


@_case("An even number of rows of which a level has an odd one, and columns the other way round",
       "pyramid: size", "pyramid: components")  # fmt: skip
def _pyramid_odd_below(n: Numbers) -> Picture:
    return one(view(coded(n, (19, 26), levels=3, components=1)))


@_case("Large latents at the end of odd rows and columns", "pyramid: size", "pyramid: raw bits")
def _pyramid_odd_large(n: Numbers) -> Picture:
    return one(view(coded(n, (15, 11), levels=2, step=0, reach=200, shifts=(7, 7, 7, 7))))


@_case("Padded planes of model 1", "pyramid: padded")
def _pyramid_padded(n: Numbers) -> Picture:
    return one(view(coded(n, (13, 7), levels=3, model=1)))


@_case("Padded planes of model 1 with cells without latents", "pyramid: padded", "pyramid: support")
def _pyramid_padded_support(n: Numbers) -> Picture:
    cells = n.integers(0, 2, planes.cells_of((21, 15), 2)) > 0
    return one(view(coded(n, (21, 15), levels=3, cell=2, cells=cells, model=1)))


@_case("Grey padded planes with alpha, beside those of another model", "pyramid: padded",
       "pyramid: alpha")  # fmt: skip
def _pyramid_padded_alpha(n: Numbers) -> Picture:
    colour = coded(n, (17, 11), model=1)
    return one(view(colour, alpha=coded(n, (17, 11), components=1)), opaque=False)


@_case("One level", "pyramid: levels")
def _pyramid_one_level(n: Numbers) -> Picture:
    return one(view(coded(n, (9, 6), levels=1)))


@_case("Six levels, of which three have the same networks", "pyramid: levels")
def _pyramid_six_levels(n: Numbers) -> Picture:
    return one(view(coded(n, (33, 20), levels=6, step=320)))


@_case("A raster of one sample", "pyramid: size")
def _pyramid_sample(n: Numbers) -> Picture:
    return one(view(coded(n, (1, 1), levels=1)))


@_case("One row", "pyramid: size", renders=[WHOLE, {"width": 61}])
def _pyramid_row(n: Numbers) -> Picture:
    return one(view(coded(n, (23, 1), levels=2)))


@_case("A raster of so many samples a row that decoders may work on a few rows at a time",
       "pyramid: size", "pyramid: support", renders=[{"region": [504, 0, 40, 18]}])  # fmt: skip
def _pyramid_long(n: Numbers) -> Picture:
    cells = np.zeros(planes.cells_of((1040, 18), 3), bool)
    cells[:, 63:68] = True
    return one(view(coded(n, (1040, 18), levels=4, cells=cells)))


@_case("Cells without latents, smaller and larger than positions of a level", "pyramid: support")
def _pyramid_support(n: Numbers) -> Picture:
    cells = n.integers(0, 2, planes.cells_of((21, 15), 2)) > 0
    return one(view(coded(n, (21, 15), levels=3, cell=2, cells=cells)))


@_case("Only one cell has latents", "pyramid: support")
def _pyramid_one_cell(n: Numbers) -> Picture:
    cells = np.zeros(planes.cells_of((22, 17), 3), bool)
    cells[2, 1] = True
    return one(view(coded(n, (22, 17), cells=cells)))


@_case("Two levels without chroma below one that has some", "pyramid: grey levels")
def _pyramid_grey_levels(n: Numbers) -> Picture:
    return one(view(coded(n, (20, 18), levels=3, grey=2)))


@_case("Shifts of the scales", "pyramid: shifts")
def _pyramid_shifts(n: Numbers) -> Picture:
    return one(view(coded(n, (18, 14), shifts=(-8, 7, 5, -3))))


@_case("Large latents with raw bits, in a stream of several lanes", "pyramid: raw bits",
       "entropy: lanes")  # fmt: skip
def _pyramid_raw_bits(n: Numbers) -> Picture:
    return one(view(coded(n, (28, 22), step=0, reach=200, shifts=(7, 7, 7, 7))))


@_case("A stream of 32 lanes: sets with more and with fewer latents, and raw bits",
       "entropy: lanes", "pyramid: raw bits")  # fmt: skip
def _pyramid_lanes(n: Numbers) -> Picture:
    with mock.patch.object(rans, "Encoder", partial(rans.Encoder, 5)):
        source = coded(n, (22, 18), levels=1, step=0, reach=90, shifts=(7, 7))
    return one(view(source))


@_case("Latents that escape with one to three bytes", "pyramid: escapes")
def _pyramid_escapes(n: Numbers) -> Picture:
    return _escaping(n)


def _escaping(n: Numbers) -> Picture:
    """Picture with latents that escape."""
    large = 40, -60, 200, -7000, 9000, 65535, -65535, 55
    return one(view(coded(n, (18, 14), step=64, large=large)))


@_case("Escapes of four bytes, of which the last ones are 0", "pyramid: escapes")
def _pyramid_escapes_long(n: Numbers) -> bytes:
    chunks = read(to_bytes(_escaping(n)))
    at = [chunk.type for chunk in chunks].index(plan.TYPE)
    fields = unpack(plan.FIELDS, chunks[at].payload, "")
    found = re.findall(rb"[\x80-\xff]*[\x00-\x7f]", fields["escapes"])
    long = b"".join(
        bytes([*(b | 128 for b in escape), *[128] * (3 - len(escape)), 0]) for escape in found
    )
    chunks[at] = Chunk(plan.TYPE, pack(plan.FIELDS, {**fields, "escapes": long}))
    return write(chunks)


@_case("A level with two tiles, above one without", "pyramid: tiles",
       renders=[WHOLE, {"region": [100, 1, 20, 4]}])  # fmt: skip
def _pyramid_tiles(n: Numbers) -> Picture:
    return one(view(coded(n, (133, 7), tile=6, large=(70, -900))))


@_case("Two levels with tiles, one below the other, and tiles of a few positions",
       "pyramid: tiles", "pyramid: grey levels")  # fmt: skip
def _pyramid_tiles_deep(n: Numbers) -> Picture:
    return one(view(coded(n, (7, 261), tile=6, grey=1)))


@_case("Tiles without latents: outside of the support, or in a corner without bands",
       "pyramid: tiles", "pyramid: support")  # fmt: skip
def _pyramid_tiles_support(n: Numbers) -> Picture:
    cells = np.zeros(planes.cells_of((129, 129), 3), bool)
    for at in ((16, 16), (7, 15), (16, 2), (2, 16)):
        cells[at] = True
    return one(view(coded(n, (129, 129), levels=1, cells=cells, tile=6)))


@_case("A grey raster with padded planes and tiles", "pyramid: tiles", "pyramid: components")
def _pyramid_tiles_padded(n: Numbers) -> Picture:
    return one(view(coded(n, (130, 9), components=1, model=1, tile=6)))


@_case("Thumbnails that need all levels, and without a word of what they add",
       "render: thumbnails", renders=[{"width": 16}, {"width": 9}])  # fmt: skip
def _pyramid_thumbnail(n: Numbers) -> Picture:
    source = coded(n, (48, 36), reach=9)
    return one(view(Planes({**source.packed, "details": []})))


@_case("Thumbnails that do without the finest level, or both", "render: thumbnails",
       renders=[{"width": 20}, {"width": 7}, {"region": [7, 5, 42, 36], "width": 13}])  # fmt: skip
def _pyramid_thumbnail_smooth(n: Numbers) -> Picture:
    grid = Grid((61, 47), 2)
    rows, columns = grid.at(2)
    y, x = np.mgrid[:rows, :columns]
    wave = 60 * np.sin(x / 3) + 50 * np.cos(y / 4)
    lowest = np.rint([wave, wave / 3, -wave / 5]).astype(np.int32)
    levels = [(n.integers(0, 6, (9, *grid.at(k))) // 6).astype(np.int32) for k in (1, 2)]
    return one(view(planes.encoded(Latents(tuple(levels), lowest), grid.size, 192)))


@_case("The smallest step", "pyramid: step")
def _pyramid_step_0(n: Numbers) -> Picture:
    return one(view(coded(n, (12, 10), step=0, reach=40)))


@_case("The largest step", "pyramid: step")
def _pyramid_step_640(n: Numbers) -> Picture:
    return one(view(coded(n, (12, 10), step=640, reach=1)))


@_case("A part of a raster", "pyramid: part", renders=[WHOLE, {"width": 40}])
def _pyramid_part(n: Numbers) -> Picture:
    return one(view(coded(n, (24, 18), levels=3), part=(5, 3, 15, 11)))


@_case("A part that is stretched over a box", "pyramid: part", "pyramid: sampling")
def _pyramid_stretched(n: Numbers) -> Picture:
    shown = view(coded(n, (14, 12)), part=(2, 1, 11, 9))
    return picture((24, 18), [layer("back", (-3, 2, 25, 13), shown)])


@_case("Enlarged, and reduced", "pyramid: sampling",
       renders=[{"width": 50}, {"width": 9}, {"region": [4, 3, 7, 7], "width": 30}])  # fmt: skip
def _pyramid_enlarged(n: Numbers) -> Picture:
    return one(view(coded(n, (18, 16))))

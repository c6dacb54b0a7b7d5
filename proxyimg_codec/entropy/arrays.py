"""Adaptive coding of small integer arrays: codes, weights, path deltas and masks.

Values of up to 8 bits in an array [C, H, W] are coded at the positions of a mask [H, W]. Their
upper bits, at most four, are coded with adaptive counts, which are selected by the neighbours coded
before; the lower bits are stored raw. Positions are visited by wavefronts t = x + 2 y. So the left,
upper left, upper and upper right neighbours are known, and a whole wavefront is one array
operation. Counts change only after a wavefront.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ..errors import FormatError
from ..native import kernel
from .rans import FEW, SCALE_BITS, Decoder, Encoder

MODEL_BITS = 4
"""Most bits of a value that the adaptive model codes; lower bits are stored raw."""

LANE_BITS = 1 << 12
"""Bits of the stream per lane: few, so many lanes, because a group costs many array operations."""

COUNT_START, COUNT_STEP, COUNT_LIMIT = 8, 32, 1 << 14
"""Adaptation: initial count of a symbol, its increment, and the sum above which a row is halved."""

Ints = NDArray[np.int64]
Places = NDArray[np.int32]


def _contexts(known: NDArray[np.int16], y: Places, x: Places, alphabet: int) -> NDArray[np.int16]:
    """Contexts [n, C] of positions y, x [n] from `known` [H + 1, W + 2, C]; -1 there is unknown."""
    left, up = known[y + 1, x], known[y, x + 1]
    upper_left, upper_right = known[y, x], known[y, x + 2]
    if alphabet == 2:
        bits = (left, up, upper_left, upper_right)
        return sum((np.maximum(v, 0) << i for i, v in enumerate(bits)), np.zeros_like(left))
    total, weight = np.zeros_like(left), np.zeros_like(left)
    for v, w in ((left, 2), (up, 2), (upper_left, 1), (upper_right, 1)):
        total += w * np.maximum(v, 0)
        weight += w * (v >= 0)
    return np.where(weight > 0, (2 * total + weight) // np.maximum(2 * weight, 1), alphabet)


class _Model:
    """Adaptive counts [channel, context, symbol], and the distributions that follow from them."""

    def __init__(self, channels: int, alphabet: int) -> None:
        contexts = 16 if alphabet == 2 else alphabet + 1
        self._counts = np.full((channels * contexts, alphabet), COUNT_START, np.int64)
        self._contexts = contexts
        self._channel = np.arange(channels) * contexts

    def rows(self, context: NDArray[np.int16]) -> Ints:
        """Flat row numbers [n * C] of contexts [n, C]."""
        return (context.astype(np.int64) + self._channel).ravel()

    def cumulative(self, rows: Ints) -> Ints:
        """Cumulative frequencies [n, A + 1] of the A symbols of rows [n].

        Each symbol has a frequency of at least 1, and all add up to 2**14. The last symbol gets the
        remainder of rounding.
        """
        counts = self._counts[rows]
        n, a = counts.shape
        room = (1 << SCALE_BITS) - a
        out = np.zeros((n, a + 1), np.int64)
        np.cumsum(room * counts // counts.sum(1, keepdims=True) + 1, axis=1, out=out[:, 1:])
        out[:, a] = 1 << SCALE_BITS
        return out

    def update(self, rows: Ints, symbols: Ints) -> None:
        """Counts the symbols [n] of one wavefront in their rows [n]."""
        np.add.at(self._counts, (rows, symbols), COUNT_STEP)
        touched = np.unique(rows)
        over = touched[self._counts[touched].sum(1) > COUNT_LIMIT]
        self._counts[over] = (self._counts[over] + 1) >> 1


def _wavefronts(stored: NDArray[np.bool_]) -> tuple[Places, Places, Ints]:
    """Stored positions y [N], x [N] in coding order, and the start of each of W wavefronts [W + 1].

    y ascends within a wavefront. The last start is N.
    """
    height, width = stored.shape
    t = np.arange(0, width + 2 * height - 2, 1 if width > 1 else 2)
    first = np.maximum((t - width + 2) // 2, 0)  # rows of wavefront t, from the first one on
    count = np.minimum(t // 2, height - 1) + 1 - first
    start = np.cumsum(count) - count
    # 32-bit integers, because there may be many positions.
    y = np.arange(stored.size, dtype=np.int32)
    y -= np.repeat((start - first).astype(np.int32), count)
    x = np.repeat(t.astype(np.int32), count)
    x -= 2 * y
    if not stored.all():
        kept = stored[y, x]
        y, x, count = y[kept], x[kept], np.add.reduceat(kept, start, dtype=np.int64)
    return y, x, np.concatenate([[0], np.cumsum(count[count > 0])])


def encode(values: NDArray[np.integer], bits: int, stored: NDArray[np.bool_]) -> bytes:
    """Encodes an array at the stored positions.

    Args:
        values: [C, H, W] integers in 0..2**bits - 1.
        bits: Bits per value, 1..8.
        stored: bool [H, W], True at the positions that are coded.
    """
    high = min(bits, MODEL_BITS)
    low = bits - high
    channels, height, width = values.shape
    model = _Model(channels, 1 << high)
    known = np.full((height + 1, width + 2, channels), -1, np.int16)
    top = np.moveaxis(values.astype(np.int64) >> low, 0, -1)
    encoder = Encoder(lane_bits=LANE_BITS)
    ys, xs, bounds = _wavefronts(stored)
    for a, b in pairwise(bounds):
        y, x = ys[a:b], xs[a:b]
        rows = model.rows(_contexts(known, y, x, 1 << high))
        symbols = top[y, x].ravel()
        cdf = model.cumulative(rows)
        at = np.arange(len(symbols))
        start = cdf[at, symbols]
        encoder.put(start, cdf[at, symbols + 1] - start)
        model.update(rows, symbols)
        known[y + 1, x + 1] = top[y, x]
    raw = pack_bits(values[:, stored].astype(np.int64) & ((1 << low) - 1), low)
    return encoder.finish() + raw


def decode(
    data: bytes, shape: tuple[int, int, int], bits: int, stored: NDArray[np.bool_]
) -> NDArray[np.uint8]:
    """Decodes an array that `encode` coded.

    Args:
        data: The coded array.
        shape: C, H and W.
        bits: Bits per value, 1..8.
        stored: bool [H, W], True at the positions that are coded.

    Returns:
        uint8 [C, H, W] values; 0 where not stored.

    Raises:
        FormatError: The stream is corrupt, too long or too short.
    """
    high = min(bits, MODEL_BITS)
    low = bits - high
    channels, height, width = shape
    decoder = Decoder(data)
    decoder.check_capacity(int(np.count_nonzero(stored)) * channels, 1 << high)
    known = np.full((height + 1, width + 2, channels), -1, np.int16)
    _decode_symbols(decoder, known, stored, 1 << high)
    decoder.finish()
    out = np.zeros(shape, np.uint8)
    out[:, stored] = (known[1:, 1:-1][stored].T << low).astype(np.uint8)
    out[:, stored] |= unpack_bits(data[decoder.end :], out[:, stored].shape, low)
    return out


def _decode_symbols(
    decoder: Decoder, known: NDArray[np.int16], stored: NDArray[np.bool_], alphabet: int
) -> None:
    """Decodes symbols into `known` [H + 1, W + 2, C] at the stored positions [H, W]."""
    ys, xs, bounds = _wavefronts(stored)
    if kernel.available():
        words, states = decoder.words.astype(np.uint16), decoder.states.astype(np.uint32)
        adaptation = COUNT_START, COUNT_STEP, COUNT_LIMIT
        decoder.used = kernel.decode(
            words, states, SCALE_BITS, known, ys, xs, bounds, alphabet, adaptation
        )
        decoder.states[:] = states
        return
    if len(stored) == 1 and known.shape[2] <= FEW and stored.all():
        known[1, 1:-1] = _decoded_row(decoder, stored.shape[1], known.shape[2], alphabet)
        return
    model = _Model(known.shape[2], alphabet)
    for a, b in pairwise(bounds):
        y, x = ys[a:b], xs[a:b]
        rows = model.rows(_contexts(known, y, x, alphabet))
        symbols = decoder.symbols(model.cumulative(rows))
        model.update(rows, symbols)
        known[y + 1, x + 1] = symbols.reshape(len(y), -1)


def _decoded_row(decoder: Decoder, width: int, channels: int, alphabet: int) -> list[list[int]]:
    """Decodes the symbols [width][channels] of an array of one row, one after the other.

    Here each position is a wavefront of its own, and plain Python is faster than numpy. The only
    known neighbour is the left one, so its symbol is the context.
    """
    contexts = alphabet + 1
    counts = [[COUNT_START] * alphabet for _ in range(channels * contexts)]
    last = [0 if alphabet == 2 else alphabet] * channels
    out = []
    for _ in range(width):
        rows = [counts[c * contexts + last[c]] for c in range(channels)]
        last = decoder.by_counts(rows)
        out.append(last)
        for row, symbol in zip(rows, last, strict=True):
            row[symbol] += COUNT_STEP
            if sum(row) > COUNT_LIMIT:
                row[:] = [(n + 1) >> 1 for n in row]
    return out


def pack_bits(values: Ints, width: int) -> bytes:
    """Packs the low `width` bits of each value, most significant first, zero-padded to bytes."""
    planes = (values.ravel()[:, None] >> np.arange(width - 1, -1, -1)) & 1
    return np.packbits(planes.astype(np.uint8).ravel()).tobytes()


def unpack_bits(data: bytes, shape: tuple[int, ...], width: int) -> NDArray[np.uint8]:
    """Unpacks values of `width` <= 8 bits, as `pack_bits` packed them, to uint8 of shape `shape`.

    Raises:
        FormatError: `data` has the wrong length, or padding bits that are not zero.
    """
    count = int(np.prod(shape)) * width
    if len(data) != (count + 7) // 8:
        raise FormatError(
            f"expected {(count + 7) // 8} bytes of raw bits, found {len(data)}", rule="ENT-16"
        )
    bits = np.unpackbits(np.frombuffer(data, np.uint8))
    if bits[count:].any():
        raise FormatError("padding bits are not zero", rule="ENT-16")
    weights = 1 << np.arange(width - 1, -1, -1)
    return (
        (bits[:count].reshape(int(np.prod(shape)), width) @ weights).astype(np.uint8).reshape(shape)
    )

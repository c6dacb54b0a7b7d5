"""Interleaved rANS (asymmetric numeral systems) with 32-bit states and 16-bit words.

Sources: Duda 2013, "Asymmetric numeral systems"; Giesen 2014, "Interleaved entropy coders". Symbols
are coded in *groups*: symbol j of a group uses state j modulo the number of lanes, so that a group
takes a few array operations. The encoder runs backwards, therefore it records all symbols first.
"""

from __future__ import annotations

import bisect
import functools
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import FormatError
from ..native import kernel

SCALE_BITS = 14
"""Frequencies of a distribution sum to `1 << SCALE_BITS`."""

LOW = 1 << 16
"""Lower bound of a state; the upper one is 2**32 - 1.

Encoding starts, and decoding ends, with every state at LOW.
"""

MAX_LANES_LOG2 = 10

LANE_BITS = 1 << 14
"""Bits of a stream for each lane, by default; a lane costs about 24 bits."""

FEW = 16
"""Lanes or symbols below which a loop over single symbols is faster than numpy."""

TOO_SHORT = "entropy-coded stream ends too early"

_SLOT_MASK = np.uint64((1 << SCALE_BITS) - 1)
_SCALE_SHIFT, _WORD_SHIFT, _LOW = np.uint64(SCALE_BITS), np.uint64(16), np.uint64(LOW)


@functools.lru_cache(maxsize=64)
def _row_starts(count: int, width: int) -> NDArray[np.int64]:
    """Offsets of `count` rows of `width` values in a flat array, int64 [count]."""
    return np.arange(count) * width


class Encoder:
    """Records the start and frequency of symbols in decoding order; `finish` returns the stream."""

    def __init__(self, lanes_log2: int | None = None, lane_bits: int = LANE_BITS) -> None:
        """Creates an empty stream.

        Args:
            lanes_log2: Binary logarithm of the number of lanes. None for a lane for each
                `lane_bits` bits, rounded down to a power of two.
            lane_bits: Bits of the stream for each lane.
        """
        self._lanes_log2, self._lane_bits = lanes_log2, lane_bits
        self._starts: list[NDArray[np.uint16]] = []
        self._freqs: list[NDArray[np.uint16]] = []
        self._ends: list[NDArray[np.int64]] = []
        self._count = 0

    def put(self, start: NDArray[np.integer], freq: NDArray[np.integer]) -> None:
        """Adds one group of symbols.

        Args:
            start: int [N] cumulative frequencies of the symbols, 0..2**SCALE_BITS - 1.
            freq: int [N] frequencies of the symbols, at least 1.
        """
        self.put_groups(
            start.astype(np.uint16), freq.astype(np.uint16), np.array([len(start)], np.int64)
        )

    def put_groups(
        self, start: NDArray[np.uint16], freq: NDArray[np.uint16], ends: NDArray[np.int64]
    ) -> None:
        """Adds several groups of symbols.

        Args:
            start: uint16 [N] cumulative frequencies of the symbols.
            freq: uint16 [N] frequencies of the symbols, at least 1.
            ends: int64 [G] number of symbols up to the end of each group.
        """
        self._starts.append(start)
        self._freqs.append(freq)
        self._ends.append(ends + self._count)
        self._count += len(start)

    def bits(self) -> float:
        """Information content of the symbols so far, in bits."""
        freq = np.concatenate([np.ones(0, np.uint16), *self._freqs])
        return SCALE_BITS * len(freq) - float(np.log2(freq, dtype=np.float64).sum())

    def finish(self) -> bytes:
        """Encodes the symbols.

        Returns:
            The stream: u8 binary logarithm of the number of lanes, u32 states, u32 number of words,
            u16 words; little-endian.
        """
        lanes_log2 = self._lanes_log2
        if lanes_log2 is None:
            worth = int(self.bits()) // self._lane_bits
            lanes_log2 = min(max(worth.bit_length() - 1, 0), MAX_LANES_LOG2)
        start = np.concatenate([np.zeros(0, np.uint16), *self._starts])
        freq = np.concatenate([np.zeros(0, np.uint16), *self._freqs])
        ends = np.concatenate([np.zeros(0, np.int64), *self._ends])
        states = np.full(1 << lanes_log2, LOW, np.uint32)
        if kernel.available():
            words = kernel.rans_encode(start, freq, ends, SCALE_BITS, states)
        else:
            words = _encoded(start, freq, ends, states)
        return b"".join(
            (
                bytes([lanes_log2]),
                states.astype("<u4").tobytes(),
                len(words).to_bytes(4, "little"),
                words.astype("<u2").tobytes(),
            )
        )


def _encoded(
    start: NDArray[np.uint16], freq: NDArray[np.uint16], ends: NDArray[np.int64],
    states: NDArray[np.uint32],
) -> NDArray[np.uint16]:  # fmt: skip
    """Words of the stream, uint16; `states` are replaced by their final values."""
    lanes, state = len(states), states.astype(np.uint64)
    words = [np.zeros(0, np.uint16)]
    for first, end in reversed(list(pairwise([0, *ends.tolist()]))):
        for i in range(first + (end - first - 1) // lanes * lanes, first - 1, -lanes):
            at = slice(i, min(i + lanes, end))
            own = freq[at].astype(np.uint64)
            x = state[: len(own)]
            over = x >= own << np.uint64(32 - SCALE_BITS)
            words.append((x[over] & np.uint64(0xFFFF)).astype(np.uint16))
            x = np.where(over, x >> np.uint64(16), x)
            state[: len(own)] = ((x // own) << np.uint64(SCALE_BITS)) + x % own + start[at]
    states[:] = state
    return np.concatenate(words[::-1])


class Decoder:
    """Reads a stream of `Encoder` from the front of `data`.

    Attributes:
        lanes: Number of states.
        states: uint64 [lanes] states.
        words: uint64 [words] words of the stream.
        used: Number of words read so far.
        end: Offset in `data` of the first byte after the stream.

    Raises:
        FormatError: The stream is truncated or corrupt.
    """

    def __init__(self, data: bytes) -> None:
        if not data or data[0] > MAX_LANES_LOG2:
            raise FormatError("entropy-coded stream is empty or has too many lanes", rule="ENT-4")
        self.lanes = 1 << data[0]
        head = 1 + 4 * self.lanes + 4
        if len(data) < head:
            raise FormatError("entropy-coded stream is truncated", rule="ENT-4")
        self.states = np.frombuffer(data, "<u4", self.lanes, 1).astype(np.uint64)
        count = int.from_bytes(data[head - 4 : head], "little")
        if len(data) < head + 2 * count:
            raise FormatError("entropy-coded stream is truncated", rule="ENT-4")
        self.words = np.frombuffer(data, "<u2", count, head).astype(np.uint64)
        self.used = 0
        if (self.states < LOW).any():
            raise FormatError("entropy-coded stream starts from an invalid state", rule="ENT-4")
        self.end = head + 2 * count

    def check_capacity(self, symbols: int, alphabet: int) -> None:
        """Refuses a stream that is too short for its symbols, before memory is allocated for them.

        The most probable of A symbols has a frequency of at most T - A + 1, with T = 2**SCALE_BITS.
        So each symbol takes at least (A - 1) / T bits. Words and states hold 16 bits each above
        `LOW`.

        Args:
            symbols: Number of symbols to decode.
            alphabet: Number A of different symbols.

        Raises:
            FormatError: There are too few words.
        """
        if symbols * (alphabet - 1) > 16 * (len(self.words) + self.lanes) << SCALE_BITS:
            raise FormatError("entropy-coded stream is too short for its array", rule="ENT-6")

    def symbols(self, cdf: NDArray[np.int64]) -> NDArray[np.int64]:
        """Decodes a group of N symbols, each with a distribution of its own.

        Args:
            cdf: int64 [N, A + 1] cumulative frequencies of each distribution, 0..2**SCALE_BITS.

        Returns:
            int64 [N] symbols, 0..A - 1.

        Raises:
            FormatError: The stream ends too early.
        """
        n, width = cdf.shape
        if min(n, self.lanes) < FEW:
            return self._one_by_one(cdf, _row_starts(n, width))
        table = cdf.astype(np.uint64)
        out = np.empty(n, np.int64)
        for i in range(0, n, self.lanes):
            rows = table[i : i + self.lanes]
            count = len(rows)
            state = self.states[:count]
            slot = state & _SLOT_MASK
            found = (rows[:, 1:] <= slot[:, None]).argmin(1)
            at = found + _row_starts(count, width)
            flat = rows.ravel()
            start = flat[at]
            self._advance(count, (flat[at + 1] - start) * (state >> _SCALE_SHIFT) + slot - start)
            out[i : i + self.lanes] = found
        return out

    def lookup(self, table: NDArray[np.uint16], rows: NDArray[np.int64]) -> NDArray[np.int64]:
        """Decodes a group of N symbols, each with a distribution from a table.

        Args:
            table: uint16 [R, A + 1] cumulative frequencies of R distributions.
            rows: int64 [N] row of the table for each symbol.

        Returns:
            int64 [N] symbols, 0..A - 1.

        Raises:
            FormatError: The stream ends too early.
        """
        width = table.shape[1]
        if min(len(rows), self.lanes) < FEW:
            return self._one_by_one(table, rows * width)
        flat = table.ravel()
        out = np.empty(len(rows), np.int64)
        for i in range(0, len(rows), self.lanes):
            own = rows[i : i + self.lanes]
            count = len(own)
            state = self.states[:count]
            slot = state & _SLOT_MASK
            ends = table.take(own, 0)[:, 1:]
            found = (ends <= slot.astype(np.uint16)[:, None]).argmin(1)
            at = own * width + found
            start = flat.take(at).astype(np.uint64)
            freq = flat.take(at + 1).astype(np.uint64) - start
            out[i : i + self.lanes] = found
            self._advance(count, freq * (state >> _SCALE_SHIFT) + slot - start)
        return out

    def raw(self, widths: NDArray[np.int64]) -> NDArray[np.int64]:
        """Decodes a group of N equally distributed numbers.

        Args:
            widths: int64 [N] bits of each number, 0..SCALE_BITS.

        Returns:
            int64 [N] numbers, 0..2**width - 1.

        Raises:
            FormatError: The stream ends too early.
        """
        if min(len(widths), self.lanes) < FEW:
            return self._raw_one_by_one(widths)
        out = np.empty(len(widths), np.int64)
        for i in range(0, len(widths), self.lanes):
            shift = np.uint64(SCALE_BITS) - widths[i : i + self.lanes].astype(np.uint64)
            state = self.states[: len(shift)]
            slot = state & _SLOT_MASK
            found = slot >> shift
            out[i : i + self.lanes] = found
            fresh = ((state >> _SCALE_SHIFT) << shift) + slot - (found << shift)
            self._advance(len(shift), fresh)
        return out

    def _one_by_one(self, table: NDArray[Any], starts: NDArray[np.int64]) -> NDArray[np.int64]:
        """Decodes a group of symbols in a loop.

        Args:
            table: [R, A + 1] cumulative frequencies of R distributions.
            starts: int64 [N] offset of the row of each symbol in the flat table.

        Returns:
            int64 [N] symbols.
        """
        ends, last = table.ravel().data, table.shape[1] - 1
        lanes = min(len(starts), self.lanes)
        states = self.states[:lanes].tolist()
        out = np.empty(len(starts), np.int64)
        for i, first in enumerate(starts.tolist()):
            state = states[i % lanes]
            slot = state & ((1 << SCALE_BITS) - 1)
            at = bisect.bisect_right(ends, slot, first + 1, first + last)
            start = ends[at - 1]
            state = (ends[at] - start) * (state >> SCALE_BITS) + slot - start
            states[i % lanes] = self._refilled(state)
            out[i] = at - first - 1
        self.states[:lanes] = states
        return out

    def _raw_one_by_one(self, widths: NDArray[np.int64]) -> NDArray[np.int64]:
        """Decodes a group of numbers, as `raw`, in a loop."""
        lanes = min(len(widths), self.lanes)
        states = self.states[:lanes].tolist()
        out = np.empty(len(widths), np.int64)
        for i, width in enumerate(widths.tolist()):
            shift, state = SCALE_BITS - width, states[i % lanes]
            slot = state & ((1 << SCALE_BITS) - 1)
            out[i] = slot >> shift
            state = (state >> SCALE_BITS << shift) + slot - (slot >> shift << shift)
            states[i % lanes] = self._refilled(state)
        self.states[:lanes] = states
        return out

    def by_counts(self, rows: list[list[int]]) -> list[int]:
        """Decodes a group of symbols whose distributions are given by counts.

        Each symbol has a frequency of 1, and a share of the rest that is proportional to its count.

        Args:
            rows: For each symbol to decode, the counts of all symbols; their sum is at least 1.

        Returns:
            The symbols.

        Raises:
            FormatError: The stream ends too early.
        """
        out = []
        for i, counts in enumerate(rows):
            state = int(self.states[i % self.lanes])
            slot = state & ((1 << SCALE_BITS) - 1)
            room, total = (1 << SCALE_BITS) - len(counts), sum(counts)
            symbol = start = 0
            end = room * counts[0] // total + 1
            while slot >= end and symbol < len(counts) - 1:
                symbol, start = symbol + 1, end
                end += room * counts[symbol] // total + 1
            if symbol == len(counts) - 1:
                end = 1 << SCALE_BITS
            state = (end - start) * (state >> SCALE_BITS) + slot - start
            self.states[i % self.lanes] = self._refilled(state)
            out.append(symbol)
        return out

    def _refilled(self, state: int) -> int:
        """Shifts another word into a state that is below `LOW`.

        Raises:
            FormatError: No word is left.
        """
        if state >= LOW:
            return state
        if self.used == len(self.words):
            raise FormatError(TOO_SHORT, rule="ENT-6")
        self.used += 1
        return state << 16 | int(self.words[self.used - 1])

    def _advance(self, count: int, state: NDArray[np.uint64]) -> None:
        """Stores new values of the first `count` states, and refills those below `LOW`.

        Raises:
            FormatError: Too few words are left.
        """
        low = (state < _LOW).nonzero()[0]
        stop = self.used + len(low)
        if stop > len(self.words):
            raise FormatError(TOO_SHORT, rule="ENT-6")
        state[low] = state[low] << _WORD_SHIFT | self.words[self.used : stop]
        self.used = stop
        self.states[:count] = state

    def finish(self) -> None:
        """Checks that the stream is used up exactly.

        Raises:
            FormatError: Words are left over, or a state is not back at `LOW`.
        """
        if self.used != len(self.words) or (self.states != LOW).any():
            raise FormatError(
                "entropy-coded stream does not end where its symbols do", rule="ENT-7"
            )

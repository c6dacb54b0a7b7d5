"""Interleaved rANS (asymmetric numeral systems) with 32-bit states and 16-bit words.

Sources: Duda 2013, "Asymmetric numeral systems"; Giesen 2014, "Interleaved entropy coders".
Symbols come in *groups* of at most `lanes`; symbol j of a group uses state j, so that a group is a
few array operations. The encoder runs backwards, hence it records everything first.
"""

from __future__ import annotations

import functools

import numpy as np
from numpy.typing import NDArray

from ..errors import FormatError

SCALE_BITS = 14
"""Frequencies of a distribution sum to `1 << SCALE_BITS`."""

LOW = 1 << 16
"""States stay in LOW .. 2**32 - 1; encoding starts, and decoding ends, with every state at LOW."""

MAX_LANES_LOG2 = 10

_SLOT_MASK = np.uint64((1 << SCALE_BITS) - 1)
_SCALE_SHIFT, _WORD_SHIFT, _LOW = np.uint64(SCALE_BITS), np.uint64(16), np.uint64(LOW)


def lanes_log2_for(symbols: int) -> int:
    """Lanes an encoder uses: enough for array speed, few enough to cost about 1 %."""
    return min(max((symbols // 512).bit_length() - 1, 0), MAX_LANES_LOG2)


@functools.lru_cache(maxsize=64)
def _row_starts(count: int, width: int) -> NDArray[np.int64]:
    return np.arange(count) * width


class Encoder:
    """Collects (start, frequency) pairs in decoding order; `finish` returns the stream."""

    def __init__(self, lanes_log2: int) -> None:
        self._lanes_log2 = lanes_log2
        self._groups: list[tuple[NDArray[np.uint64], NDArray[np.uint64]]] = []

    def put(self, start: NDArray[np.integer], freq: NDArray[np.integer]) -> None:
        """Adds symbols with cumulative frequency `start` [N] and frequency `freq` [N] >= 1."""
        lanes = 1 << self._lanes_log2
        for i in range(0, len(start), lanes):
            self._groups.append(
                (start[i : i + lanes].astype(np.uint64), freq[i : i + lanes].astype(np.uint64))
            )

    def finish(self) -> bytes:
        """The stream: u8 lanes_log2, u32 states, u32 number of words, u16 words."""
        state = np.full(1 << self._lanes_log2, LOW, np.uint64)
        words: list[NDArray[np.uint16]] = []
        for start, freq in reversed(self._groups):
            x = state[: len(freq)]
            over = x >= freq << np.uint64(32 - SCALE_BITS)
            words.append((x[over] & np.uint64(0xFFFF)).astype(np.uint16))
            x = np.where(over, x >> np.uint64(16), x)
            state[: len(freq)] = ((x // freq) << np.uint64(SCALE_BITS)) + x % freq + start
        flat = np.concatenate(words[::-1]) if words else np.zeros(0, np.uint16)
        return b"".join(
            (
                bytes([self._lanes_log2]),
                state.astype("<u4").tobytes(),
                len(flat).to_bytes(4, "little"),
                flat.astype("<u2").tobytes(),
            )
        )


class Decoder:
    """Reads a stream made by `Encoder` from the front of `data`.

    Attributes:
        lanes: Number of states.
        states: uint64 [lanes].
        words: uint64 [words].
        used: Words read so far.
        end: Offset in `data` of the first byte after the stream.

    Raises:
        FormatError: The stream is truncated or corrupt.
    """

    def __init__(self, data: bytes) -> None:
        if not data or data[0] > MAX_LANES_LOG2:
            raise FormatError("entropy-coded stream is empty or has too many lanes")
        self.lanes, self.scale_bits = 1 << data[0], SCALE_BITS
        head = 1 + 4 * self.lanes + 4
        if len(data) < head:
            raise FormatError("entropy-coded stream is truncated")
        self.states = np.frombuffer(data, "<u4", self.lanes, 1).astype(np.uint64)
        count = int.from_bytes(data[head - 4 : head], "little")
        if len(data) < head + 2 * count:
            raise FormatError("entropy-coded stream is truncated")
        self.words = np.frombuffer(data, "<u2", count, head).astype(np.uint64)
        self.used = 0
        if (self.states < LOW).any():
            raise FormatError("entropy-coded stream starts from an invalid state")
        self.end = head + 2 * count

    def check_capacity(self, symbols: int, alphabet: int) -> None:
        """Refuses at once what cannot hold `symbols`: a small file cannot ask for a huge array.

        The most probable symbol has a frequency of at most T - A + 1, with T = 2**SCALE_BITS, so
        each takes at least (A - 1) / T bits; words and states hold 16 bits each above `LOW`.

        Raises:
            FormatError: There are too few words.
        """
        if symbols * (alphabet - 1) > 16 * (len(self.words) + self.lanes) << SCALE_BITS:
            raise FormatError("entropy-coded stream is too short for its array")

    def symbols(self, cdf: NDArray[np.int64]) -> NDArray[np.int64]:
        """The next N symbols, whose cumulative frequencies are the rows of `cdf` [N, A + 1].

        Raises:
            FormatError: The stream ends too early.
        """
        n, width = cdf.shape
        table = cdf.astype(np.uint64)
        out = np.empty(n, np.int64)
        for i in range(0, n, self.lanes):
            rows = table[i : i + self.lanes]
            count = len(rows)
            state = self.states[:count]
            slot = state & _SLOT_MASK
            found = np.count_nonzero(rows[:, 1:] <= slot[:, None], axis=1)
            at = found + _row_starts(count, width)
            flat = rows.ravel()
            start = flat[at]
            state = (flat[at + 1] - start) * (state >> _SCALE_SHIFT) + slot - start
            low = (state < _LOW).nonzero()[0]
            stop = self.used + len(low)
            if stop > len(self.words):
                raise FormatError("entropy-coded stream ends too early")
            state[low] = state[low] << _WORD_SHIFT | self.words[self.used : stop]
            self.used = stop
            self.states[:count] = state
            out[i : i + self.lanes] = found
        return out

    def finish(self) -> None:
        """Checks that the stream was used up exactly.

        Raises:
            FormatError: Words are left over or a state is not back at `LOW`.
        """
        if self.used != len(self.words) or (self.states != LOW).any():
            raise FormatError("entropy-coded stream does not end where its symbols do")

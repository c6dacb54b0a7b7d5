"""Interleaved rANS (asymmetric numeral systems) with 32-bit states and 16-bit words.

Sources: Duda 2013, "Asymmetric numeral systems"; Giesen 2014, "Interleaved entropy coders".
Symbols come in *groups* of at most `lanes`; symbol j of a group uses state j, so that a group is a
few array operations. The encoder runs backwards, hence it records everything first.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..errors import FormatError

SCALE_BITS = 14
"""Frequencies of a distribution sum to `1 << SCALE_BITS`."""

LOW = 1 << 16
"""States stay in LOW .. 2**32 - 1; encoding starts, and decoding ends, with every state at LOW."""

MAX_LANES_LOG2 = 10


def lanes_log2_for(symbols: int) -> int:
    """Lanes an encoder uses: enough for array speed, few enough that 4 bytes a lane cost < 1 %."""
    return min(max((symbols // 1024).bit_length() - 1, 0), MAX_LANES_LOG2)


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

    Raises:
        FormatError: The stream is truncated or corrupt.
    """

    def __init__(self, data: bytes) -> None:
        if not data or data[0] > MAX_LANES_LOG2:
            raise FormatError("entropy-coded stream is empty or has too many lanes")
        self.lanes = 1 << data[0]
        head = 1 + 4 * self.lanes + 4
        if len(data) < head:
            raise FormatError("entropy-coded stream is truncated")
        self._state = np.frombuffer(data, "<u4", self.lanes, 1).astype(np.uint64)
        count = int.from_bytes(data[head - 4 : head], "little")
        if len(data) < head + 2 * count:
            raise FormatError("entropy-coded stream is truncated")
        self._words = np.frombuffer(data, "<u2", count, head).astype(np.uint64)
        self._next = 0
        self.end = head + 2 * count
        """Offset of the first byte after the stream."""

    def slots(self, n: int) -> NDArray[np.int64]:
        """Slots [n], in 0 .. 2**SCALE_BITS - 1, of the next group; n <= lanes."""
        return (self._state[:n] & np.uint64((1 << SCALE_BITS) - 1)).astype(np.int64)

    def advance(
        self, slot: NDArray[np.int64], start: NDArray[np.integer], freq: NDArray[np.integer]
    ) -> None:
        """Consumes a group whose symbols have `start` <= `slot` < `start + freq`, all [n]."""
        n = len(slot)
        x = freq.astype(np.uint64) * (self._state[:n] >> np.uint64(SCALE_BITS))
        x += (slot - start).astype(np.uint64)
        low = np.flatnonzero(x < LOW)
        stop = self._next + len(low)
        if stop > len(self._words):
            raise FormatError("entropy-coded stream ends too early")
        x[low] = (x[low] << np.uint64(16)) | self._words[self._next : stop]
        self._next = stop
        self._state[:n] = x

    def finish(self) -> None:
        """Checks that the stream was used up exactly.

        Raises:
            FormatError: Words are left over or a state is not back at `LOW`.
        """
        if self._next != len(self._words) or (self._state != LOW).any():
            raise FormatError("entropy-coded stream does not end where its symbols do")

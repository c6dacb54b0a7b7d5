"""iCCp, eXIf, xMPd: compressed metadata blocks; cICp: colour; iNFO: the program that wrote."""

import zstandard

from ..errors import FormatError, LimitError
from ..limits import Budget
from .chunks import Chunk
from .fields import Field, pack, unpack

BLOCKS = {"icc": "iCCp", "exif": "eXIf", "xmp": "xMPd"}
"""Chunk type of each kind of metadata block."""

FIELDS = (
    Field("size", "int", "Bytes of the block.", 1),
    Field("zstd", "bin", "The block as one zstd frame."),
)

MAGIC = b"\x28\xb5\x2f\xfd"
"""First four bytes of a zstd frame."""

WINDOW_MAX = 1 << 27
"""Largest window of a zstd frame, in bytes, that is accepted."""

CICP_TYPE = "cICp"

CICP_FIELDS = (
    Field("primaries", "int", "Primaries: a number of ITU-T H.273, table 2.", 1, 255),
    Field("transfer", "int", "Transfer characteristics: a number of its table 3.", 1, 255),
)

INFO_TYPE = "iNFO"

INFO_FIELDS = (
    Field("encoder", "str", "Program and version that made the file.", 0, 255),
    Field("settings", "str", "Its settings as a JSON object.", 0, 1 << 16),
    Field("areas", "ints", "Visible pixels of each layer when it was encoded.", 0, 1 << 48),
)


def compress(block: bytes) -> bytes:
    """Returns the payload of a metadata chunk that holds `block`."""
    return pack(FIELDS, {"size": len(block), "zstd": compressed(block)})


def compressed(block: bytes) -> bytes:
    """Compresses a block to one zstd frame."""
    frame: bytes = zstandard.ZstdCompressor(level=19).compress(block)
    return frame


def decompress(chunk: Chunk, where: str, budget: Budget) -> bytes:
    """Decompresses the block of a metadata chunk.

    Args:
        chunk: The chunk.
        where: Name of the chunk in error messages.
        budget: Running budget of the file; its `metadata_bytes` bounds the block.

    Raises:
        FormatError: The payload is not a zstd frame of the stated size.
        LimitError: The block exceeds the budget.
    """
    values = unpack(FIELDS, chunk.payload, where, old=chunk.old)
    return decompressed(values["size"], values["zstd"], where, budget)


def decompressed(
    size: int, frame: bytes, where: str, budget: Budget, rule: str = "CHK-16"
) -> bytes:
    """Decompresses a zstd frame of known size.

    Args:
        size: Bytes of the content.
        frame: The zstd frame.
        where: Name of the chunk in error messages.
        budget: Running budget of the file; its `metadata_bytes` bounds the content.
        rule: Id of the rule that a wrong frame breaks.

    Raises:
        FormatError: `frame` is not one zstd frame with `size` bytes of content.
        LimitError: The content exceeds the budget, or the frame needs too large a window.
    """
    budget.spend("metadata_bytes", size)
    _check_window(frame, where)
    try:
        decompressor = zstandard.ZstdDecompressor(max_window_size=WINDOW_MAX)
        block: bytes = decompressor.stream_reader(frame).read(size + 1)
    except zstandard.ZstdError:
        raise FormatError("metadata is not a zstd frame", where, rule=rule) from None
    if len(block) != size:
        raise FormatError(f"metadata does not have the stated {size} bytes", where, rule=rule)
    if _frame_end(frame, where, rule) != len(frame):
        raise FormatError("bytes follow the zstd frame", where, rule=rule)
    return block


def _check_window(frame: bytes, where: str) -> None:
    """Refuses a frame that states a window above `WINDOW_MAX` (RFC 8878, section 3.1.1.1.2)."""
    if frame[:4] != MAGIC or len(frame) < 6 or frame[4] & 32:
        return
    exponent, eighths = divmod(frame[5], 8)
    if (8 + eighths) << (exponent + 7) > WINDOW_MAX:
        raise LimitError(
            f"{where}: the zstd frame needs a window of more than {WINDOW_MAX} bytes", rule="SEC-6"
        )


def _frame_end(data: bytes, where: str, rule: str) -> int:
    """Length in bytes of the zstd frame at the start of `data` (RFC 8878, section 3.1.1).

    Raises:
        FormatError: `data` does not start with a zstd frame, or the frame is truncated.
    """
    if data[:4] != MAGIC:
        raise FormatError("metadata is not a zstd frame", where, rule=rule)
    at = int(zstandard.frame_header_size(data))
    last = False
    while not last:
        if at + 3 > len(data):
            raise FormatError("the zstd frame is truncated", where, rule=rule)
        header = int.from_bytes(data[at : at + 3], "little")
        last, kind, size = bool(header & 1), header >> 1 & 3, header >> 3
        at += 3 + (1 if kind == 1 else size)
    return at + 4 * (data[4] >> 2 & 1)

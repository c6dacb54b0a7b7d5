"""iCCp, eXIf, xMPd: metadata blocks carried as they are, compressed; and iNFO: how it was made."""

import zstandard

from ..errors import FormatError
from ..limits import Limits
from .fields import Field, pack, unpack

BLOCKS = {"icc": "iCCp", "exif": "eXIf", "xmp": "xMPd"}
"""Chunk type of each kind of metadata block."""

FIELDS = (
    Field("size", "int", "Bytes of the block.", 1),
    Field("zstd", "bin", "The block as one zstd frame."),
)

INFO_TYPE = "iNFO"

INFO_FIELDS = (
    Field("encoder", "str", "Program and version that made the file.", 0, 255),
    Field("settings", "str", "Its settings as a JSON object.", 0, 1 << 16),
    Field("areas", "ints", "Visible pixels of each layer when it was encoded.", 0, 1 << 48),
)


def compress(block: bytes) -> bytes:
    """Payload of a metadata chunk holding `block`."""
    frame = zstandard.ZstdCompressor(level=19).compress(block)
    return pack(FIELDS, {"size": len(block), "zstd": frame})


def decompress(payload: bytes, where: str, limits: Limits) -> bytes:
    """The block of a metadata chunk, never larger than `limits.metadata_bytes`.

    Raises:
        FormatError: Not a zstd frame of the stated size.
        LimitError: Larger than the limit.
    """
    values = unpack(FIELDS, payload, where)
    limits.check("metadata_bytes", values["size"])
    try:
        reader = zstandard.ZstdDecompressor().stream_reader(values["zstd"])
        block: bytes = reader.read(values["size"] + 1)
    except zstandard.ZstdError:
        raise FormatError("metadata is not a zstd frame", where) from None
    if len(block) != values["size"]:
        raise FormatError(f"metadata does not have the stated {values['size']} bytes", where)
    return block

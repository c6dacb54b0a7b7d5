"""The `.pxi` container: chunk framing, and one module for the fields of each chunk type."""

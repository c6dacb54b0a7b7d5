"""Conversion between bytes and the model: packing, reading, writing, salvaging, levels."""

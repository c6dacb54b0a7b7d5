"""The encoder: decompose, fit boundaries and textures, quantize, pack."""

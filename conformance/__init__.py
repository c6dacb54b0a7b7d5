"""Conformance suite of the `.pxi` format: cases, their generator, and a runner for decoders."""

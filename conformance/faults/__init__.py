"""Decoders with one fault each, which the suite must detect."""

"""Mutation testing of the suite: ``python -m conformance.mutants``."""

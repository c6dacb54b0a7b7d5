"""Generator of the cases: ``python -m conformance.make``."""

"""What makes the cases: ``python -m conformance.make``."""

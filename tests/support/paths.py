"""Where things lie."""

from pathlib import Path

ROOT = Path(__file__).parents[2]
"""The repository."""

TESTS = ROOT / "tests"

DATA = ROOT.parent / "shared" / "data"
"""Test pictures next to the checkout, too large for it; perhaps they are not there."""

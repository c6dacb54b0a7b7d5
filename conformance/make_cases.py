"""The name under which cases tell what made them: the same as ``python -m conformance.make``."""

import sys

from .make.__main__ import main

if __name__ == "__main__":
    sys.exit(main())

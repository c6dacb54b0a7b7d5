"""Former name of ``python -m conformance.make``, by which the descriptions of cases call it."""

import sys

from .make.__main__ import main

if __name__ == "__main__":
    sys.exit(main())

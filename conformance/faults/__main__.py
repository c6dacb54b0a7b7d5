"""Decoder with a fault: ``python -m conformance.faults --fault NAME IN OUT [pxi-decode flags]``."""

import sys

from .decoder import main

if __name__ == "__main__":
    sys.exit(main())

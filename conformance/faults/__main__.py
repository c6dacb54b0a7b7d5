"""A wrong decoder: ``python -m conformance.faults --fault NAME IN OUT [flags of pxi-decode]``."""

import sys

from .decoder import main

if __name__ == "__main__":
    sys.exit(main())

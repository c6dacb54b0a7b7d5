"""torch, with threads that let others run while they wait.

Those of OpenMP spin, unless OMP_WAIT_POLICY says otherwise when torch is imported; beside one busy
process, encoding then takes 5 to 10 times as long. No call changes that later, so a program that
imports torch before this package sets the variable itself.
"""

from __future__ import annotations

import os
import sys

_OURS = "torch" not in sys.modules and not {"OMP_WAIT_POLICY", "GOMP_SPINCOUNT"} & set(os.environ)
if _OURS:
    os.environ["OMP_WAIT_POLICY"] = "PASSIVE"
try:
    import torch as torch
finally:
    if _OURS:
        os.environ.pop("OMP_WAIT_POLICY", None)

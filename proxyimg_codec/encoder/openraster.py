"""Place where programs of version 0.4.0 find `read_openraster`: `encoder.layered.openraster`."""

from .layered.openraster import read_openraster

__all__ = ["read_openraster"]

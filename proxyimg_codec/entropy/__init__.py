"""Entropy coding: interleaved rANS with adaptive or tabulated models, in integer arithmetic."""

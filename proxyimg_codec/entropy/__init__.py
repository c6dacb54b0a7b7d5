"""Entropy coding: interleaved rANS with an adaptive integer model. All arithmetic is integer."""

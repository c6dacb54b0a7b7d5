"""Rendering of layers to pixels, at any size and of any region."""

"""Fitting codes and networks of implicit textures."""

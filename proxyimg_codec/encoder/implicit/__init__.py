"""Fitting of the codes and networks of implicit textures."""

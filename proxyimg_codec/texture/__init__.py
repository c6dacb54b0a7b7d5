"""Textures of both coders: implicit (codes and a network of the file) and pyramid (rasters)."""

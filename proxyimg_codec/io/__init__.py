"""Raster files, their metadata, XML, and whole files."""

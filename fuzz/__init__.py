"""Fuzz targets: no input may raise anything but a `PxiError` (see README.md)."""

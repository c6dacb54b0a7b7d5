"""Fuzz targets: nothing that is read may raise anything but a `PxiError` (see README.md)."""

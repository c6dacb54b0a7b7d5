"""Readers of layered pictures: OpenRaster, Photoshop, folders of pictures."""

"""Encoder: finds layers in a picture, fits boundaries and textures, and quantizes them."""

"""Textures: planes of codes, the network that decodes them, and the engines that run it."""

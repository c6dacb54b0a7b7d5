"""Decomposition of a picture into named layers: regions, contours, Bézier paths, meshes."""

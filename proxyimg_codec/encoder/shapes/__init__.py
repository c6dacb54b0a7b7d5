"""From a picture to named layers: regions, contours, Bézier paths, meshes."""

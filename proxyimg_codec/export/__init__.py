"""Export to other file types: clips, OpenRaster, SVG, ONNX."""

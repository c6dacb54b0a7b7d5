"""Animation: position-based dynamics on the proxy nodes of layers."""

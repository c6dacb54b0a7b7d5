"""Animation of layers: position-based dynamics of their proxy nodes."""

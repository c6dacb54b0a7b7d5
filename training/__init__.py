"""How the registered pyramid model is trained; see README.md."""

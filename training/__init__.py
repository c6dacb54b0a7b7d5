"""Training of the registered pyramid model; see README.md."""

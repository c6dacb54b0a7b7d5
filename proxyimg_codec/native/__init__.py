"""The compiled kernel and its binding; all of it is optional."""

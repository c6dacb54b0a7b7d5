"""Whether a file is valid, and what is odd about it."""

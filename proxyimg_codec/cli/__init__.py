"""Command-line tools, one module for each."""

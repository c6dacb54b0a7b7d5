"""Slow measurements; docs/figures.md has what they printed, and the commands."""

"""Slow measurements; docs/figures.md has their results, and the commands."""

"""Validation: checks whether a file is valid, and warns of oddities."""

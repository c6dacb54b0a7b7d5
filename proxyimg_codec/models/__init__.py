"""Registered models: weights, and cards that say where they come from."""

"""Registered models: files of weights, with a card for each that states its origin."""

"""Boundaries and their coverage: integer arithmetic, the same in every decoder."""

"""Editing: operations that turn one decoded picture into another."""

"""Editing: operations on the decoded model."""

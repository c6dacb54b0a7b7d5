"""Completion: colours for the parts of a layer that other layers hide."""

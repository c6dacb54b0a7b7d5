"""Rendering: from layers to pixels at any size and region."""

"""Boundaries, coverage, meshes, poses and motion of layers.

Everything that decides which pixels belong to a layer is integer arithmetic, the same in every
decoder.
"""

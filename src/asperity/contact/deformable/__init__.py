"""Deformable textured surfaces: forces on moving vertices, and elastic bodies that move them.

See `docs/deformable.md`. The texture stands on an elastic layer on a mesh whose vertices move; the
force on each vertex is minus the gradient of one energy.
"""

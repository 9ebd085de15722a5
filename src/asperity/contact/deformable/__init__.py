"""Deformable textured surfaces: forces on moving vertices, and elastic bodies that move them.

See `docs/deformable.md`. The texture is on an elastic layer on a mesh with moving vertices; the
force on each vertex is minus the gradient of one energy.
"""

"""Convex decomposition of meshes, cached."""

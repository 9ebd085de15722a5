"""Rendering methods compared on one motion, with measured properties."""

"""Texture force laws, one a file."""

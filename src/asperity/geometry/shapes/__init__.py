"""Meshes that come with the package: a hammer, a file, a machined part, and chamfered blocks."""

"""Baking: a scan becomes a mesh of few triangles with a height texture for the detail."""

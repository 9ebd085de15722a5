"""Scenes: bodies with textures, from MJCF and TOML, from mesh and image files, or from code."""

from asperity._core.moved import forwarded

# Names of the former module of this name are deprecated.
__getattr__ = forwarded(__name__, "asperity.scene.scene")

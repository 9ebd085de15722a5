"""Procedural textures from shapes and spectra."""

from asperity._core.moved import forwarded

# Until now this was a module; its contents are one level deeper.
__getattr__ = forwarded(__name__, "asperity.texture.patterns.patterns")

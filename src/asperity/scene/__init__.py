"""A scene: bodies with textures, read from MJCF and TOML, from files, or made in code."""

from asperity._core.moved import forwarded

# Until now this was a module; what it held lies one level deeper.
__getattr__ = forwarded(__name__, "asperity.scene.scene")

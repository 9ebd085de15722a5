"""Passivity observer and controller at the port of the hand."""

from asperity._core.moved import forwarded

# Until now this was a module; what it held lies one level deeper.
__getattr__ = forwarded(__name__, "asperity.dynamics.passivity.controller")

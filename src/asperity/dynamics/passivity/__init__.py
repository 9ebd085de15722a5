"""Passivity observer and controller at the port of the hand."""

from asperity._core.moved import forwarded

# Names of the former module of this name are deprecated.
__getattr__ = forwarded(__name__, "asperity.dynamics.passivity.controller")

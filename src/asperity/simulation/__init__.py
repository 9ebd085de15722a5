"""Poses of the handle in, wrenches out: the contact of a tool, with anti-aliasing."""

from asperity._core.moved import forwarded

# Until now this was a module; what it held lies one level deeper.
__getattr__ = forwarded(__name__, "asperity.simulation.simulation")

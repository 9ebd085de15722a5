"""The simulation of a scene: poses of the handle in, wrenches out, with anti-aliasing."""

from asperity._core.moved import forwarded

# Names of the former module of this name are deprecated.
__getattr__ = forwarded(__name__, "asperity.simulation.simulation")

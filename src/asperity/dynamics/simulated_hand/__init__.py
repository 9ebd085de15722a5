"""A simulated hand in 6 DoF."""

from asperity._core.moved import forwarded

# Names of the former module of this name are deprecated.
__getattr__ = forwarded(__name__, "asperity.dynamics.simulated_hand.hand")

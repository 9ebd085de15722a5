"""Soft skins: an elastic layer on a textured body, with the pressure on each of its taxels.

See `docs/soft.md`. The layer is a Winkler foundation (a bed of springs); force and torque are minus
the gradient of one energy of the relative pose.
"""

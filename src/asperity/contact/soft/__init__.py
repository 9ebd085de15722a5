"""Soft skins: an elastic layer on a textured body, with the pressure on each of its taxels.

See `docs/soft.md`. The layer is a bed of springs (a Winkler foundation); force and torque are
minus the gradient of one energy of the relative pose.
"""

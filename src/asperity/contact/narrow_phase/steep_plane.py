"""Planes that are steep to the direction of contact drop out of the search.

A textured one, or a facet of two bodies that are not both convex, does not drop out at once: from
`FLATTEST` on it is lowered along z, further and further, until nothing touches it at `STEEPEST`. So
the depth is continuous as n turns.
"""

from __future__ import annotations

from asperity._core.kernels import small_kernel

FLATTEST = 0.2
"""Smallest cosine between the direction of contact and a normal that faces it."""
STEEPEST = 0.15
"""Cosine at which a plane, lowered from `FLATTEST` on, has dropped out."""


@small_kernel
def lower_steep(patch, normal, size):
    """Lower a plane whose unit normal (3,) is steeper than `FLATTEST`; `size` is its relief [m]."""
    x = min((FLATTEST - normal[2]) / (FLATTEST - STEEPEST), 0.999)
    if x <= 0.0:
        return
    patch.lowered = size * x * x / (1.0 - x)
    patch.origin[2] -= patch.lowered
    patch.base_top -= patch.lowered
    rate = -size * x * (2.0 - x) / (1.0 - x) ** 2 / (FLATTEST - STEEPEST)
    for i in range(2):
        patch.lowered_rate[i] = rate * normal[i]

"""Boxes of parameters beyond the borders of a patch."""

from __future__ import annotations

import math

from asperity._core.kernels import inner_kernel, small_kernel
from asperity.contact.narrow_phase.bounds.texture import roots_over
from asperity.contact.narrow_phase.smooth_base import root_at

_LEAST_ROOT = 0.02
"""Root below which borders of curved patches are ignored."""


@inner_kernel
def beyond_borders(patch, x, y, half_x, half_y):
    """Return whether a box around (x, y) is beyond one of a patch's borders."""
    if patch.border_count == 0:
        return False
    radius = math.sqrt(half_x * half_x + half_y * half_y)
    least, _ = roots_over(patch, x, y, radius)
    if least <= _LEAST_ROOT:
        return False
    r, r_x, r_y, _, _, _ = root_at(patch, x, y)
    # Bound of the root's distance from its tangent plane.
    bend = 0.5 * radius * radius * patch.ellipse_max / (least * least * least)
    for i in range(patch.border_count):
        border = patch.borders[i]
        k1, k2, k3, k4 = border.from_x, border.from_y, border.from_root, border.from_square
        g = border.constant + k1 * x + k2 * y + k3 * r + k4 * (x * x + y * y)
        g -= abs(k1 + k3 * r_x + 2.0 * k4 * x) * half_x
        g -= abs(k2 + k3 * r_y + 2.0 * k4 * y) * half_y
        if g > abs(k3) * bend:
            return True
    return False


@small_kernel
def is_apart(patch, x, y, reach):
    """Return whether no part of a patch is within `reach` of (x, y), in its parameters."""
    if patch.bulge > 0.0:
        _, most = roots_over(patch, x, y, reach)
        if most < patch.min_root:
            return True
        return beyond_borders(patch, x, y, reach, reach)
    out_x = max(patch.rectangle[0] - x, x - patch.rectangle[1])
    out_y = max(patch.rectangle[2] - y, y - patch.rectangle[3])
    return max(out_x, out_y) > reach or beyond_borders(patch, x, y, reach, reach)

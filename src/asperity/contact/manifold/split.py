"""Division of wide overlap regions into parts, so that their torque does not jump.

The deepest point of a wide contact jumps from end to end when the contact tilts a little. A wide
overlap region is therefore split along two lines through its centroid, and each part has a deepest
point and an equal share of the stiffness. With centroid c and covariance S of the region, the
parts lie around `c + S^(1/2) (+-1, +-1)`: the points of the Gauss rule with the same area, centroid
and second moments. The parts overlap by a radius about the centroid, so that a narrow region has
one part, and a region that grows is split without a jump.
"""

from __future__ import annotations

import math

from asperity._core.kernels import inner_kernel
from asperity.contact.narrow_phase.surface_patch import add_border

_NARROW = 3.0
"""A region is not split along an axis on which its standard deviation is below the radius over
this. (An evenly loaded region ends within 1.8 standard deviations.)"""
_LEAST_VARIANCE = 1e-12
"""Added to variances so that they can be divided by [m^2]."""


@inner_kernel
def _tangential_moments(sums, u, v):
    """Return the centroid and covariance of a region along two axes: mu, mv, uu, uv, vv."""
    volume = sums.volume
    mu = mv = 0.0
    for i in range(3):
        mu += u[i] * sums.first_moment[i] / volume
        mv += v[i] * sums.first_moment[i] / volume
    uu = uv = vv = 0.0
    at = 0
    for i in range(3):
        for k in range(i, 3):
            s = sums.second_moment[at] / volume
            at += 1
            twice = 1.0 if i == k else 2.0
            uu += twice * s * u[i] * u[k]
            vv += twice * s * v[i] * v[k]
            uv += s * (u[i] * v[k] if i == k else u[i] * v[k] + u[k] * v[i])
    return mu, mv, uu - mu * mu, uv - mu * mv, vv - mv * mv


@inner_kernel
def split_lines(sums, u, v, radius, lines_out):
    """Fill the lines that split a region; return whether each of the two does split it.

    Parameters
    ----------
    sums : OVERLAP_SUMS
        Of the region.
    u, v : (3,) arrays
        Axes of the tangent plane in B's frame.
    radius : float
        How far the parts reach over the lines [m].
    lines_out : (2, 3) array
        `l_u, l_v, l_0`, so that the distance from a line is `l_u u + l_v v + l_0` [m], with u and
        v measured from the origin of B's frame.
    """
    mu, mv, uu, uv, vv = _tangential_moments(sums, u, v)
    uu, vv = max(uu, 0.0) + _LEAST_VARIANCE, max(vv, 0.0) + _LEAST_VARIANCE
    # Inverse of the symmetric square root, by the theorem of Cayley and Hamilton.
    s = math.sqrt(max(uu * vv - uv * uv, 1e-30))
    t = math.sqrt(uu + vv + 2.0 * s)
    a, b, c = (uu + s) / t, uv / t, (vv + s) / t
    det = a * c - b * b
    first = second = False
    for k in range(2):
        l_u, l_v = (c / det, -b / det) if k == 0 else (-b / det, a / det)
        size = math.sqrt(l_u * l_u + l_v * l_v)
        split = radius * size < _NARROW
        first, second = (split, second) if k == 0 else (first, split)
        lines_out[k, 0], lines_out[k, 1] = l_u / size, l_v / size
        lines_out[k, 2] = -(l_u * mu + l_v * mv) / size
    return first, second


@inner_kernel
def bound_by(patch, l_u, l_v, l_0, radius):
    """Add a border to a surface patch: base points with `l . (u, v) + l_0 >= -radius`."""
    origin, lateral = patch.origin, patch.lateral
    constant = -l_0 - radius - l_u * origin[0] - l_v * origin[1]
    from_x = -l_u * lateral[0, 0] - l_v * lateral[1, 0]
    from_y = -l_u * lateral[0, 1] - l_v * lateral[1, 1]
    add_border(patch, constant, from_x, from_y, 0.0, 0.0, False)

"""Patches of a footprint: where wide contacts are split, so that their torque does not hop.

The deepest point of a wide contact hops from end to end when it tilts a little. So its footprint
is split along two lines through its middle, and each part has a deepest point of its own, with an
equal share of the stiffness: with middle c and covariance S of the footprint, the parts lie round
`c + S^(1/2) (+-1, +-1)`, the points of Gauss's rule with the same area, middle and second moments.
They overlap by a radius about the middle, so that a footprint that is not wide has one part, and
one that grows is split without a jump.
"""

from __future__ import annotations

import math

from asperity._core.kernels import inner_kernel
from asperity.contact.manifold.overlap_region import MASS, MEAN, SPREAD
from asperity.contact.narrow_phase.surface_patch import add_border

_NARROW = 3.0
"""A footprint whose standard deviation is below the radius over this is not split. (An evenly
loaded one ends within 1.8 deviations.)"""
_LEAST_SPREAD = 1e-12


@inner_kernel
def split_lines(sums, u, v, radius, lines_out):
    """Fill the lines that split a footprint; return whether it is split along the first, second.

    Parameters
    ----------
    sums : (21,) array
        Of a footprint; see `footprint`.
    u, v : (3,) arrays
        Axes of the tangent plane in B's frame.
    radius : float
        How far the parts reach over the lines [m].
    lines_out : (2, 3) array
        `l_u, l_v, l_0`, so that the distance from a line is `l_u u + l_v v + l_0` [m], with u and
        v measured from the origin of B's frame.
    """
    mass = sums[MASS]
    mu = mv = 0.0
    for i in range(3):
        mu += u[i] * sums[MEAN + i] / mass
        mv += v[i] * sums[MEAN + i] / mass
    uu = uv = vv = 0.0
    at = SPREAD
    for i in range(3):
        for k in range(i, 3):
            s = sums[at] / mass
            at += 1
            twice = 1.0 if i == k else 2.0
            uu += twice * s * u[i] * u[k]
            vv += twice * s * v[i] * v[k]
            uv += s * (u[i] * v[k] if i == k else u[i] * v[k] + u[k] * v[i])
    uu, uv, vv = uu - mu * mu, uv - mu * mv, vv - mv * mv
    uu, vv = max(uu, 0.0) + _LEAST_SPREAD, max(vv, 0.0) + _LEAST_SPREAD
    # The inverse of the symmetric square root, by Cayley and Hamilton.
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

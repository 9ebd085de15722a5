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
from asperity._core.records import copy_record
from asperity._core.stack import stack_array
from asperity.contact.narrow_phase.geom_depth import frame_round
from asperity.contact.narrow_phase.surface_patch import add_border

_NARROW = 3.0
"""A region is not split along an axis on which its standard deviation is below the radius over
this. (An evenly loaded region ends within 1.8 standard deviations.)"""
_LEAST_VARIANCE = 1e-12
"""Added to variances so that they can be divided by [m^2]."""
_STEP = 1e-5
"""Relative step of the central differences."""


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
    """Add a border to a surface patch: base points with `l . (u, v) + l_0 >= -radius`.

    It counts as an edge of the patch's body: it is fixed there while the depth is differentiated.
    """
    origin, lateral = patch.origin, patch.lateral
    constant = -l_0 - radius - l_u * origin[0] - l_v * origin[1]
    from_x = -l_u * lateral[0, 0] - l_v * lateral[1, 0]
    from_y = -l_u * lateral[0, 1] - l_v * lateral[1, 1]
    add_border(patch, constant, from_x, from_y, 0.0, 0.0, True)


@inner_kernel
def _offset(sums, n, k, place):
    """Return how far a place (3,) of B's frame lies from line `k` of a region [m]."""
    axes, lines, unit = stack_array((3, 3)), stack_array((2, 3)), stack_array((3,))
    size = math.sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2])
    for i in range(3):
        unit[i] = n[i] / size
    frame_round(unit, axes)
    split_lines(sums, axes[0], axes[1], 0.0, lines)
    off = lines[k, 2]
    for i in range(2):
        off += lines[k, i] * (axes[i, 0] * place[0] + axes[i, 1] * place[1] + axes[i, 2] * place[2])
    return off


@inner_kernel
def add_line_rates(sums, k, place, rate, scratch, direction):
    """Add to the derivatives of a direction by its normal and by the moments of its region.

    `rate` is the derivative of the way out by the distance of a place (3,) of B's frame from line
    `k`, which is where the region's moments put it. By central differences: all is in closed form.

    Parameters
    ----------
    sums, scratch : OVERLAP_SUMS records
        Of the region, and one to be overwritten.
    direction : DIRECTION record
        Its normal is given; its rates are added to.
    """
    copy_record(scratch, sums)
    volume, n = sums.volume, stack_array((3,))
    spread = 0.0
    for i in range(3):
        n[i] = direction.normal[i]
        at = (0, 3, 5)[i]
        spread += sums.second_moment[at] / volume - (sums.first_moment[i] / volume) ** 2
    length = math.sqrt(max(spread, _LEAST_VARIANCE))
    half = 0.5 * rate
    for i in range(3):
        for sign in (1.0, -1.0):
            n[i] = direction.normal[i] + sign * _STEP
            direction.turn[i] += sign * half / _STEP * _offset(sums, n, k, place)
            step = _STEP * volume * length
            scratch.first_moment[i] = sums.first_moment[i] + sign * step
            direction.first_rate[i] += (
                sign * half / step * _offset(scratch, direction.normal, k, place)
            )
        n[i], scratch.first_moment[i] = direction.normal[i], sums.first_moment[i]
    for sign in (1.0, -1.0):
        step = _STEP * volume
        scratch.volume = volume + sign * step
        direction.volume_rate += sign * half / step * _offset(scratch, direction.normal, k, place)
        scratch.volume = volume
        for i in range(6):
            step = _STEP * volume * length * length
            scratch.second_moment[i] = sums.second_moment[i] + sign * step
            by = _offset(scratch, direction.normal, k, place)
            direction.second_rate[i] += sign * half / step * by
            scratch.second_moment[i] = sums.second_moment[i]

"""Split of wide overlap regions into parts, so that their torque is continuous.

The deepest point of a wide contact jumps from end to end when the contact tilts a little. A wide
overlap region is therefore split along two lines through its centroid, and each part has a deepest
point and an equal share of the stiffness. With centroid c and covariance S of the region, the
parts lie around `c + S^(1/2) (+-1, +-1)`: the points of the Gauss rule with the same area, centroid
and second moments. Each part extends beyond the lines by a radius, so that a narrow region has
one part, and a growing region is split continuously.
"""

from __future__ import annotations

import math

from asperity._core.kernels import inner_kernel
from asperity._core.stack import stack_array
from asperity.contact.narrow_phase.geom_depth import frame_round
from asperity.contact.narrow_phase.surface_patch import add_border

_NARROW = 3.0
"""Radius over the standard deviation along an axis from which on a region is not split there (a
uniform one ends within 1.8 standard deviations)."""
_LEAST_VARIANCE, _NO_VARIANCE = 1e-6, 1e-24
"""Regularisation of the variances along both axes: fraction of the total variance, and constant
[m^2]."""
_STEP = 1e-5
"""Step of the central differences by a covariance, over its least variance."""
_TURN = 1e-7
"""Step of the central differences by a normal."""


@inner_kernel
def _fill_moments(sums, mean_out, covariance_out):
    """Fill the centroid (3,) [m] and the covariance (6,): xx, xy, xz, yy, yz, zz [m^2]."""
    at = 0
    for i in range(3):
        mean_out[i] = sums.first_moment[i] / sums.volume
    for i in range(3):
        for k in range(i, 3):
            covariance_out[at] = sums.second_moment[at] / sums.volume - mean_out[i] * mean_out[k]
            at += 1


@inner_kernel
def _project_on_axes(u, v, place):
    """Return the coordinates of a place (3,) along two axes."""
    return (
        u[0] * place[0] + u[1] * place[1] + u[2] * place[2],
        v[0] * place[0] + v[1] * place[1] + v[2] * place[2],
    )


@inner_kernel
def _along_axes(covariance, u, v):
    """Return the covariance along two axes: uu, uv, vv [m^2]."""
    uu = uv = vv = 0.0
    at = 0
    for i in range(3):
        for k in range(i, 3):
            s = covariance[at] if i == k else 2.0 * covariance[at]
            at += 1
            uu += s * u[i] * u[k]
            vv += s * v[i] * v[k]
            uv += 0.5 * s * (u[i] * v[k] + u[k] * v[i])
    return max(uu, 0.0), uv, max(vv, 0.0)


@inner_kernel
def _inverse_root(uu, uv, vv, k):
    """Return row `k` of the inverse of the symmetric square root of a covariance [1/m]."""
    least = _LEAST_VARIANCE * (uu + vv) + _NO_VARIANCE
    uu, vv = uu + least, vv + least
    # By the Cayley-Hamilton theorem.
    s = math.sqrt(max(uu * vv - uv * uv, least * least))
    t = math.sqrt(uu + vv + 2.0 * s)
    a, b, c = (uu + s) / t, uv / t, (vv + s) / t
    det = a * c - b * b
    return (c / det, -b / det) if k == 0 else (-b / det, a / det)


@inner_kernel
def split_lines(sums, u, v, radius, lines_out):
    """Fill the two lines that may split a region; return whether each does.

    Parameters
    ----------
    sums : OVERLAP_SUMS
        Of the region.
    u, v : (3,) arrays
        Axes of the tangent plane in B's frame.
    radius : float
        How far the parts extend beyond the lines [m].
    lines_out : (2, 3) array
        `l_u, l_v, l_0`, so that the distance from a line is `l_u u + l_v v + l_0` [m], with u and
        v measured from the origin of B's frame.
    """
    mean, covariance = stack_array((3,)), stack_array((6,))
    _fill_moments(sums, mean, covariance)
    uu, uv, vv = _along_axes(covariance, u, v)
    mu, mv = _project_on_axes(u, v, mean)
    first = second = False
    for k in range(2):
        l_u, l_v = _inverse_root(uu, uv, vv, k)
        size = math.sqrt(l_u * l_u + l_v * l_v)
        split = radius * size < _NARROW
        first, second = (split, second) if k == 0 else (first, split)
        lines_out[k, 0], lines_out[k, 1] = l_u / size, l_v / size
        lines_out[k, 2] = -(l_u * mu + l_v * mv) / size
    return first, second


@inner_kernel
def bound_by(patch, l_u, l_v, l_0, radius):
    """Add a border to a surface patch: base points with `l . (u, v) + l_0 >= -radius`.

    It counts as an edge of the patch's body: it is fixed in the derivatives of the depth.
    """
    origin, lateral = patch.origin, patch.lateral
    constant = -l_0 - radius - l_u * origin[0] - l_v * origin[1]
    from_x = -l_u * lateral[0, 0] - l_v * lateral[1, 0]
    from_y = -l_u * lateral[0, 1] - l_v * lateral[1, 1]
    add_border(patch, constant, from_x, from_y, 0.0, 0.0, True)


@inner_kernel
def _offset_of(uu, uv, vv, k, u, v):
    """Return the signed distance of (u, v), relative to the centroid, from line `k` [m]."""
    l_u, l_v = _inverse_root(uu, uv, vv, k)
    return (l_u * u + l_v * v) / math.sqrt(l_u * l_u + l_v * l_v)


@inner_kernel
def _offset(covariance, n, k, away):
    """Return the signed distance of a point from line `k` [m]; `away` (3,) is from the centroid."""
    axes, unit = stack_array((3, 3)), stack_array((3,))
    size = math.sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2])
    for i in range(3):
        unit[i] = n[i] / size
    frame_round(unit, axes)
    u, v = axes[0], axes[1]
    uu, uv, vv = _along_axes(covariance, u, v)
    on_u, on_v = _project_on_axes(u, v, away)
    return _offset_of(uu, uv, vv, k, on_u, on_v)


@inner_kernel
def _covariance_rates(uu, uv, vv, k, u, v):
    """Return the derivatives of `_offset_of` by uu, uv and vv [1/m], by central differences."""
    half, root = 0.5 * (uu + vv), math.sqrt(0.25 * (uu - vv) ** 2 + uv * uv)
    step = _STEP * max(half - root, _LEAST_VARIANCE * half)
    by_uu = _offset_of(uu + step, uv, vv, k, u, v) - _offset_of(uu - step, uv, vv, k, u, v)
    by_uv = _offset_of(uu, uv + step, vv, k, u, v) - _offset_of(uu, uv - step, vv, k, u, v)
    by_vv = _offset_of(uu, uv, vv + step, k, u, v) - _offset_of(uu, uv, vv - step, k, u, v)
    return by_uu / (2.0 * step), by_uv / (2.0 * step), by_vv / (2.0 * step)


@inner_kernel
def add_line_rates(sums, k, place, rate, direction):
    """Add the rates by a direction's normal and moments through the distance of a point to a line.

    `rate` is the derivative of the way out by the distance of `place` (3,), B's frame, from line
    `k`.

    Parameters
    ----------
    sums : OVERLAP_SUMS record
        Of the region.
    direction : DIRECTION record
        Its normal is given; its rates are added to.
    """
    mean, covariance, away, n = (
        stack_array((3,)), stack_array((6,)), stack_array((3,)), stack_array((3,)),
    )  # fmt: skip
    axes, volume = stack_array((3, 3)), sums.volume
    _fill_moments(sums, mean, covariance)
    for i in range(3):
        away[i], n[i] = place[i] - mean[i], direction.normal[i]
    for i in range(3):
        n[i] = direction.normal[i] + _TURN
        by = _offset(covariance, n, k, away)
        n[i] = direction.normal[i] - _TURN
        direction.turn[i] += rate * (by - _offset(covariance, n, k, away)) / (2.0 * _TURN)
        n[i] = direction.normal[i]
    frame_round(n, axes)
    u, v = axes[0], axes[1]
    uu, uv, vv = _along_axes(covariance, u, v)
    on_u, on_v = _project_on_axes(u, v, away)
    by_uu, by_uv, by_vv = _covariance_rates(uu, uv, vv, k, on_u, on_v)
    l_u, l_v = _inverse_root(uu, uv, vv, k)
    size, at = math.sqrt(l_u * l_u + l_v * l_v), 0
    for i in range(3):
        n[i] = -(l_u * u[i] + l_v * v[i]) / size  # now the derivative by the centroid
    for i in range(3):
        for j in range(i, 3):
            by = by_uu * u[i] * u[j] + by_vv * v[i] * v[j]
            by += 0.5 * by_uv * (u[i] * v[j] + u[j] * v[i])
            n[i] -= 2.0 * by * mean[j] if i != j else 0.0
            n[j] -= 2.0 * by * mean[i]
            twice = by if i == j else 2.0 * by
            direction.second_rate[at] += rate * twice / volume
            direction.volume_rate -= rate * twice * sums.second_moment[at] / (volume * volume)
            at += 1
    for i in range(3):
        direction.first_rate[i] += rate * n[i] / volume
        direction.volume_rate -= rate * n[i] * mean[i] / volume

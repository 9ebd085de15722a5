"""The direction of least separation of two geoms of which one is curved.

It is found by Newton's method on the unit sphere, for smoothed support functions: the exact ones
are not differentiable everywhere. The direction's derivatives follow from the implicit function
theorem.
"""

from __future__ import annotations

import math

from asperity._core.kernels import clear, inner_kernel
from asperity._core.stack import stack_array
from asperity.contact.manifold.separation import (
    CURVED,
    begin_separation,
    cross_product,
    fill_gap,
    fill_gap_rate,
    fill_unit,
    fill_unit_motion,
    keep_if_near,
    smooth_step,
    smooth_step_slope,
)
from asperity.contact.manifold.support import (
    BOX,
    CAPSULE,
    CYLINDER,
    ELLIPSOID,
    PLANE,
    add_smooth_support,
)
from asperity.contact.narrow_phase.geom_depth import frame_round

_SHALLOW, _DEEP = 0.6, 0.9
"""Separations over the radius of curvature between which a curved direction is blended out."""
_MAX_STEPS = 60


@inner_kernel
def _fill_core(size, kind, out):
    """Fill the half sides (3,) of a geom's core: those of its box, minus the smallest."""
    out[0] = out[1] = size[0]
    out[2] = size[0]
    if kind == CYLINDER:
        out[2] = size[1]
    elif kind in (BOX, ELLIPSOID):
        out[1], out[2] = size[1], size[2]
    elif kind == CAPSULE:
        out[2] = size[0] + size[1]
    least = min(out[0], min(out[1], out[2]))
    for i in range(3):
        out[i] -= least


@inner_kernel
def _closest_in(frame, core, point, out):
    """Fill the point (3,) of a box closest to another point."""
    for i in range(3):
        out[i] = frame[i, 3]
    for k in range(3):
        along = 0.0
        for i in range(3):
            along += frame[i, k] * (point[i] - frame[i, 3])
        along = min(max(along, -core[k]), core[k])
        for i in range(3):
            out[i] += along * frame[i, k]


@inner_kernel
def _fill_seed(geometry, pair, frames, n):
    """Fill the start direction: between the closest points of both cores."""
    a, b = pair.geom_a, pair.geom_b
    core_a, core_b = stack_array((3,)), stack_array((3,))
    p, q = stack_array((3,)), stack_array((3,))
    _fill_core(geometry.size[a], geometry.kind[a], core_a)
    _fill_core(geometry.size[b], geometry.kind[b], core_b)
    for i in range(3):
        p[i] = frames[0, i, 3]
    for _ in range(8):
        _closest_in(frames[1], core_b, p, q)
        _closest_in(frames[0], core_a, q, p)
    length = 0.0
    for i in range(3):
        n[i] = p[i] - q[i]
        length += n[i] * n[i]
    if length < 1e-18:
        length = 0.0
        for i in range(3):
            n[i] = frames[0, i, 3] - frames[1, i, 3]
            length += n[i] * n[i]
    if length < 1e-18:
        clear(n)
        n[2] = length = 1.0
    for i in range(3):
        n[i] /= math.sqrt(length)


@inner_kernel
def _smooth_separation(geometry, pair, frames, n, gradient, hessian):
    """Return g of the smoothed geoms; fill its gradient (3,) and its Hessian (3, 3)."""
    a, b = pair.geom_a, pair.geom_b
    clear(gradient)
    for i in range(3):
        clear(hessian[i])
    gap = add_smooth_support(geometry.kind[a], geometry.size[a], frames[0], n, gradient, hessian)
    gap += add_smooth_support(geometry.kind[b], geometry.size[b], frames[1], n, gradient, hessian)
    for i in range(3):
        d = frames[0, i, 3] - frames[1, i, 3]
        gap -= n[i] * d
        gradient[i] -= d
    return gap


@inner_kernel
def _tangential(hessian, t, i, j):
    """Return an entry of a Hessian in the tangent plane."""
    total = 0.0
    for k in range(3):
        for m in range(3):
            total += t[i, k] * hessian[k, m] * t[j, m]
    return total


@inner_kernel
def _descend(geometry, pair, frames, n, t, hessian):
    """Minimise the smoothed separation over n; return m11, m12, m22, g.

    The first three are the Hessian in the plane of the first two rows of the frame `t` (3, 3): the
    radii of curvature of the Minkowski difference less g [m]. `t` and `hessian` (3, 3) are filled.
    """
    gradient, trial = stack_array((3,)), stack_array((3,))
    gap = _smooth_separation(geometry, pair, frames, n, gradient, hessian)
    m11 = m12 = m22 = 0.0
    for _ in range(_MAX_STEPS):
        frame_round(n, t)
        g1 = g2 = 0.0
        for i in range(3):
            g1 += t[0, i] * gradient[i]
            g2 += t[1, i] * gradient[i]
        m11 = _tangential(hessian, t, 0, 0) - gap
        m12 = _tangential(hessian, t, 0, 1)
        m22 = _tangential(hessian, t, 1, 1) - gap
        half, root = 0.5 * (m11 + m22), math.sqrt(0.25 * (m11 - m22) ** 2 + m12 * m12)
        shift = max(0.0, 0.1 * abs(gap) - (half - root))  # regularised where it is not convex
        a, c = m11 + shift, m22 + shift
        det = a * c - m12 * m12
        d1, d2 = -(c * g1 - m12 * g2) / det, -(a * g2 - m12 * g1) / det
        size = math.hypot(d1, d2)
        if size < 1e-15:
            break
        step = min(1.0, 0.3 / size)
        last = gap
        for _ in range(30):
            length = 0.0
            for i in range(3):
                trial[i] = n[i] + step * (d1 * t[0, i] + d2 * t[1, i])
                length += trial[i] * trial[i]
            for i in range(3):
                trial[i] /= math.sqrt(length)
            gap = _smooth_separation(geometry, pair, frames, trial, gradient, hessian)
            if gap <= last + 1e-16 * (abs(last) + 1e-3):
                break
            step *= 0.5
        for i in range(3):
            n[i] = trial[i]
        if size * step < 1e-13:
            break
    return m11, m12, m22, gap


@inner_kernel
def add_curved(geometry, pair, frames, floor, rough, rows, count):
    """Add the direction of least separation of two geoms of which one is curved."""
    a, b = pair.geom_a, pair.geom_b
    if (geometry.kind[a] == BOX and geometry.kind[b] == BOX) or geometry.kind[b] == PLANE:
        return count
    if count + 1 >= rows.size:
        return count
    found = rows[count]
    begin_separation(found, pair, CURVED)
    n, t, hessian = found.normal, stack_array((3, 3)), stack_array((3, 3))
    _fill_seed(geometry, pair, frames, n)
    m11, m12, m22, gap = _descend(geometry, pair, frames, n, t, hessian)
    half, root = 0.5 * (m11 + m22), math.sqrt(0.25 * (m11 - m22) ** 2 + m12 * m12)
    radius = half - root + gap
    is_smooth, alone = half - root > 0.0, count == 0
    if not is_smooth or gap >= _DEEP * radius:
        if alone:  # no other direction is left
            fill_gap(geometry, frames[0], frames[1], found)
            return count + 1
        return count
    # The implicit function theorem: how the minimum moves with the tool.
    gradient, own = stack_array((3,)), stack_array((3, 3))
    omega, turn, arm, moved = (
        stack_array((3,)), stack_array((3,)), stack_array((3,)), stack_array((3,)),
    )  # fmt: skip
    clear(gradient)
    for i in range(3):
        clear(own[i])
        arm[i] = frames[0, i, 3]
    add_smooth_support(geometry.kind[a], geometry.size[a], frames[0], n, gradient, own)
    for i in range(3):
        arm[i] -= gradient[i]
    det = m11 * m22 - m12 * m12
    for e in range(6):
        fill_unit_motion(e, arm, moved)
        if e >= 3:
            fill_unit(e - 3, omega)
            cross_product(omega, n, turn)
            for i in range(3):
                moved[i] += own[i, 0] * turn[0] + own[i, 1] * turn[1] + own[i, 2] * turn[2]
        b1 = t[0, 0] * moved[0] + t[0, 1] * moved[1] + t[0, 2] * moved[2]
        b2 = t[1, 0] * moved[0] + t[1, 1] * moved[1] + t[1, 2] * moved[2]
        d1, d2 = (m22 * b1 - m12 * b2) / det, (m11 * b2 - m12 * b1) / det
        for i in range(3):
            found.normal_rate[i, e] = d1 * t[0, i] + d2 * t[1, i]
    fill_gap(geometry, frames[0], frames[1], found)
    fill_gap_rate(geometry, frames[0], frames[1], found)
    x = (gap / radius - _SHALLOW) / (_DEEP - _SHALLOW)
    found.share = 1.0 - smooth_step(x)
    for e in range(6):
        found.share_rate[e] = (
            -smooth_step_slope(x) * found.gap_rate[e] / (radius * (_DEEP - _SHALLOW))
        )
    return keep_if_near(rows, count, floor, rough)

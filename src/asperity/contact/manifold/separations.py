r"""Directions along which a convex geom of the tool can leave one of the scene.

For two convex solids the least translation that separates them is along the normal of a face of
either, along the cross product of an edge of each, or, where a curved surface takes part, along a
direction at which the *separation* g(n) is least:

    g(n) = h_B(n) + h_A(-n) - n . (c_A - c_B),

h the support functions and c the centres. g(n) is how far A has to move along n until a plane
across n separates the two. Each of these directions is a `SEPARATION`. Those whose g is much larger
than the least one are ways out through another face, and are left out.

A face that is covered by another geom of the same rigid body is none of the solid's faces: it
offers no way out. So geoms that lie flush are one solid.
"""

from __future__ import annotations

import math

import numpy as np

from asperity._core.kernels import clear, inner_kernel
from asperity._core.records import copy_record
from asperity._core.stack import stack_array
from asperity.contact.manifold.support import (
    BOX,
    CAPSULE,
    CYLINDER,
    ELLIPSOID,
    PLANE,
    add_smooth_support,
    support,
)

COVERED, FACE_B, FACE_A, EDGES, CURVED = -1, 0, 1, 2, 3
"""What a direction is normal to. It is smoothed out beside one of a lower number."""

MAX_PARTS = 12
"""Room for parts of one contact."""
FARTHEST = 2.0
"""Multiple of the least way out from which on a separation g does not count."""
_MARGIN = 1.3
"""The least way out, smoothed, is at most this multiple of the least one."""
_SHALLOW, _DEEP = 0.6, 0.9
"""Separation over the radius of curvature between which a curved direction is smoothed out."""
_CROSSING, _PARALLEL = 0.3, 0.1
"""Sines of the angle between two edges between which their direction is smoothed out."""
_EXPOSED = 0.1
"""Cosine to the normal of a covered face at which a direction that leads over it does not count."""
_GRAIN = 1e-9
"""Relative difference between lengths that count as equal."""
_STEPS = 60


@inner_kernel
def face_bit(axis, sign):
    """Return the bit of a face in `Geometry.covered`."""
    return np.int64(1) << np.int64(2 * axis + (1 if sign > 0.0 else 0))


@inner_kernel
def fill_geom_frame(geometry, g, frame, out):
    """Fill axes and centre (3, 4) of a geom, given the frame (3, 4) of its body."""
    for i in range(3):
        out[i, 3] = frame[i, 3]
        for k in range(3):
            out[i, 3] += frame[i, k] * geometry.position[g, k]
            out[i, k] = 0.0
            for j in range(3):
                out[i, k] += frame[i, j] * geometry.rotation[g, j, k]


@inner_kernel
def _cross(a, b, out):
    """Fill the cross product of two vectors (3,)."""
    out[0] = a[1] * b[2] - a[2] * b[1]
    out[1] = a[2] * b[0] - a[0] * b[2]
    out[2] = a[0] * b[1] - a[1] * b[0]


@inner_kernel
def _fill_unit(k, out):
    """Fill the unit vector (3,) along axis `k`."""
    clear(out)
    out[k] = 1.0


@inner_kernel
def _fill_separation(geometry, frame_a, frame_b, found):
    """Fill g and its rates from the direction of a separation and the direction's rates.

    The rates are by the tool's translation and rotation about the origin of the frames (3, 4).
    """
    a, b, n = found.geom_a, found.geom_b, found.normal
    p, q, turn, omega = stack_array((3,)), stack_array((3,)), stack_array((3,)), stack_array((3,))
    gap = support(geometry.kind[a], geometry.size[a], frame_a, n, p)
    gap += support(geometry.kind[b], geometry.size[b], frame_b, n, q)
    for i in range(3):
        gap -= n[i] * (frame_a[i, 3] - frame_b[i, 3])
    found.gap = gap
    for e in range(6):
        rate = 0.0
        for i in range(3):
            rate += found.normal_rate[i, e] * (p[i] + q[i] - frame_a[i, 3] + frame_b[i, 3])
        if e < 3:
            rate -= n[e]
        else:
            # The point of A that counts is opposite to p, and turns with A.
            _fill_unit(e - 3, omega)
            for i in range(3):
                p[i] -= frame_a[i, 3]
            _cross(omega, p, turn)
            for i in range(3):
                rate += n[i] * turn[i]
                p[i] += frame_a[i, 3]
        found.gap_rate[e] = rate


@inner_kernel
def _begin(found, pair, kind):
    """Set a separation to one that does not turn with the tool."""
    found.geom_a, found.geom_b, found.kind = pair.geom_a, pair.geom_b, kind
    found.share = 1.0
    clear(found.share_rate)
    for i in range(3):
        clear(found.normal_rate[i])


@inner_kernel
def _turn_with_tool(found):
    """Let the direction of a separation turn with the tool."""
    turn, omega = stack_array((3,)), stack_array((3,))
    for e in range(3):
        _fill_unit(e, omega)
        _cross(omega, found.normal, turn)
        for i in range(3):
            found.normal_rate[i, 3 + e] = turn[i]


@inner_kernel
def _keep(rows, count, floor, rough):
    """Keep the row after the last if its separation may count; return how many there are."""
    if count + 1 < rows.size and rows[count].gap - rough < floor:
        return count + 1
    return count


@inner_kernel
def _add_faces(geometry, pair, kind, frames, rows, count):
    """Add the normals of the flat faces of one of two geoms, pointing out of B."""
    is_a = kind == FACE_A
    g = pair.geom_a if is_a else pair.geom_b
    frame, shape, covered = frames[0 if is_a else 1], geometry.kind[g], geometry.covered[g]
    if shape != BOX and shape != CYLINDER and shape != PLANE:
        return count
    for axis in range(0 if shape == BOX else 2, 3):
        for side in range(2):
            sign = 1.0 if side == 1 else -1.0
            if shape == PLANE and side == 0:
                continue
            if count + 1 >= rows.size:
                return count
            found = rows[count]
            _begin(found, pair, COVERED if covered & face_bit(axis, sign) else kind)
            for i in range(3):
                found.normal[i] = (-sign if is_a else sign) * frame[i, axis]
            if is_a:
                _turn_with_tool(found)
            _fill_separation(geometry, frames[0], frames[1], found)
            count += 1
    return count


@inner_kernel
def _add_edges(geometry, pair, frames, floor, rough, rows, count):
    """Add the cross products of the edges of two boxes."""
    frame_a, frame_b = frames[0], frames[1]
    c, across, omega, turn = (
        stack_array((3,)), stack_array((3,)), stack_array((3,)), stack_array((3,)),
    )  # fmt: skip
    for i in range(3):
        for j in range(3):
            one, two = frame_a[:, i], frame_b[:, j]
            _cross(one, two, c)
            sine = math.sqrt(c[0] * c[0] + c[1] * c[1] + c[2] * c[2])
            if sine <= _PARALLEL:
                continue
            for side in range(2):
                if count + 1 >= rows.size:
                    return count
                found = rows[count]
                _begin(found, pair, EDGES)
                sign = 1.0 if side == 1 else -1.0
                for k in range(3):
                    found.normal[k] = sign * c[k] / sine
                n = found.normal
                found.share = _ramp((sine - _PARALLEL) / (_CROSSING - _PARALLEL))
                slope = _ramp_slope((sine - _PARALLEL) / (_CROSSING - _PARALLEL))
                for e in range(3):
                    _fill_unit(e, omega)
                    _cross(omega, one, turn)
                    _cross(turn, two, across)
                    along = 0.0
                    for k in range(3):
                        along += sign * across[k] * n[k]
                    for k in range(3):
                        found.normal_rate[k, 3 + e] = (sign * across[k] - along * n[k]) / sine
                    found.share_rate[3 + e] = slope * along / (_CROSSING - _PARALLEL)
                _fill_separation(geometry, frame_a, frame_b, found)
                count = _keep(rows, count, floor, rough)
    return count


@inner_kernel
def _ramp(x):
    """Return a smooth step from 0 at 0 to 1 at 1."""
    x = min(max(x, 0.0), 1.0)
    return x * x * (3.0 - 2.0 * x)


@inner_kernel
def _ramp_slope(x):
    """Return the derivative of `_ramp`."""
    x = min(max(x, 0.0), 1.0)
    return 6.0 * x * (1.0 - x)


@inner_kernel
def _fill_core(size, kind, out):
    """Fill the half sides (3,) of the box that is left of a geom when it is worn down evenly."""
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
def _nearest_in(frame, core, point, out):
    """Fill the point (3,) of a box nearest to another point."""
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
    """Fill a first direction: between the nearest points of what is left of both, worn down."""
    a, b = pair.geom_a, pair.geom_b
    core_a, core_b = stack_array((3,)), stack_array((3,))
    p, q = stack_array((3,)), stack_array((3,))
    _fill_core(geometry.size[a], geometry.kind[a], core_a)
    _fill_core(geometry.size[b], geometry.kind[b], core_b)
    for i in range(3):
        p[i] = frames[0, i, 3]
    for _ in range(8):
        _nearest_in(frames[1], core_b, p, q)
        _nearest_in(frames[0], core_a, q, p)
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
def _fill_tangents(n, t):
    """Fill two unit vectors (2, 3) that are perpendicular to n and to each other."""
    k = 0 if abs(n[0]) < 0.6 else 1
    for i in range(3):
        t[0, i] = -n[k] * n[i]
    t[0, k] += 1.0
    size = math.sqrt(t[0, 0] ** 2 + t[0, 1] ** 2 + t[0, 2] ** 2)
    for i in range(3):
        t[0, i] /= size
    _cross(n, t[0], t[1])


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
    """Move n to where the smoothed separation is least; return (m11, m12, m22), g.

    The first three are the Hessian in the plane of the tangents `t` (2, 3), which are filled: the
    radii of curvature of the Minkowski difference less g [m]. `hessian` (3, 3) is filled too.
    """
    gradient, trial = stack_array((3,)), stack_array((3,))
    gap = _smooth_separation(geometry, pair, frames, n, gradient, hessian)
    m11 = m12 = m22 = 0.0
    for _ in range(_STEPS):
        _fill_tangents(n, t)
        g1 = g2 = 0.0
        for i in range(3):
            g1 += t[0, i] * gradient[i]
            g2 += t[1, i] * gradient[i]
        m11 = _tangential(hessian, t, 0, 0) - gap
        m12 = _tangential(hessian, t, 0, 1)
        m22 = _tangential(hessian, t, 1, 1) - gap
        half, root = 0.5 * (m11 + m22), math.sqrt(0.25 * (m11 - m22) ** 2 + m12 * m12)
        shift = max(0.0, 0.1 * abs(gap) - (half - root))  # where it is not convex
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
def _add_curved(geometry, pair, frames, floor, rough, rows, count):
    """Add the direction of least separation of two geoms of which one is curved."""
    a, b = pair.geom_a, pair.geom_b
    if (geometry.kind[a] == BOX and geometry.kind[b] == BOX) or geometry.kind[b] == PLANE:
        return count
    if count + 1 >= rows.size:
        return count
    found = rows[count]
    _begin(found, pair, CURVED)
    n, t, hessian = found.normal, stack_array((2, 3)), stack_array((3, 3))
    _fill_seed(geometry, pair, frames, n)
    m11, m12, m22, gap = _descend(geometry, pair, frames, n, t, hessian)
    half, root = 0.5 * (m11 + m22), math.sqrt(0.25 * (m11 - m22) ** 2 + m12 * m12)
    radius = half - root + gap
    is_smooth, alone = half - root > 0.0, count == 0
    if not is_smooth or gap >= _DEEP * radius:
        if alone:  # no other direction is left
            _fill_separation(geometry, frames[0], frames[1], found)
            return count + 1
        return count
    # The implicit function theorem: how the least moves with the tool.
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
        _fill_unit(e % 3, omega)
        if e < 3:
            for i in range(3):
                moved[i] = omega[i]
        else:
            _cross(omega, arm, moved)
            _cross(omega, n, turn)
            for i in range(3):
                moved[i] += own[i, 0] * turn[0] + own[i, 1] * turn[1] + own[i, 2] * turn[2]
        b1 = t[0, 0] * moved[0] + t[0, 1] * moved[1] + t[0, 2] * moved[2]
        b2 = t[1, 0] * moved[0] + t[1, 1] * moved[1] + t[1, 2] * moved[2]
        d1, d2 = (m22 * b1 - m12 * b2) / det, (m11 * b2 - m12 * b1) / det
        for i in range(3):
            found.normal_rate[i, e] = d1 * t[0, i] + d2 * t[1, i]
    _fill_separation(geometry, frames[0], frames[1], found)
    x = (gap / radius - _SHALLOW) / (_DEEP - _SHALLOW)
    found.share = 1.0 - _ramp(x)
    for e in range(6):
        found.share_rate[e] = -_ramp_slope(x) * found.gap_rate[e] / (radius * (_DEEP - _SHALLOW))
    return _keep(rows, count, floor, rough)


@inner_kernel
def _fade_over_covered(geometry, g, axes, outwards, found):
    """Smooth out a direction whose point of support of geom `g` lies on a covered face.

    The solid goes on beyond that face, and so does what the direction would have to clear.
    `outwards` is 1 for the scene's geom, -1 for the tool's.
    """
    for axis in range(3):
        for side in range(2):
            sign = outwards if side == 1 else -outwards
            if not geometry.covered[g] & face_bit(axis, sign * outwards):
                continue
            along = 0.0
            for k in range(3):
                along += sign * axes[k, axis] * found.normal[k]
            x = along / _EXPOSED
            left, slope = 1.0 - _ramp(x), -_ramp_slope(x) / _EXPOSED
            for e in range(6):
                rate = 0.0
                for k in range(3):
                    rate += sign * axes[k, axis] * found.normal_rate[k, e]
                    if e >= 3 and outwards < 0.0:
                        # The face itself turns with the tool.
                        one, two = (k + 1) % 3, (k + 2) % 3
                        turn = 0.0
                        if e - 3 == one:
                            turn = axes[two, axis]
                        elif e - 3 == two:
                            turn = -axes[one, axis]
                        rate += sign * turn * found.normal[k]
                found.share_rate[e] = left * found.share_rate[e] + found.share * slope * rate
            found.share *= left


@inner_kernel
def _leaves_by_covered(rows, count, i):
    """Return whether direction `i` leads out through a covered face."""
    for j in range(count):
        if rows[j].kind != COVERED:
            continue
        along = 0.0
        for k in range(3):
            along += rows[i].normal[k] * rows[j].normal[k]
        if along > 0.0 and rows[j].gap <= along * rows[i].gap * (1.0 + _GRAIN):
            return True
    return False


@inner_kernel
def _mark_open(geometry, pair, frames, rows, first, past, faces):
    """Mark by `part` which directions from row `first` on lead out; return their least separation.

    The first `faces` rows are faces, covered ones among them.
    """
    least = np.inf
    for i in range(first, past):
        found = rows[i]
        if found.kind > FACE_B and geometry.covered[pair.geom_b] != 0:
            _fade_over_covered(geometry, pair.geom_b, frames[1], 1.0, found)
        if found.kind > FACE_A and geometry.covered[pair.geom_a] != 0:
            _fade_over_covered(geometry, pair.geom_a, frames[0], -1.0, found)
        is_hidden = found.kind == COVERED or found.share == 0.0
        found.part = 0 if is_hidden or _leaves_by_covered(rows, faces, i) else 1
        if found.part == 1:
            least = min(least, found.gap)
    return least


@inner_kernel
def fill_separations(geometry, pair, frames, rough, rows):
    """Fill the directions along which geom A of a pair may leave geom B; return how many there are.

    Parameters
    ----------
    geometry : Geometry
    pair : GEOM_PAIR
    frames : (2, 3, 4) array
        Axes and centres of the two geoms, from the tool's centre of mass.
    rough : float
        How far textures rise above or fall below both surfaces at most [m].
    rows : SEPARATION records
        Filled; 0 where the two are apart even at their textures' highest points.
    """
    count = _add_faces(geometry, pair, FACE_B, frames, rows, np.int64(0))
    if geometry.kind[pair.geom_b] != PLANE:
        count = _add_faces(geometry, pair, FACE_A, frames, rows, count)
    faces = count
    least = _mark_open(geometry, pair, frames, rows, 0, faces, faces)
    if least + rough <= 0.0:
        return np.int64(0)
    # Edges and curved surfaces may have a smaller one; that of faces is a bound already.
    floor = _MARGIN * FARTHEST * (least + rough)
    if geometry.kind[pair.geom_a] == BOX and geometry.kind[pair.geom_b] == BOX:
        count = _add_edges(geometry, pair, frames, floor, rough, rows, count)
    else:
        count = _add_curved(geometry, pair, frames, floor, rough, rows, count)
    least = min(least, _mark_open(geometry, pair, frames, rows, faces, count, faces))
    if least + rough <= 0.0:
        return np.int64(0)
    kept = np.int64(0)
    for i in range(count):
        if rows[i].part == 1 and rows[i].gap - rough < _MARGIN * FARTHEST * (least + rough):
            if kept != i:
                copy_record(rows[kept], rows[i])
            kept += 1
    return kept

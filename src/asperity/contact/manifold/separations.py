"""Directions along which a convex geom of the tool can leave one of the scene.

For two convex solids the least translation that separates them is along the normal of a face of
either, along the cross product of an edge of each, or, with a curved surface, along a direction
that minimises the *separation* g(n):

    g(n) = h_B(n) + h_A(-n) - n . (c_A - c_B),

h the support functions and c the centres. g(n) is the distance that A has to move along n until a
plane normal to n separates the two. Each of these directions is a `SEPARATION`. Those with a much
larger g than the least one are ignored.

A face that is covered by another geom of the same rigid body offers no way out, so that flush geoms
act as one solid.
"""

from __future__ import annotations

import numpy as np

from asperity._core.kernels import inner_kernel
from asperity._core.records import copy_record
from asperity._core.stack import stack_array
from asperity.contact.manifold.least_separation import add_curved
from asperity.contact.manifold.separation import (
    ABOUT,
    COVERED,
    EDGES,
    FACE_A,
    FACE_B,
    FARTHEST,
    LONGEST,
    begin_separation,
    cosine,
    fill_cross_rates,
    fill_gap,
    fill_gap_rate,
    keep_if_near,
    smooth_step,
    smooth_step_slope,
    turn_with_tool,
)
from asperity.contact.manifold.support import BOX, CYLINDER, PLANE, support

_PARALLEL = 0.1
"""Sine of the angle between two edges below which their direction is ignored."""
_EXPOSED = 0.1
"""Cosine to the normal of a covered face over which a direction is blended out."""
_ROUNDING = 1e-9
"""Relative difference below which lengths count as equal."""


@inner_kernel
def face_bit(axis, sign):
    """Return the bit of a face in `Geometry.covered`."""
    return np.int64(1) << np.int64(2 * axis + (1 if sign > 0.0 else 0))


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
            begin_separation(found, pair, COVERED if covered & face_bit(axis, sign) else kind)
            for i in range(3):
                found.normal[i] = (-sign if is_a else sign) * frame[i, axis]
            if is_a:
                turn_with_tool(found)
            fill_gap(geometry, frames[0], frames[1], found)
            count += 1
    return count


@inner_kernel
def _add_edges(geometry, pair, frames, floor, rough, rows, count):
    """Add the cross products of the edges of two boxes."""
    for i in range(3):
        for j in range(3):
            for side in range(2):
                if count + 1 >= rows.size:
                    return count
                found = rows[count]
                begin_separation(found, pair, EDGES)
                sign = 1.0 if side == 1 else -1.0
                if fill_cross_rates(frames[0][:, i], frames[1][:, j], sign, _PARALLEL, found):
                    fill_gap(geometry, frames[0], frames[1], found)
                    count = keep_if_near(rows, count, floor, rough)
    return count


@inner_kernel
def _blend_out_covered(geometry, g, axes, outwards, found):
    """Blend out a direction whose support point on geom `g` is on a covered face.

    The solid continues beyond that face. `outwards` is 1 for the scene's geom, -1 for the tool's.
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
            left, slope = 1.0 - smooth_step(x), -smooth_step_slope(x) / _EXPOSED
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
def _leads_through_covered(rows, count, i):
    """Return whether direction `i` leads out through a covered face."""
    for j in range(count):
        if rows[j].kind != COVERED:
            continue
        along = cosine(rows[i], rows[j])
        if along > 0.0 and rows[j].gap <= along * rows[i].gap * (1.0 + _ROUNDING):
            return True
    return False


@inner_kernel
def _mark_open(geometry, pair, frames, rows, first, past, faces):
    """Set `part` of rows `first` to `past` to 1 where they lead out, else 0; return the least gap.

    The first `faces` rows are faces, including covered ones.
    """
    least = np.inf
    for i in range(first, past):
        found = rows[i]
        if found.kind > FACE_B and geometry.covered[pair.geom_b] != 0:
            _blend_out_covered(geometry, pair.geom_b, frames[1], 1.0, found)
        if found.kind > FACE_A and geometry.covered[pair.geom_a] != 0:
            _blend_out_covered(geometry, pair.geom_a, frames[0], -1.0, found)
        is_hidden = found.kind == COVERED or found.share == 0.0
        found.part = 0 if is_hidden or _leads_through_covered(rows, faces, i) else 1
        if found.part == 1:
            least = min(least, found.gap)
    return least


@inner_kernel
def _is_inside_a_face(geometry, pair, rows, faces):
    """Return whether A is too far from the edges of a face of B for a curved direction to count.

    At the direction n of least separation, d = p_A + p_B - g n with the support points p and the
    vector d between the centres. So the separation of a face towards which n is inclined is at most
    twice A's radius plus g.
    """
    if geometry.kind[pair.geom_b] != BOX:
        return False
    size, least = geometry.size[pair.geom_a], np.inf
    radius = size[0] + size[1] + size[2]
    for j in range(faces):
        if rows[j].kind <= FACE_B:
            least = min(least, rows[j].gap)
    near = 0
    for j in range(faces):
        if rows[j].kind <= FACE_B and rows[j].gap <= 2.0 * radius + max(least, 0.0):
            near += 1
    return near <= 1


@inner_kernel
def _is_beside_least(rows, i, least, rough, aligned):
    """Return whether a face of about the least separation represents direction `i`.

    Then that face has full weight (`response.potential`), and the direction beside it none.
    """
    for j in range(i):
        other = rows[j]
        if other.part == 0 or other.kind >= rows[i].kind or other.share < 1.0:
            continue
        is_least = other.gap <= least or other.gap - rough <= ABOUT * (least - rough)
        if is_least and cosine(other, rows[i]) >= aligned:
            return True
    return False


@inner_kernel
def _reach_over_edges(geometry, found, frames, rough):
    """Return the distance by which to extend a face beyond its edges, for bumps there [m].

    It is 0 where the other geom is within all edges that are not covered.
    """
    is_a = found.kind == FACE_A
    g, other = (found.geom_a, found.geom_b) if is_a else (found.geom_b, found.geom_a)
    kind, size = geometry.kind[g], geometry.size[g]
    if found.kind > FACE_A or rough == 0.0 or kind == PLANE:
        return 0.0
    frame, beyond = frames[0 if is_a else 1], frames[1 if is_a else 0]
    e, p, square = stack_array((3,)), stack_array((3,)), 0.0
    for axis in range(3 if kind == BOX else 2):
        along = shift = 0.0
        for i in range(3):
            e[i] = frame[i, axis]
            along += e[i] * found.normal[i]
            shift += e[i] * (beyond[i, 3] - frame[i, 3])
        if abs(along) > 0.5:
            continue
        far = support(geometry.kind[other], geometry.size[other], beyond, e, p) + rough
        square += (abs(shift) + far) ** 2
        for side in range(2 if kind == BOX else 0):
            sign = 1.0 if side == 1 else -1.0
            is_open = not geometry.covered[g] & face_bit(axis, sign)
            if is_open and sign * shift + far > size[axis]:
                return rough
    return rough if kind != BOX and square > size[0] * size[0] else 0.0


@inner_kernel
def fill_separations(geometry, pair, frames, textured, wide, rows):
    """Fill the directions along which geom A of a pair may leave geom B; return their number.

    Parameters
    ----------
    geometry : Geometry
    pair : GEOM_PAIR
    frames : (2, 3, 4) array
        Axes and centres of the two geoms, relative to the tool's centre of mass.
    textured : tuple of float
        Upper bound on the sum of both textures' |height| [m], and the least cosine between a
        direction and one that may represent it.
    wide : float
        Factor, 1 or more, on the separation up to which a direction may count.
    rows : SEPARATION records
        Filled; none where even the textures' highest points are apart.
    """
    rough, aligned = textured
    count = _add_faces(geometry, pair, FACE_B, frames, rows, np.int64(0))
    if geometry.kind[pair.geom_b] != PLANE:
        count = _add_faces(geometry, pair, FACE_A, frames, rows, count)
    faces = count
    least = _mark_open(geometry, pair, frames, rows, 0, faces, faces)
    if least + rough <= 0.0:
        return np.int64(0)
    # Edges and curved surfaces may have a smaller separation; that of faces is an upper bound.
    floor = LONGEST * FARTHEST * wide * (least + rough)
    if geometry.kind[pair.geom_a] == BOX and geometry.kind[pair.geom_b] == BOX:
        count = _add_edges(geometry, pair, frames, floor, rough, rows, count)
    elif not _is_inside_a_face(geometry, pair, rows, faces):
        count = add_curved(geometry, pair, frames, floor, rough, rows, count)
    least = min(least, _mark_open(geometry, pair, frames, rows, faces, count, faces))
    if least + rough <= 0.0:
        return np.int64(0)
    kept = np.int64(0)
    for i in range(count):
        if rows[i].kind > FACE_B and _is_beside_least(rows, i, least, rough, aligned):
            rows[i].part = 0
        if rows[i].part == 1 and rows[i].gap - rough < LONGEST * FARTHEST * wide * (least + rough):
            if kept != i:
                copy_record(rows[kept], rows[i])
            kept += 1
    rows[0].reach = _reach_over_edges(geometry, rows[0], frames, rough) if kept == 1 else 0.0
    for i in range(kept if kept > 1 else 0):  # a single way out needs no rates
        fill_gap_rate(geometry, frames[0], frames[1], rows[i])
    return kept

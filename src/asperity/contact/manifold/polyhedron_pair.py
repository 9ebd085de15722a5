"""The directions in which one convex polyhedron can leave another, and their separations.

For two convex polyhedra the least translation that separates them is along the normal of a face of
either, or along the cross product of two edges whose arcs cross on the Gauss map (Gregorius, GDC
2013). As between geoms (`separations`) each of these is a `SEPARATION` with g(n), the distance that
A has to move along n until a plane across n separates the two. All is in B's frame; rates are
derivatives by A's motion.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity._core.kernels import clear, inner_kernel
from asperity._core.records import copy_record
from asperity._core.stack import stack_array
from asperity.contact.broad_phase.facet_pairs import relative_transform
from asperity.contact.broad_phase.polyhedra import Polyhedra
from asperity.contact.manifold.separation import (
    CURVED,
    EDGES,
    FACE_A,
    FACE_B,
    FARTHEST,
    LONGEST,
    aligned_on,
    cross_product,
    fill_cross_rates,
    fill_rates_of_gap,
    fill_unit,
    fill_unit_motion,
    keep_if_near,
    smooth_step,
    smooth_step_slope,
    turn_with_tool,
)
from asperity.geometry.frames import fill_origin

_PARALLEL = 0.03
"""Sine of the angle between two edges below which their direction is ignored."""
_SHALLOW, _DEEP = 0.6, 0.9
"""Separations over a sphere's radius between which its direction is blended out."""
_ROUNDING = 1e-9
"""Relative difference below which lengths count as equal."""
_AT_END, _OFF_END = 1.0, 0.9998
"""Cosines to the normal of a face beside an edge between which a direction across the edge is
blended out (1 degree): where arcs cease to cross, the direction equals that normal."""


class PolyhedronPair(NamedTuple):
    """Two convex polyhedra in one pose."""

    shapes: Polyhedra
    first: int
    """Number of A."""
    second: int
    """Number of B."""
    transform: NDArray[np.float64]
    """A's frame in B's, (3, 4) [m]."""
    centre: NDArray[np.float64]
    """Point about which A turns, B's frame [m], (3,)."""
    rough: float
    """Upper bound on how far textures rise above or fall below both surfaces [m]."""
    wide: float
    """Factor, 1 or more, on the separation up to which a direction may count."""


@inner_kernel
def is_polyhedron_pair(table, query):
    """Return whether B of a `BodyQuery` is a convex polyhedron, and A a polyhedron or a sphere."""
    first, (a, b) = table.polyhedra.first_face, (query.first, query.second)
    is_solid = first[a] < first[a + 1] or table.polyhedra.ball[a, 3] > 0.0
    return is_solid and first[b] < first[b + 1]


@inner_kernel
def _rotate(transform, v, out):
    """Fill a vector (3,) of A's frame, rotated into B's."""
    for i in range(3):
        out[i] = transform[i, 0] * v[0] + transform[i, 1] * v[1] + transform[i, 2] * v[2]


@inner_kernel
def _support_of_b(pair, n, point_out):
    """Return B's support function along n [m]; fill its support point (3,)."""
    corners, first, far = pair.shapes.corners, pair.shapes.first_corner, -np.inf
    best = first[pair.second]
    for c in range(first[pair.second], first[pair.second + 1]):
        along = n[0] * corners[c, 0] + n[1] * corners[c, 1] + n[2] * corners[c, 2]
        if along > far:
            best, far = c, along
    for i in range(3):
        point_out[i] = corners[best, i]
    return far


@inner_kernel
def _fill_centre(pair, middle_out):
    """Fill the centre (3,) of A, a sphere [m]."""
    _rotate(pair.transform, pair.shapes.ball[pair.first], middle_out)
    for i in range(3):
        middle_out[i] += pair.transform[i, 3]


@inner_kernel
def _support_of_a(pair, n, point_out):
    """Return minus A's support function along -n [m]; fill its support point (3,)."""
    corners, first, t = pair.shapes.corners, pair.shapes.first_corner, pair.transform
    best, near, ball = first[pair.first], np.inf, pair.shapes.ball[pair.first]
    if ball[3] > 0.0:
        _fill_centre(pair, point_out)
        near = -ball[3]
        for i in range(3):
            near += n[i] * point_out[i]
            point_out[i] -= ball[3] * n[i]
        return near
    x, y, z = (
        t[0, 0] * n[0] + t[1, 0] * n[1] + t[2, 0] * n[2],
        t[0, 1] * n[0] + t[1, 1] * n[1] + t[2, 1] * n[2],
        t[0, 2] * n[0] + t[1, 2] * n[1] + t[2, 2] * n[2],
    )
    for c in range(first[pair.first], first[pair.first + 1]):
        along = x * corners[c, 0] + y * corners[c, 1] + z * corners[c, 2]
        if along < near:
            best, near = c, along
    _rotate(t, corners[best], point_out)
    for i in range(3):
        near += n[i] * t[i, 3]
        point_out[i] += t[i, 3]
    return near


@inner_kernel
def _reset(found, pair, kind):
    """Reset a separation to full share and a direction that does not turn with A."""
    found.kind, found.part, found.share, found.thinned = kind, 0, 1.0, True
    found.scale = found.gap_scale = 1.0
    found.rough = pair.rough
    clear(found.share_rate)
    for i in range(3):
        clear(found.normal_rate[i])


@inner_kernel
def _fill_gap(pair, found):
    """Fill g of a separation from its direction."""
    p = stack_array((3,))
    found.gap = _support_of_b(pair, found.normal, p) - _support_of_a(pair, found.normal, p)


@inner_kernel
def _add_faces(pair, rows):
    """Add the normals of all faces, pointing out of B; return their number."""
    shapes, count = pair.shapes, np.int64(0)
    for side in range(2):
        body = pair.second if side == 0 else pair.first
        for f in range(shapes.first_face[body], shapes.first_face[body + 1]):
            found = rows[count]
            _reset(found, pair, FACE_B if side == 0 else FACE_A)
            if side == 0:
                for i in range(3):
                    found.normal[i] = shapes.normals[f, i]
            else:
                _rotate(pair.transform, shapes.normals[f], found.normal)
                for i in range(3):
                    found.normal[i] = -found.normal[i]
                turn_with_tool(found)
            _fill_gap(pair, found)
            count += 1
    return count


@inner_kernel
def _arcs_cross(one, beside_one, two, beside_two):
    """Return whether the arcs of an edge of A and one of B cross on the Gauss map.

    `beside_one` (2, 3) are the negative face normals beside A's edge, `beside_two` (2, 3) the
    normals beside B's; `one` and `two` (3,) are the directions of the edges.
    """
    c = two[0] * beside_one[0, 0] + two[1] * beside_one[0, 1] + two[2] * beside_one[0, 2]
    d = two[0] * beside_one[1, 0] + two[1] * beside_one[1, 1] + two[2] * beside_one[1, 2]
    if c * d >= 0.0:
        return False
    a = one[0] * beside_two[0, 0] + one[1] * beside_two[0, 1] + one[2] * beside_two[0, 2]
    b = one[0] * beside_two[1, 0] + one[1] * beside_two[1, 1] + one[2] * beside_two[1, 2]
    return a * b < 0.0


@inner_kernel
def _blend_out_near(end, turns, found):
    """Blend out the direction across two edges near the normal `end` (3,) of a face beside one.

    `turns` is whether the face is A's, and turns with it.
    """
    n, along, turn, omega = found.normal, 0.0, stack_array((3,)), stack_array((3,))
    for k in range(3):
        along += n[k] * end[k]
    x = (_AT_END - along) / (_AT_END - _OFF_END)
    left, slope = smooth_step(x), -smooth_step_slope(x) / (_AT_END - _OFF_END)
    for e in range(3):
        rate = 0.0
        for k in range(3):
            rate += found.normal_rate[k, 3 + e] * end[k]
        if turns:
            fill_unit(e, omega)
            cross_product(omega, end, turn)
            for k in range(3):
                rate += n[k] * turn[k]
        found.share_rate[3 + e] = left * found.share_rate[3 + e] + found.share * slope * rate
    found.share *= left


@inner_kernel
def _add_edges(pair, edges, floor, rows, count):
    """Add the cross products of edges whose arcs cross; return the number of rows.

    `edges` (MOST_EDGES, 3, 3) is scratch memory for A's edges.
    """
    shapes, first = pair.shapes, pair.shapes.first_edge[pair.first]
    number = shapes.first_edge[pair.first + 1] - first
    for e in range(number):
        _rotate(pair.transform, shapes.along[first + e], edges[e, 0])
        for k in range(2):
            _rotate(pair.transform, shapes.beside[first + e, k], edges[e, 1 + k])
            for i in range(3):
                edges[e, 1 + k, i] = -edges[e, 1 + k, i]
    across = stack_array((3,))
    for f in range(shapes.first_edge[pair.second], shapes.first_edge[pair.second + 1]):
        two, beside = shapes.along[f], shapes.beside[f]
        for e in range(number):
            one = edges[e, 0]
            if not _arcs_cross(one, edges[e, 1:], two, beside) or count + 1 >= rows.size:
                continue
            cross_product(one, two, across)
            towards = toward_a = 0.0
            for i in range(3):
                towards += across[i] * (beside[0, i] + beside[1, i])
                toward_a += across[i] * (edges[e, 1, i] + edges[e, 2, i])
            if towards * toward_a <= 0.0:
                continue  # the arcs are on opposite hemispheres
            found = rows[count]
            _reset(found, pair, EDGES)
            if not fill_cross_rates(one, two, 1.0 if towards > 0.0 else -1.0, _PARALLEL, found):
                continue
            for k in range(2):
                _blend_out_near(beside[k], False, found)
                _blend_out_near(edges[e, 1 + k], True, found)
            if found.share > 0.0:
                _fill_gap(pair, found)
                count = keep_if_near(rows, count, floor, pair.rough)
    return count


@inner_kernel
def _distance_along(pair, place, n):
    """Return the distance of a point (3,) from B's supporting plane along n (3,) [m]."""
    p = stack_array((3,))
    far = -_support_of_b(pair, n, p)
    for i in range(3):
        far += n[i] * place[i]
    return far


@inner_kernel
def _fill_direction_to(place, start, along, n_out):
    """Fill the unit vector (3,) to `place` from a line through `start` along `along` (3,).

    `along` is 0 for a point. Returns the distance [m].
    """
    lift = size = 0.0
    for i in range(3):
        lift += along[i] * (place[i] - start[i])
    for i in range(3):
        n_out[i] = place[i] - start[i] - lift * along[i]
        size += n_out[i] * n_out[i]
    size = math.sqrt(size)
    for i in range(3):
        n_out[i] /= max(size, 1e-300)
    return size


@inner_kernel
def _add_closest(pair, floor, rows, count):
    """Add the direction to a sphere's centre from B's closest point, if on an edge or a corner.

    Of all directions from faces, edges and corners it is the one along which the centre is farthest
    from B's supporting plane. Its share falls where the sphere is deep, as between geoms.
    """
    shapes, b, found = pair.shapes, pair.second, rows[count]
    middle, n, along, arm, turn = (
        stack_array((3,)), stack_array((3,)), stack_array((3,)), stack_array((3,)),
        stack_array((3,)),
    )  # fmt: skip
    _fill_centre(pair, middle)
    _reset(found, pair, CURVED)
    far, apart = 0.0, 0.0
    for f in range(shapes.first_face[b], shapes.first_face[b + 1]):
        far = max(far, _distance_along(pair, middle, shapes.normals[f]))
    nearest, is_off = far * (1.0 + _ROUNDING) + _ROUNDING * shapes.ball[pair.first, 3], False
    clear(along)
    for c in range(shapes.first_corner[b], shapes.first_corner[b + 1]):
        size = _fill_direction_to(middle, shapes.corners[c], along, n)
        far = _distance_along(pair, middle, n)
        if far > nearest:
            nearest, apart, is_off = far, size, True
            for i in range(3):
                found.normal[i], turn[i] = n[i], 0.0
    for e in range(shapes.first_edge[b], shapes.first_edge[b + 1]):
        size = _fill_direction_to(middle, shapes.end[e], shapes.along[e], n)
        far = _distance_along(pair, middle, n)
        if far >= nearest:
            nearest, apart, is_off = far, size, True
            for i in range(3):
                found.normal[i], turn[i] = n[i], shapes.along[e, i]
    if not is_off:
        return count
    for i in range(3):
        along[i], arm[i] = turn[i], middle[i] - pair.centre[i]
    for e in range(6):
        fill_unit_motion(e, arm, turn)
        up = beside = 0.0
        for i in range(3):
            up, beside = up + found.normal[i] * turn[i], beside + along[i] * turn[i]
        for i in range(3):
            rate = turn[i] - up * found.normal[i] - beside * along[i]
            found.normal_rate[i, e] = rate / apart
        found.share_rate[e] = up
    _fill_gap(pair, found)
    radius = shapes.ball[pair.first, 3]
    x = (found.gap / radius - _SHALLOW) / (_DEEP - _SHALLOW)
    found.share = 1.0 - smooth_step(x)
    for e in range(6):  # the separation falls as the centre rises
        found.share_rate[e] *= smooth_step_slope(x) / (radius * (_DEEP - _SHALLOW))
    return keep_if_near(rows, count, floor, pair.rough) if found.share > 0.0 else count


@inner_kernel
def fill_polyhedron_separations(pair, edges, rows):
    """Fill the directions in which A may leave B; return their number.

    Parameters
    ----------
    pair : PolyhedronPair
    edges : (MOST_EDGES, 3, 3) array
        Scratch memory.
    rows : SEPARATION records
        Filled; none where even the textures' highest points are apart.
    """
    rough = pair.rough
    count, least = _add_faces(pair, rows), np.inf
    for i in range(count):
        least = min(least, rows[i].gap)
    if least + rough <= 0.0:
        return np.int64(0)
    floor = LONGEST * FARTHEST * pair.wide * (least + rough)
    if pair.shapes.ball[pair.first, 3] > 0.0:
        count = _add_closest(pair, floor, rows, count)
    else:
        count = _add_edges(pair, edges, floor, rows, count)
    for i in range(count):
        least = min(least, rows[i].gap)
    if least + rough <= 0.0:
        return np.int64(0)
    shapes, kept, p, q = pair.shapes, np.int64(0), stack_array((3,)), stack_array((3,))
    aligned = aligned_on(shapes.steepness[pair.first] + shapes.steepness[pair.second])
    for i in range(count):
        found = rows[i]
        if found.gap - rough >= LONGEST * FARTHEST * pair.wide * (least + rough):
            continue
        found.aligned = aligned
        _support_of_b(pair, found.normal, q)
        _support_of_a(pair, found.normal, p)
        for k in range(3):
            q[k] -= p[k]
            p[k] -= pair.centre[k]
        fill_rates_of_gap(found, q, p)
        if kept != i:
            copy_record(rows[kept], found)
        kept += 1
    return kept


@inner_kernel
def fill_place_of_pair(query, transform_out, centre_out):
    """Fill A's frame (3, 4) and the tool's centre (3,) in B's frame [m], of a `BodyQuery`."""
    relative_transform(query.frame_a, query.frame_b, transform_out)
    fill_origin(query.frame_b, centre_out)

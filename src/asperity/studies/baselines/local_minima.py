"""Kernels that find the pairs of triangles of two surfaces near a local minimum of distance.

A pair of nearest points p and q, |p - q| = d, is a local minimum if no direction in which the
surface goes from p leads towards q, and none from q towards p (to first order; for flat triangles
that is enough). The largest cosine between such a direction and the line is the pair's *lean*: 0 or
less at a minimum. Pairs with a small lean are kept too: with the minimum they are the region in
which the surfaces are almost equally distant (`minimum_regions`).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity._core.kernels import inner_kernel, kernel
from asperity.studies.baselines.overlap_places import cross, dot
from asperity.studies.baselines.triangle_pairs import nearest_points

STRICT = 1e-6
"""Largest lean of a local minimum [-]."""
SLACK = 0.05
"""Largest lean of a pair that is kept [-]."""
_ASIDE = np.array([1.7e-9, 2.3e-9, 1.1e-9])
"""Translation that resolves coincidences where surfaces cross [m]."""
_ON = 1e-6
"""Distance from a corner or a side to a place on it, in sizes of the triangle."""


class RigidMotion(NamedTuple):
    """A transform from one frame into another."""

    rotation: NDArray[np.float64]
    """(3, 3)"""
    translation: NDArray[np.float64]
    """(3,) [m]"""


class NearPairs(NamedTuple):
    """Room for pairs of triangles; the frame is that of the second surface."""

    triangles: NDArray[np.int64]
    """Numbers of both, (n, 2)."""
    places: NDArray[np.float64]
    """Nearest points of both, of a sphere or a capsule on its core [m], (n, 2, 3)."""
    directions: NDArray[np.float64]
    """Unit, from the second to the first, (n, 3)."""
    distances: NDArray[np.float64]
    """Between the surfaces [m], (n,); below 0 where spheres or capsules overlap."""
    strict: NDArray[np.bool_]
    """Which pairs are local minima, (n,)."""


def room_for(count: int) -> NearPairs:
    """Return room for `count` pairs."""
    return NearPairs(
        np.empty((count, 2), np.int64), np.empty((count, 2, 3)), np.empty((count, 3)),
        np.empty(count), np.empty(count, np.bool_),
    )  # fmt: skip


@inner_kernel
def _turned(rotation, v, out):
    for k in range(3):
        out[k] = rotation[k, 0] * v[0] + rotation[k, 1] * v[1] + rotation[k, 2] * v[2]


@inner_kernel
def placed_triangle(motion, triangle, out):
    """Write a triangle (3, 3), moved into the other frame, to `out`."""
    for i in range(3):
        _turned(motion.rotation, triangle[i], out[i])
        for k in range(3):
            out[i, k] += motion.translation[k]


@inner_kernel
def _angle(ax, ay, az, v):
    return math.acos(min(max(ax * v[0] + ay * v[1] + az * v[2], -1.0), 1.0))


@inner_kernel
def _divided(a, b, i, j, stack, top):
    """Push the halves of a pair of nodes on the stack; return its new height."""
    if j >= b.leaves - 1 or (i < a.leaves - 1 and a.radii[i] > b.radii[j]):
        stack[top, 0], stack[top, 1] = 2 * i + 1, j
        stack[top + 1, 0], stack[top + 1, 1] = 2 * i + 2, j
    else:
        stack[top, 0], stack[top, 1] = i, 2 * j + 1
        stack[top + 1, 0], stack[top + 1, 1] = i, 2 * j + 2
    return top + 2


@inner_kernel
def _beside(triangle, side, x):
    """Return the distance of a place in a triangle from the line through a side, in its length."""
    end = (side + 1) % 3
    ee = vv = ev = 0.0
    for k in range(3):
        e, v = triangle[end, k] - triangle[side, k], x[k] - triangle[side, k]
        ee += e * e
        vv += v * v
        ev += e * v
    # Differences of squares are exact to half of the digits only: enough for this tolerance.
    return math.sqrt(max(ee * vv - ev * ev, 0.0)) / max(ee, 1e-300)


@inner_kernel
def _lean_over(corner, x, m):
    """Return the cosine between m and the direction from x to a corner."""
    vv = mv = 0.0
    for k in range(3):
        v = corner[k] - x[k]
        vv += v * v
        mv += m[k] * v
    return mv / math.sqrt(vv) if vv > 1e-24 else 0.0


@kernel
def _lean(tree, index, x, m):
    """Return the lean at a place x (3,) of a triangle; m points to the other surface.

    It is infinite if the triangle faces away.
    """
    if tree.thick[index] > 0.0:
        return 0.0
    if dot(m, tree.normals[index]) <= STRICT:
        return math.inf
    triangle, corners = tree.triangles[index], tree.corners[index]
    one, two = -1, -1
    for k in range(3):
        if _beside(triangle, k, x) < _ON:
            one, two = corners[k], corners[(k + 1) % 3]
    for k in range(3):
        if _beside(triangle, k, x) < _ON and _beside(triangle, (k + 1) % 3, x) < _ON:
            one = two = corners[(k + 1) % 3]
    if one < 0:
        return 0.0
    worst, outwards = -1.0, np.empty(3)
    for place in range(tree.first[index] - 1, tree.first[index + 1]):
        other = index if place < tree.first[index] else tree.neighbours[place]
        has_one = has_two = False
        for k in range(3):
            has_one = has_one or tree.corners[other, k] == one
            has_two = has_two or tree.corners[other, k] == two
        if not (has_one and has_two) or tree.thick[other] > 0.0:
            continue
        there = tree.triangles[other]
        for k in range(3):
            worst = max(worst, _lean_over(there[k], x, m))
            start, end = tree.corners[other, k], tree.corners[other, (k + 1) % 3]
            touched = (start == one and end == two) or (start == two and end == one)
            touched = touched or (one == two and (start == one or end == one))
            if tree.goes_on[other, k] and touched:
                cross(there[(k + 1) % 3] - there[k], tree.normals[other], outwards)
                worst = max(worst, dot(outwards, m) / math.sqrt(dot(outwards, outwards)))
    return worst


@kernel
def _coplanar(one, other, normal, out):
    """Return whether two triangles that meet lie in one plane; then write a place to `out`."""
    for i in range(3):
        if abs(dot(one[i] - other[0], normal)) > 1e-9:
            return False
    out[0] = one[0]
    out[1] = one[0]
    return True


@kernel
def near_pairs(a, b, motion, cutoff, room, looked):
    """Find the pairs of triangles at or near a local minimum of distance; return their number.

    Parameters
    ----------
    a, b : Tree
    motion : RigidMotion
        From the frame of `a` into that of `b`.
    cutoff : float
        Largest distance that counts [m].
    room : NearPairs
        Filled as far as it goes: if the number returned is larger, call again with more room.
    looked : (2,) int64 array
        Increased by the numbers of visited pairs of nodes and of triangles.
    """
    rotation, shift = motion.rotation, motion.translation
    most, found = room.distances.size, 0
    # Two full binary trees: the stack never holds more than their heights together.
    stack = np.empty((256, 2), np.int64)
    stack[0, 0], stack[0, 1] = 0, 0
    top, slack = 1, math.asin(SLACK)
    middle, axis, n, m, x = np.empty(3), np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    one, scratch, pair = np.empty((3, 3)), np.empty((2, 3)), np.empty((2, 3))
    while top > 0:
        top -= 1
        i, j = stack[top, 0], stack[top, 1]
        if a.radii[i] < 0.0 or b.radii[j] < 0.0:
            continue
        looked[0] += 1
        _turned(rotation, a.middles[i], middle)
        _turned(rotation, a.axes[i], axis)
        dx = b.middles[j, 0] - middle[0] - shift[0]
        dy = b.middles[j, 1] - middle[1] - shift[1]
        dz = b.middles[j, 2] - middle[2] - shift[2]
        away = math.sqrt(dx * dx + dy * dy + dz * dz)
        reach = a.radii[i] + b.radii[j]
        if away - reach > cutoff:
            continue
        wide_a, wide_b = a.angles[i] + slack, b.angles[j] + slack
        if away > reach:
            turn = math.asin(reach / away) + 1e-9
            dx, dy, dz = dx / away, dy / away, dz / away
            if _angle(dx, dy, dz, axis) > wide_a + turn:
                continue
            if _angle(-dx, -dy, -dz, b.axes[j]) > wide_b + turn:
                continue
        if _angle(-axis[0], -axis[1], -axis[2], b.axes[j]) > wide_a + wide_b:
            continue
        if i < a.leaves - 1 or j < b.leaves - 1:
            top = _divided(a, b, i, j, stack, top)
            continue
        looked[1] += 1
        s, t = i - a.leaves + 1, j - b.leaves + 1
        placed_triangle(motion, a.triangles[s], one)
        core = nearest_points(one, b.triangles[t], scratch, pair)
        distance = core - a.thick[s] - b.thick[t]
        if distance > cutoff:
            continue
        lean = 0.0
        if core < 1e-12:
            n[:] = b.normals[t]
            _turned(rotation, a.normals[s], m)
            if dot(n, m) > -1.0 + SLACK or not _coplanar(one, b.triangles[t], n, pair):
                continue
        else:
            for k in range(3):
                n[k] = (pair[0, k] - pair[1, k]) / core
            lean = _lean(b, t, pair[1], n)
            if lean > SLACK:
                continue
            for k in range(3):
                x[k] = m[k] = 0.0
                for c in range(3):
                    x[k] += rotation[c, k] * (pair[0, c] - shift[c])
                    m[k] -= rotation[c, k] * n[c]
            lean = max(lean, _lean(a, s, x, m))
            if lean > SLACK:
                continue
        if found < most:
            room.triangles[found, 0], room.triangles[found, 1] = s, t
            room.places[found] = pair
            room.directions[found] = n
            room.distances[found], room.strict[found] = distance, lean <= STRICT
        found += 1
    return found


@kernel
def _apart(one, other, normal):
    """Return whether a triangle is on one side of the plane of another, whose normal is given."""
    low, high = math.inf, -math.inf
    for i in range(3):
        side = dot(one[i] - other[0], normal)
        low, high = min(low, side), max(high, side)
    return low >= -1e-12 or high <= 1e-12


@kernel
def _pierced(one, other, normal, ends):
    """Write to `ends` (2, 3) where sides of `one` pierce the other triangle; return how many do."""
    count = 0
    u, v, w = np.empty(3), np.empty(3), np.empty(3)
    for i in range(3):
        p, q = one[i], one[(i + 1) % 3]
        high, low = dot(p - other[0], normal), dot(q - other[0], normal)
        if high * low >= 0.0:
            continue
        x = p + (high / (high - low)) * (q - p)
        inside = True
        for k in range(3):
            u[:] = other[(k + 1) % 3] - other[k]
            v[:] = x - other[k]
            cross(u, v, w)
            inside = inside and dot(w, normal) >= -1e-12 * dot(u, u)
        if inside:
            ends[min(count, 1)] = x
            count += 1
    return count


@kernel
def crossing(a, b, motion, side, out):
    """Measure the line in which two surfaces cross; return its length [m].

    Parameters
    ----------
    a, b, motion
        As for `near_pairs`. Spheres and capsules are left out.
    side : float
        1 or -1: which way a is moved by some nm, so that sides that lie exactly in a triangle's
        plane cross it or do not. Surfaces that touch cross with one of the two.
    out : (2, 3) array
        Filled: the middle of the line, and the mean of b's normals minus a's along it, b's frame.
    """
    stack = np.empty((256, 2), np.int64)
    stack[0, 0], stack[0, 1] = 0, 0
    top, total = 1, 0.0
    middle, axis = np.empty(3), np.empty(3)
    moved = RigidMotion(motion.rotation, motion.translation + side * _ASIDE)
    one, ends, more = np.empty((3, 3)), np.empty((2, 3)), np.empty((2, 3))
    out[:] = 0.0
    while top > 0:
        top -= 1
        i, j = stack[top, 0], stack[top, 1]
        if a.radii[i] < 0.0 or b.radii[j] < 0.0:
            continue
        _turned(motion.rotation, a.middles[i], middle)
        away, reach = 0.0, a.radii[i] + b.radii[j]
        for k in range(3):
            away += (b.middles[j, k] - middle[k] - motion.translation[k]) ** 2
        if away > reach * reach:
            continue
        if i < a.leaves - 1 or j < b.leaves - 1:
            top = _divided(a, b, i, j, stack, top)
            continue
        s, t = i - a.leaves + 1, j - b.leaves + 1
        if a.thick[s] > 0.0 or b.thick[t] > 0.0:
            continue
        placed_triangle(moved, a.triangles[s], one)
        _turned(motion.rotation, a.normals[s], axis)
        # Most triangles are on one side of each other's plane.
        if _apart(one, b.triangles[t], b.normals[t]) or _apart(b.triangles[t], one, axis):
            continue
        count = _pierced(one, b.triangles[t], b.normals[t], ends)
        if count < 2:
            found = _pierced(b.triangles[t], one, axis, more)
            if count == 0:
                ends[:] = more
            elif found > 0:
                ends[1] = more[0]
            count += found
        if count < 2:
            continue
        v = ends[1] - ends[0]
        size = math.sqrt(dot(v, v))
        total += size
        for k in range(3):
            out[0, k] += 0.5 * size * (ends[0, k] + ends[1, k])
            out[1, k] += size * (b.normals[t, k] - axis[k])
    if total > 0.0:
        out /= total
    return total

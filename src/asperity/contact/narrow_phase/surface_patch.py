r"""Parts of a textured body's surface, as seen along the direction of contact.

The contact frame has its origin near the contact and axes (u, v, z), z pointing out of the body
under consideration: along n for the scene B, along -n for the tool A. Every convex geom is seen
along z as one to three *charts* (a box shows up to three faces), and all of them have one form:

    base(a) = O + P a + C sqrt(1 - a^T E a) z        a = (x, y)  [m]
    w(a)    = V0 + V1 x + V2 y + V3 sqrt(...)        outward normal, not always of unit length

Planes have C = 0; the side of a cylinder has E of rank one and a the place (along, across);
an ellipsoid has E of rank two and a the lateral offset from its centre. So the base is a height
over (u, v) in closed form, and the lateral map is affine: `P` above has a part Q in (u, v).
The textured surface is `p(a) = base(a) + t(a) w(a) / |w(a)|`.

A chart ends at the sides of a rectangle and where one of its rows is positive,

    row: k0 + k1 x + k2 y + k3 sqrt(...) + k4 (x^2 + y^2) <= 0,

each of them either an edge of the body or the artificial border of the chart. Facets that are
seen at less than 0.2 (the cosine between their normal and z) belong to no chart.

A chart is one row of numbers, so that kernels make them every tick without allocating.
"""

from __future__ import annotations

import math

import numpy as np

from asperity._core.kernels import clear, inner_kernel
from asperity._core.stack import stack_array

FLATTEST = 0.2
"""Facets whose normal has less than this along z are not seen."""
MAX_ROWS = 10

# Where each number of a chart stands.
O, Q, PZ, C, E = 0, 3, 7, 9, 10  # noqa: E741  (3, 2 x 2, 2, 1, 3: E11, E12, E22)
V0, V1, V2, V3 = 13, 16, 19, 22
UNIT = 25  # 1: w is of unit length as it stands
TEXTURE, MAPPING = 26, 27  # which one, -1 none; 0 planar, 1 cylindrical, 2 triplanar
B0, B1, B2, B3 = 28, 31, 34, 37  # the base point in the texture's frame, in the same form
W0, W1, W2, W3 = 40, 43, 46, 49  # the normal in the body's frame, in the same form
ROUND = 52  # cylindrical: radius, u at y = 0, sense of y, v at x = 0, root's part of v, stretch
# Of a triplanar map its first two are where each of the three maps begins.
RECTANGLE, RECTANGLE_HARD = 58, 62  # x0, x1, y0, y1
ROWS = 63  # how many; then (k0 .. k4, hard) each
LEAST_ROOT = ROWS + 1 + 6 * MAX_ROWS
QINV = LEAST_ROOT + 1
Q_LEAST, Q_MOST = QINV + 4, QINV + 5  # singular values of Q
E_LEAST, E_MOST = QINV + 6, QINV + 7  # eigenvalues of E
EQ = QINV + 8  # Q^-T E Q^-1: 11, 12, 22
EQ_LEAST = EQ + 3
LEVEL = EQ + 4  # 1: a plane facing z exactly, whose points do not shift sideways
STRETCH = EQ + 5  # ratio of the largest to the smallest semi-axis
UV_LEAST, UV_MOST = EQ + 6, EQ + 7  # singular values of the map from a to the texture, no root
UV_ROOT = EQ + 8  # what the root adds
BEND_1, BEND_2 = EQ + 9, EQ + 10  # of a plane chart: sizes of w' and w''
TOP = EQ + 11  # highest point of the texture, infinite where only the whole texture's is known
SIDE = EQ + 12  # largest sideways part of w
SUMMIT = EQ + 13  # largest z of the base, infinite where it is not known
COVERS = EQ + 14  # of a facet: least and largest u, least and largest v of its base
CORNERS = EQ + 18  # of a facet within rows: how many corners, then their (x, y), 8 at most
LEAST_W, RISE = EQ + 35, EQ + 36  # of a facet: least length of w as it stands; largest z of w
SIZE = EQ + 37

PLANAR, CYLINDRICAL, TRIPLANAR = 0.0, 1.0, 2.0


@inner_kernel
def singular(a, b, c, d):
    """Return the smallest and the largest singular value of [[a, b], [c, d]]."""
    s = 0.5 * (a * a + b * b + c * c + d * d)
    p = 0.5 * (a * a + b * b - c * c - d * d)
    r = math.sqrt(p * p + (a * c + b * d) ** 2)
    return math.sqrt(max(s - r, 0.0)), math.sqrt(s + r)


@inner_kernel
def _finish(chart, frame, body, mapping, origin):
    """Fill what follows from a chart's geometry: inverse, extreme values, the texture's map.

    `frame` (3, 3) has the axes u, v, z in its rows; `body` (3, 4) is the rotation of the body and,
    in its last column, its position seen from the contact frame's origin, both in world axes;
    `origin` (3,) is where the texture's (u, v) are zero, in the body's frame.
    """
    a, b, c, d = chart[Q], chart[Q + 1], chart[Q + 2], chart[Q + 3]
    det = a * d - b * c
    chart[QINV], chart[QINV + 1] = d / det, -b / det
    chart[QINV + 2], chart[QINV + 3] = -c / det, a / det
    chart[Q_LEAST], chart[Q_MOST] = singular(a, b, c, d)
    e11, e12, e22 = chart[E], chart[E + 1], chart[E + 2]
    half, gap = 0.5 * (e11 + e22), 0.5 * (e11 - e22)
    root = math.sqrt(gap * gap + e12 * e12)
    chart[E_LEAST], chart[E_MOST] = max(half - root, 0.0), half + root
    i, j, k, m = chart[QINV], chart[QINV + 1], chart[QINV + 2], chart[QINV + 3]
    q11 = i * (e11 * i + e12 * k) + k * (e12 * i + e22 * k)
    q12 = i * (e11 * j + e12 * m) + k * (e12 * j + e22 * m)
    q22 = j * (e11 * j + e12 * m) + m * (e12 * j + e22 * m)
    chart[EQ], chart[EQ + 1], chart[EQ + 2] = q11, q12, q22
    half, gap = 0.5 * (q11 + q22), 0.5 * (q11 - q22)
    chart[EQ_LEAST] = max(half - math.sqrt(gap * gap + q12 * q12), 0.0)
    flat = chart[C] == 0.0
    level = flat and abs(chart[V0]) < 1e-12 and abs(chart[V0 + 1]) < 1e-12 and chart[UNIT] == 1.0
    chart[LEVEL] = 1.0 if level else 0.0
    chart[MAPPING] = mapping
    chart[TOP], chart[SIDE], chart[SUMMIT] = np.inf, 1.0, np.inf
    chart[LEAST_W], chart[RISE] = 1.0, 1.0
    if flat:
        chart[SIDE] = math.hypot(chart[V0], chart[V0 + 1])
    if chart[TEXTURE] < 0.0:
        return
    for axis in range(3):
        # Rows of `turn` take a vector of the contact frame into the body's.
        turn_u = turn_v = turn_z = away = 0.0
        for world in range(3):
            turn_u += body[world, axis] * frame[0, world]
            turn_v += body[world, axis] * frame[1, world]
            turn_z += body[world, axis] * frame[2, world]
            away += body[world, axis] * body[world, 3]
        chart[B0 + axis] = turn_u * chart[O] + turn_v * chart[O + 1] + turn_z * chart[O + 2]
        chart[B0 + axis] -= away
        if mapping == PLANAR:
            chart[B0 + axis] -= origin[axis]
        chart[B1 + axis] = turn_u * chart[Q] + turn_v * chart[Q + 2] + turn_z * chart[PZ]
        chart[B2 + axis] = turn_u * chart[Q + 1] + turn_v * chart[Q + 3] + turn_z * chart[PZ + 1]
        chart[B3 + axis] = turn_z * chart[C]
        for v, w in ((V0, W0), (V1, W1), (V2, W2), (V3, W3)):
            chart[w + axis] = turn_u * chart[v] + turn_v * chart[v + 1] + turn_z * chart[v + 2]
    if mapping == PLANAR:
        least, most = singular(chart[B1], chart[B2], chart[B1 + 1], chart[B2 + 1])
        chart[UV_ROOT] = math.hypot(chart[B3], chart[B3 + 1])
    elif mapping == TRIPLANAR:
        chart[ROUND], chart[ROUND + 1] = origin[0], origin[1]
        b1 = math.sqrt(chart[B1] ** 2 + chart[B1 + 1] ** 2 + chart[B1 + 2] ** 2)
        b2 = math.sqrt(chart[B2] ** 2 + chart[B2 + 1] ** 2 + chart[B2 + 2] ** 2)
        least, most = 0.0, math.sqrt(b1 * b1 + b2 * b2)
        if flat:  # the axes of a plane chart are perpendicular and of unit length
            most = max(b1, b2)
        chart[UV_ROOT] = abs(chart[C])
    else:
        least, most = 0.0, max(1.0, chart[ROUND + 5])
        chart[UV_ROOT] = abs(chart[ROUND + 4])
    chart[UV_LEAST], chart[UV_MOST] = least, most


@inner_kernel
def _rectangle(chart, x0, x1, y0, y1, hard):
    chart[RECTANGLE], chart[RECTANGLE + 1] = x0, x1
    chart[RECTANGLE + 2], chart[RECTANGLE + 3] = y0, y1
    chart[RECTANGLE_HARD] = hard


@inner_kernel
def _row(chart, k0, k1, k2, k3, k4, hard):
    """Add a row to the borders of a chart."""
    at = ROWS + 1 + 6 * int(chart[ROWS])
    chart[at], chart[at + 1], chart[at + 2] = k0, k1, k2
    chart[at + 3], chart[at + 4], chart[at + 5] = k3, k4, hard
    chart[ROWS] += 1.0


@inner_kernel
def _plane(chart, centre, x, y, f, half_x, half_y, hard):
    """Fill a flat part: centre and axes in the contact frame, normal `f`."""
    clear(chart)
    for i in range(3):
        chart[O + i] = centre[i]
        chart[V0 + i] = f[i]
    chart[Q], chart[Q + 1], chart[Q + 2], chart[Q + 3] = x[0], y[0], x[1], y[1]
    chart[PZ], chart[PZ + 1] = x[2], y[2]
    chart[UNIT], chart[STRETCH] = 1.0, 1.0
    chart[LEAST_ROOT] = 0.5
    _rectangle(chart, -half_x, half_x, -half_y, half_y, hard)


@inner_kernel
def _ellipsoid(chart, centre, axes, semi):
    """Fill the upper half of an ellipsoid; `axes` (3, 3) has its axes in columns.

    With `A = axes diag(semi^2) axes^T` its surface is `x^T A^-1 x = 1` round the centre.
    """
    clear(chart)
    a = stack_array((3, 3))
    inverse = stack_array((3, 3))
    for i in range(3):
        for j in range(3):
            total = reverse = 0.0
            for k in range(3):
                total += axes[i, k] * axes[j, k] * semi[k] * semi[k]
                reverse += axes[i, k] * axes[j, k] / (semi[k] * semi[k])
            a[i, j], inverse[i, j] = total, reverse
    det = a[0, 0] * a[1, 1] - a[0, 1] * a[0, 1]
    e11, e12, e22 = a[1, 1] / det, -a[0, 1] / det, a[0, 0] / det
    g1, g2 = e11 * a[0, 2] + e12 * a[1, 2], e12 * a[0, 2] + e22 * a[1, 2]
    cap = math.sqrt(max(a[2, 2] - g1 * a[0, 2] - g2 * a[1, 2], 0.0))
    chart[E], chart[E + 1], chart[E + 2] = e11, e12, e22
    chart[PZ], chart[PZ + 1], chart[C] = g1, g2, cap
    chart[Q], chart[Q + 3] = 1.0, 1.0
    least, most = min(semi[0], semi[1], semi[2]), max(semi[0], semi[1], semi[2])
    for i in range(3):
        chart[O + i] = centre[i]
        # The gradient of x^T A^-1 x, times a length that makes it unit length on a sphere.
        chart[V1 + i] = most * (inverse[i, 0] + inverse[i, 2] * g1)
        chart[V2 + i] = most * (inverse[i, 1] + inverse[i, 2] * g2)
        chart[V3 + i] = most * inverse[i, 2] * cap
    chart[UNIT] = 1.0 if most - least <= 1e-12 * most else 0.0
    chart[STRETCH] = most / least
    chart[LEAST_ROOT] = FLATTEST
    reach = math.sqrt(1.0 - FLATTEST * FLATTEST)
    half_u, half_v = reach * math.sqrt(a[0, 0]), reach * math.sqrt(a[1, 1])
    _rectangle(chart, -half_u, half_u, -half_v, half_v, 0.0)


@inner_kernel
def _side(chart, centre, k, radius, half, hard, ref_x, ref_y):
    """Fill the side of a cylinder or capsule round `k`; `ref_x`, `ref_y` fix its angle."""
    cosine = math.sqrt(max(1.0 - k[2] * k[2], 0.0))
    if cosine <= FLATTEST:
        return False
    clear(chart)
    e_r = (-k[2] * k[0] / cosine, -k[2] * k[1] / cosine, cosine)
    e_y = (-k[1] / cosine, k[0] / cosine, 0.0)  # perpendicular to both, and level
    lean = radius * k[2] / cosine
    for i in range(3):
        chart[O + i] = centre[i]
        chart[V2 + i], chart[V3 + i] = e_y[i] / radius, e_r[i]
    chart[Q], chart[Q + 1], chart[Q + 2], chart[Q + 3] = k[0], e_y[0], k[1], e_y[1]
    chart[PZ] = k[2]
    chart[C] = radius / cosine
    chart[E + 2] = 1.0 / (radius * radius)
    chart[UNIT], chart[STRETCH] = 1.0, 1.0
    chart[LEAST_ROOT] = FLATTEST / cosine
    reach = radius * math.sqrt(max(1.0 - chart[LEAST_ROOT] ** 2, 0.0))
    _rectangle(chart, -half - abs(lean), half + abs(lean), -reach, reach, 0.0)
    _row(chart, -half, 1.0, 0.0, lean, 0.0, hard)
    _row(chart, -half, -1.0, 0.0, -lean, 0.0, hard)
    # The angle of e_r round the axis, where y = 0, and the sense in which it grows with y.
    along_x = e_r[0] * ref_x[0] + e_r[1] * ref_x[1] + e_r[2] * ref_x[2]
    along_y = e_r[0] * ref_y[0] + e_r[1] * ref_y[1] + e_r[2] * ref_y[2]
    turned_x = e_y[0] * ref_x[0] + e_y[1] * ref_x[1]
    turned_y = e_y[0] * ref_y[0] + e_y[1] * ref_y[1]
    chart[ROUND], chart[ROUND + 1] = radius, radius * math.atan2(along_y, along_x)
    chart[ROUND + 2] = 1.0 if along_x * turned_y - along_y * turned_x > 0.0 else -1.0
    chart[ROUND + 4] = lean
    return True


@inner_kernel
def charts_of(
    kind, size, place, axes, frame, body, texture, mapping, origin, around, charts_out, first
):
    """Fill the charts of one geom into `charts_out[first:]`; return how many there are then.

    Parameters
    ----------
    kind : int
        Index into `asperity.geometry.bodies.KINDS`.
    size, place : (3,) arrays
        MuJoCo's sizes; the centre in the contact frame [m].
    axes : (3, 3) array
        The geom's axes in the contact frame, in columns.
    frame, body, texture, mapping, origin
        As for `_finish`.
    around : float
        By how much a cylindrical map is stretched to go round a whole number of times.
    """
    x, y, z = axes[:, 0], axes[:, 1], axes[:, 2]
    at = first
    if kind == 0 and z[2] >= FLATTEST:
        half_x = size[0] if size[0] > 0.0 else 1e3
        half_y = size[1] if size[1] > 0.0 else 1e3
        _plane(charts_out[at], place, x, y, z, half_x, half_y, 1.0)
        charts_out[at, TEXTURE] = texture
        at += 1
    elif kind == 1 or kind == 3:
        semi = (size[0], size[0], size[0]) if kind == 1 else (size[0], size[1], size[2])
        _ellipsoid(charts_out[at], place, axes, semi)
        charts_out[at, TEXTURE] = texture
        at += 1
    elif kind == 2 or kind == 4:
        # A cylindrical map covers the side alone.
        on_ends = -1 if mapping == CYLINDRICAL else texture
        # A capsule's ends join smoothly, but for a map that covers the side alone.
        hard = 1.0 if kind == 4 or (mapping == CYLINDRICAL and texture >= 0) else 0.0
        if _side(charts_out[at], place, z, size[0], size[1], hard, x, y):
            charts_out[at, ROUND + 1] = charts_out[at, ROUND + 1] * around - origin[0]
            charts_out[at, ROUND + 3] -= origin[1]
            charts_out[at, ROUND + 5] = around
            charts_out[at, TEXTURE] = texture
            at += 1
        for end in (-1.0, 1.0):
            centre = stack_array((3,))
            for i in range(3):
                centre[i] = place[i] + end * size[1] * z[i]
            if kind == 4 and end * z[2] >= FLATTEST:
                f = stack_array((3,))
                for i in range(3):
                    f[i] = end * z[i]
                _plane(charts_out[at], centre, x, y, f, size[0], size[0], 0.0)
                _row(charts_out[at], -0.5 * size[0], 0.0, 0.0, 0.0, 0.5 / size[0], 1.0)
                charts_out[at, TEXTURE] = on_ends
                at += 1
            elif kind == 2:
                _ellipsoid(charts_out[at], centre, axes, (size[0], size[0], size[0]))
                _row(
                    charts_out[at], 0.0, -end * z[0], -end * z[1], -end * z[2] * size[0], 0.0, hard
                )
                charts_out[at, TEXTURE] = on_ends
                at += 1
    elif kind == 5:
        for axis in range(3):
            up = axes[2, axis]
            if abs(up) >= FLATTEST:
                sign = 1.0 if up > 0.0 else -1.0
                f, centre = stack_array((3,)), stack_array((3,))
                for i in range(3):
                    f[i] = sign * axes[i, axis]
                    centre[i] = place[i] + size[axis] * f[i]
                one, two = (axis + 1) % 3, (axis + 2) % 3
                _plane(
                    charts_out[at], centre, axes[:, one], axes[:, two], f, size[one], size[two], 1.0
                )
                charts_out[at, TEXTURE] = texture
                at += 1
    for i in range(first, at):
        _finish(charts_out[i], frame, body, mapping, origin)
    return at

"""One direction along which a geom of the tool may leave one of the scene, and its derivatives.

Rates are derivatives by the tool's translation [m] and by its rotation about its centre of mass,
world axes.
"""

from __future__ import annotations

from asperity._core.kernels import clear, inner_kernel, small_kernel
from asperity._core.stack import stack_array
from asperity.contact.manifold.support import support

COVERED, FACE_B, FACE_A, EDGES, CURVED = -1, 0, 1, 2, 3
"""What a direction is normal to. It is smoothed out beside one of a lower number."""
MAX_PARTS = 12
"""Room for parts of one contact."""
APART, ALONG = 0.961, 0.990
"""Cosines between two directions between which one stands for both (16 and 8 degrees)."""
FARTHEST = 2.0
"""Multiple of the least way out from which on a separation g does not count."""
LONGEST = 1.3
"""The least way out, smoothed, is at most this multiple of the least one, or hardly ever more."""
ABOUT = 1.2
"""A separation up to this multiple of the least depth counts fully."""
_SAME = 1e-13
"""Two directions are the same if the cosine between them is at least 1 less this."""


@inner_kernel
def cosine(one, other):
    """Return the cosine of the angle between the normals of two records."""
    n, m = one.normal, other.normal
    return n[0] * m[0] + n[1] * m[1] + n[2] * m[2]


@inner_kernel
def is_same_way(rows, count, i, found):
    """Return whether row `i` of `count` is the only one of its part, and has found's direction."""
    part = rows[i].part
    alone = (i == 0 or rows[i - 1].part != part) and (i + 1 == count or rows[i + 1].part != part)
    return alone and rows[i].kind == found.kind and cosine(rows[i], found) >= 1.0 - _SAME


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
def cross_product(a, b, out):
    """Fill the cross product of two vectors (3,)."""
    out[0] = a[1] * b[2] - a[2] * b[1]
    out[1] = a[2] * b[0] - a[0] * b[2]
    out[2] = a[0] * b[1] - a[1] * b[0]


@inner_kernel
def fill_unit(k, out):
    """Fill the unit vector (3,) along axis `k`."""
    clear(out)
    out[k] = 1.0


@inner_kernel
def fill_gap(geometry, frame_a, frame_b, found):
    """Fill g of a separation whose direction is known."""
    a, b, n, p = found.geom_a, found.geom_b, found.normal, stack_array((3,))
    gap = support(geometry.kind[a], geometry.size[a], frame_a, n, p)
    gap += support(geometry.kind[b], geometry.size[b], frame_b, n, p)
    for i in range(3):
        gap -= n[i] * (frame_a[i, 3] - frame_b[i, 3])
    found.gap = gap


@inner_kernel
def fill_gap_rate(geometry, frame_a, frame_b, found):
    """Fill the rates of g from the direction of a separation and the direction's rates."""
    a, b, n = found.geom_a, found.geom_b, found.normal
    p, q, turn, omega = stack_array((3,)), stack_array((3,)), stack_array((3,)), stack_array((3,))
    support(geometry.kind[a], geometry.size[a], frame_a, n, p)
    support(geometry.kind[b], geometry.size[b], frame_b, n, q)
    for i in range(3):
        q[i] += p[i] - frame_a[i, 3] + frame_b[i, 3]
        # The point of A that counts is opposite to p, and turns with A.
        p[i] -= frame_a[i, 3]
    for e in range(6):
        rate = 0.0
        for i in range(3):
            rate += found.normal_rate[i, e] * q[i]
        if e < 3:
            rate -= n[e]
        else:
            fill_unit(e - 3, omega)
            cross_product(omega, p, turn)
            for i in range(3):
                rate += n[i] * turn[i]
        found.gap_rate[e] = rate


@inner_kernel
def begin_separation(found, pair, kind):
    """Set a separation to one that does not turn with the tool."""
    found.geom_a, found.geom_b, found.kind = pair.geom_a, pair.geom_b, kind
    found.share = 1.0
    clear(found.share_rate)
    for i in range(3):
        clear(found.normal_rate[i])


@inner_kernel
def turn_with_tool(found):
    """Let the direction of a separation turn with the tool."""
    turn, omega = stack_array((3,)), stack_array((3,))
    for e in range(3):
        fill_unit(e, omega)
        cross_product(omega, found.normal, turn)
        for i in range(3):
            found.normal_rate[i, 3 + e] = turn[i]


@inner_kernel
def keep_if_near(rows, count, floor, rough):
    """Keep the row after the last if its separation may count; return how many there are."""
    if count + 1 < rows.size and rows[count].gap - rough < floor:
        return count + 1
    return count


@small_kernel
def smooth_step(x):
    """Return a smooth step from 0 at 0 to 1 at 1."""
    x = min(max(x, 0.0), 1.0)
    return x * x * (3.0 - 2.0 * x)


@small_kernel
def smooth_step_slope(x):
    """Return the derivative of `smooth_step`."""
    x = min(max(x, 0.0), 1.0)
    return 6.0 * x * (1.0 - x)

"""A direction along which a geom of the tool may leave one of the scene, and its derivatives.

Rates are derivatives by the tool's translation [m] and by its rotation about its centre of mass,
world axes. A direction's share is a blending weight between 0 and 1.
"""

from __future__ import annotations

import math

from asperity._core.kernels import clear, inner_kernel, small_kernel
from asperity._core.stack import stack_array
from asperity.contact.manifold.support import support

COVERED, FACE_B, FACE_A, EDGES, CURVED = -1, 0, 1, 2, 3
"""Kinds of directions. One is blended out beside another of a lower kind."""
MAX_PARTS = 12
"""Maximum number of parts of one contact."""
APART, ALONG = 0.961, 0.990
"""Cosines between two directions over which the higher kind is blended out (16 and 8 degrees)."""
FARTHEST = 2.0
"""Multiple of the least way out from which on a separation g has no weight."""
LONGEST = 1.3
"""Practical upper bound on the smooth minimum of the ways out over the least one."""
ABOUT = 1.2
"""Multiple of the least depth up to which a separation has full weight."""
_SAME = 1e-13
"""Two directions are equal if the cosine between them is at least 1 minus this."""


@inner_kernel
def cosine(one, other):
    """Return the cosine of the angle between the normals of two records."""
    n, m = one.normal, other.normal
    return n[0] * m[0] + n[1] * m[1] + n[2] * m[2]


@inner_kernel
def is_same_way(rows, count, i, found):
    """Return whether row `i` of `count` is the only one of its part, with `found`'s direction."""
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
def fill_unit_motion(e, arm, moved_out):
    """Fill the derivative (3,) of a point's position by the tool's coordinate `e`.

    The first three are translations, the others rotations about the point from which `arm` (3,)
    leads to it.
    """
    omega = stack_array((3,))
    fill_unit(e % 3, omega)
    if e < 3:
        for i in range(3):
            moved_out[i] = omega[i]
    else:
        cross_product(omega, arm, moved_out)


@inner_kernel
def fill_gap(geometry, frame_a, frame_b, found):
    """Fill g of a separation from its direction."""
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
    p, q = stack_array((3,)), stack_array((3,))
    support(geometry.kind[a], geometry.size[a], frame_a, n, p)
    support(geometry.kind[b], geometry.size[b], frame_b, n, q)
    for i in range(3):
        q[i] += p[i] - frame_a[i, 3] + frame_b[i, 3]
        # A's support point along -n is opposite to p, and turns with A.
        p[i] = frame_a[i, 3] - p[i]
    fill_rates_of_gap(found, q, p)


@inner_kernel
def fill_rates_of_gap(found, between, arm):
    """Fill the rates of g from the direction of a separation and the direction's rates.

    `between` (3,) leads from A's support point to B's, `arm` (3,) to A's from the point about which
    A turns [m].
    """
    n, moved = found.normal, stack_array((3,))
    for e in range(6):
        rate = 0.0
        for i in range(3):
            rate += found.normal_rate[i, e] * between[i]
        fill_unit_motion(e, arm, moved)
        for i in range(3):
            rate -= n[i] * moved[i]
        found.gap_rate[e] = rate


@inner_kernel
def fill_cross_rates(one, two, sign, parallel, found):
    """Fill the unit cross product of edges along `one` of A and `two` of B, and its rates.

    Its share falls from 1 to 0 as the sine of the angle between the edges falls from three times
    `parallel` to `parallel`. `sign` is that of the product. Returns whether the share is positive.
    """
    n, across, omega, turn = (
        found.normal, stack_array((3,)), stack_array((3,)), stack_array((3,)),
    )  # fmt: skip
    cross_product(one, two, across)
    sine = math.sqrt(across[0] * across[0] + across[1] * across[1] + across[2] * across[2])
    if sine <= parallel:
        return False
    for k in range(3):
        n[k] = sign * across[k] / sine
    found.share = smooth_step(0.5 * (sine / parallel - 1.0))
    slope = 0.5 / parallel * smooth_step_slope(0.5 * (sine / parallel - 1.0))
    for e in range(3):
        fill_unit(e, omega)
        cross_product(omega, one, turn)
        cross_product(turn, two, across)
        along = 0.0
        for k in range(3):
            along += sign * across[k] * n[k]
        for k in range(3):
            found.normal_rate[k, 3 + e] = (sign * across[k] - along * n[k]) / sine
        found.share_rate[3 + e] = slope * along
    return True


@small_kernel
def aligned_on(steep):
    """Return the cosine between two directions above which their depths are about equal.

    On slopes of up to m, `steep`, they differ by less than a sixth while the tangent of the angle
    between the directions is below 1 / (6 m).
    """
    return max(ALONG, 6.0 * steep / math.sqrt(1.0 + 36.0 * steep * steep))


@inner_kernel
def begin_separation(found, pair, kind):
    """Reset a separation to full share and a direction that does not turn with the tool."""
    found.geom_a, found.geom_b, found.kind = pair.geom_a, pair.geom_b, kind
    found.share, found.thinned = 1.0, False
    clear(found.share_rate)
    for i in range(3):
        clear(found.normal_rate[i])


@inner_kernel
def turn_with_tool(found):
    """Set the rates of a direction that turns with the tool."""
    turn, omega = stack_array((3,)), stack_array((3,))
    for e in range(3):
        fill_unit(e, omega)
        cross_product(omega, found.normal, turn)
        for i in range(3):
            found.normal_rate[i, 3 + e] = turn[i]


@inner_kernel
def keep_if_near(rows, count, floor, rough):
    """Keep row `count` if its separation is small enough to count; return the number of rows."""
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


@inner_kernel
def is_beside_simpler(rows, first, i):
    """Return whether a row from `first` on, of a simpler kind, may take weight from row `i`."""
    found = False
    for k in range(first, i):
        found = found or (rows[k].kind < rows[i].kind and cosine(rows[k], rows[i]) > APART)
    return found


@inner_kernel
def is_stood_for(rows, first, i, least):
    """Return whether another direction that has been searched represents row `i` of a part.

    It has full weight (`response.potential`), and the direction beside it none.
    """
    found = rows[i]
    for j in range(first, i):
        other = rows[j]
        is_near = other.gap - other.rough <= ABOUT * least
        is_deep = other.kind < found.kind and other.depth > 0.0
        stands = is_deep and is_near and cosine(other, found) >= found.aligned
        if stands and not is_beside_simpler(rows, first, j):
            return True
    return False

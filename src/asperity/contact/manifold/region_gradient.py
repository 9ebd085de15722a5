"""Derivatives of integrals over the overlap region by the tool's motion.

The integral of q w over a piece, w = d + reach, changes with d at each point of B's facet, and with
the sides of A, which move over the facet (Reynolds' transport theorem). Sides where w is 0
contribute nothing, B's sides do not move, and the contributions of sides between two facets of A
cancel. q is a quadratic polynomial, which covers all moments of a region: the derivatives of a
quantity by all moments, collected in one q, give its derivative by the tool's six coordinates in a
single pass over the pieces.
"""

from __future__ import annotations

import math

from asperity._core.kernels import inner_kernel
from asperity._core.stack import stack_array
from asperity.contact.broad_phase.facet_bvh import DIRECTIONS
from asperity.contact.manifold.overlap_region import DEEP, OF_A

_IN, _OUT = 0.445948490915965, 0.091576213509771
_IN_WEIGHT, _OUT_WEIGHT = 0.223381589678011, 0.109951743655322
"""Nodes and weights of the quadrature rule of degree 4 on a triangle (Strang & Fix 1973)."""
_GAUSS = 0.3872983346207417
"""Half of sqrt(3/5): node of the Gauss rule of degree 5 on an interval."""


@inner_kernel
def fill_polynomial(table, g, i, directions, region, q_out):
    """Fill q (6,) of pair `i` over the plane of facet `g`: coefficients of 1, x, y, xx, xy, yy.

    It collects `region.rates` and the rates of all directions by their moments.
    """
    for k in range(6):
        q_out[k] = 0.0
    q_out[0] = region.rates[i]
    for d in range(DIRECTIONS):
        found = directions[d]
        # Directions of two convex bodies have the moments of the whole region.
        share = 1.0 if found.own_volume > 0.0 else table.shares[g, d]
        if share != 0.0 and found.patches != 0:
            add_moment_rates(table, g, share, found, q_out)


@inner_kernel
def add_moment_rates(table, g, share, found, q_io):
    """Add to q (6,) the rates of a direction by the moments of its region, `share` times."""
    o, x, y = table.origin[g], table.axes[g, 0], table.axes[g, 1]
    q_io[0] += share * found.volume_rate
    at = 0
    for a in range(3):
        first = share * found.first_rate[a]
        q_io[0] += first * o[a]
        q_io[1] += first * x[a]
        q_io[2] += first * y[a]
        for b in range(a, 3):
            second = share * found.second_rate[at]
            at += 1
            q_io[0] += second * o[a] * o[b]
            q_io[1] += second * (o[a] * x[b] + x[a] * o[b])
            q_io[2] += second * (o[a] * y[b] + y[a] * o[b])
            q_io[3] += second * x[a] * x[b]
            q_io[4] += second * (x[a] * y[b] + y[a] * x[b])
            q_io[5] += second * y[a] * y[b]


@inner_kernel
def _value(q, x, y):
    """Return the polynomial q (6,) at (x, y)."""
    return q[0] + x * (q[1] + q[3] * x + q[4] * y) + y * (q[2] + q[5] * y)


@inner_kernel
def _fill_moment(table, g, sums, centre, out):
    """Fill the integral of q (p - centre), (3,), from those of q, q x, q y and q d."""
    o, x, y, z = table.origin[g], table.axes[g, 0], table.axes[g, 1], table.axes[g, 2]
    for k in range(3):
        out[k] = sums[1] * x[k] + sums[2] * y[k] - sums[3] * z[k]
        out[k] += sums[0] * (o[k] - centre[k])


@inner_kernel
def add_piece_gradient(table, pair, piece, reach, q, centre, region, gradient_io):
    """Add the derivative of the integral of q w over a piece by the tool's motion, B's frame.

    Parameters
    ----------
    pair : tuple of int
        Facets f of A and g of B.
    piece : tuple of int
        See `overlap_region.clip_pair`.
    reach : float
        w = d + reach [m].
    q : (6,) array
        Polynomial over g's plane.
    centre : (3,) array
        About which the tool turns, B's frame [m].
    region : OverlapRegion
    gradient_io : (6,) array
        By translation and rotation.
    """
    (f, g), (here, count) = pair, piece
    p, x, y, z = region.polygon[here], table.axes[g, 0], table.axes[g, 1], table.axes[g, 2]
    sums, moment, along = stack_array((4,)), stack_array((3,)), stack_array((3,))
    # The overlap changes at each point.
    for k in range(4):
        sums[k] = 0.0
    x0, y0, d0 = p[0, 0], p[0, 1], p[0, 2]
    for i in range(1, count - 1):
        x1, y1, d1 = p[i, 0] - x0, p[i, 1] - y0, p[i, 2] - d0
        x2, y2, d2 = p[i + 1, 0] - x0, p[i + 1, 1] - y0, p[i + 1, 2] - d0
        area = 0.5 * (x1 * y2 - y1 * x2)
        for node in range(6):
            near, weight = (_IN, _IN_WEIGHT) if node < 3 else (_OUT, _OUT_WEIGHT)
            far = 1.0 - 2.0 * near
            s = far if node % 3 == 1 else near
            t = far if node % 3 == 2 else near
            on_x, on_y = x0 + s * x1 + t * x2, y0 + s * y1 + t * y2
            part = weight * area * _value(q, on_x, on_y)
            sums[0] += part
            sums[1] += part * on_x
            sums[2] += part * on_y
            sums[3] += part * (d0 + s * d1 + t * d2)
    normal = region.facets.placed[f].normal
    cosine = normal[0] * z[0] + normal[1] * z[1] + normal[2] * z[2]
    _fill_moment(table, g, sums, centre, moment)
    for k in range(3):
        one, two = (k + 1) % 3, (k + 2) % 3
        gradient_io[k] -= sums[0] * normal[k] / cosine
        gradient_io[3 + k] -= (moment[one] * normal[two] - moment[two] * normal[one]) / cosine
    # The sides of A move over the facet, and so does the side at the limit on the overlap.
    onto = math.hypot(
        normal[0] * x[0] + normal[1] * x[1] + normal[2] * x[2],
        normal[0] * y[0] + normal[1] * y[1] + normal[2] * y[2],
    )
    for i in range(count):
        owner = p[i, 3]
        if owner != OF_A and owner != DEEP:
            continue
        j = i + 1 if i + 1 < count else 0
        for k in range(4):
            sums[k] = 0.0
        for node in range(3):
            t = 0.5 + _GAUSS * (node - 1)
            weight = 4.0 / 9.0 if node == 1 else 5.0 / 18.0
            on_x, on_y = p[i, 0] + t * (p[j, 0] - p[i, 0]), p[i, 1] + t * (p[j, 1] - p[i, 1])
            d = p[i, 2] + t * (p[j, 2] - p[i, 2])
            part = weight * (d + reach) * _value(q, on_x, on_y)
            sums[0] += part
            sums[1] += part * on_x
            sums[2] += part * on_y
            sums[3] += part * d
        _fill_moment(table, g, sums, centre, moment)
        out_x, out_y = p[j, 1] - p[i, 1], p[i, 0] - p[j, 0]
        for k in range(3):
            if owner == OF_A:
                along[k] = out_x * x[k] + out_y * y[k]
            else:
                along[k] = -math.hypot(out_x, out_y) * normal[k] / onto
        for k in range(3):
            one, two = (k + 1) % 3, (k + 2) % 3
            gradient_io[k] += sums[0] * along[k]
            gradient_io[3 + k] += moment[one] * along[two] - moment[two] * along[one]

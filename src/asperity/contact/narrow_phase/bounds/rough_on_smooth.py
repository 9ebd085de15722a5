"""Second-order upper bounds of the overlap of a rough plane and a smooth one over a box.

The height of a smooth plane is linear, so with G = (its slope, 1) and w the normal of the rough
plane, f is a linear function plus t (G.w). It is bounded by the texture at the centre of the box
and bounds of its slopes and second derivatives: in boxes as small as the texture's waves several
times more tightly than by its highest point, at a third of the cost of all of f's derivatives.
"""

from __future__ import annotations

import math

import numpy as np

from asperity._core.kernels import inner_kernel, small_kernel
from asperity.contact.narrow_phase.bounds.texture import plane_slopes
from asperity.contact.narrow_phase.displaced_surface import height_on
from asperity.contact.narrow_phase.plane_boxes import (
    beyond_straight_borders,
    plane_normal,
    texture_size,
)
from asperity.contact.narrow_phase.surface_patch import entries


@small_kernel
def _parabola_maximum(slope, bend, half):
    """Return the largest of `slope d + bend d^2 / 2` over |d| <= half, for slope >= 0."""
    if slope < -bend * half:
        return -0.5 * slope * slope / bend
    return slope * half + 0.5 * bend * half * half


@inner_kernel
def rough_bound(textures, patch, other, planes, box):
    """Return an upper bound of the overlap over a box (x, y, half_x, half_y) [m]; -inf if none.

    Parameters
    ----------
    patch : PATCH record
        A plane with a texture.
    other : PATCH record
        A plane without one.
    planes : Planes
        Of both.
    """
    x, y, half_x, half_y = box
    if beyond_straight_borders(patch, 0, x, y, half_x, half_y):
        return -np.inf
    radius = math.sqrt(half_x * half_x + half_y * half_y)
    w_u, w_v, w_z, change, w1, w2 = plane_normal(patch, x, y, radius)
    slope, bend, bend_size = plane_slopes(textures, patch, box, w1, w2)
    t, t_x, t_y, _, _, _ = height_on(
        textures, patch, patch.texture, x, y, (1.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    )
    size, lateral = texture_size(textures, patch), 0.0
    if not patch.is_level:
        lateral = min(math.sqrt(w_u * w_u + w_v * w_v) + change, 1.0)
    # The box's extent on the other plane: its centre is known, and how fast points move from it.
    i, j, k, m = entries(other.lateral_inverse)
    astray = (slope * lateral + size * w1) * radius / other.lateral_min
    bx = planes.b0 + planes.b1 * x + planes.b2 * y + t * (i * w_u + j * w_v)
    by = planes.c0 + planes.c1 * x + planes.c2 * y + t * (k * w_u + m * w_v)
    reach_x = abs(planes.b1) * half_x + abs(planes.b2) * half_y + astray
    reach_y = abs(planes.c1) * half_x + abs(planes.c2) * half_y + astray
    sides = other.rectangle
    if (
        bx - reach_x > sides[1]
        or bx + reach_x < sides[0]
        or by - reach_y > sides[3]
        or by + reach_y < sides[2]
        or beyond_straight_borders(other, 0, bx, by, reach_x, reach_y)
    ):
        return -np.inf
    # G.w at the centre, its derivatives, and its bounds: w turns by `change` at most.
    g1, g2 = planes.g1, planes.g2
    square, along = 1.0 + g1 * g1 + g2 * g2, w_z + g1 * w_u + g2 * w_v
    steepness, across = math.sqrt(square), math.sqrt(max(square - along * along, 0.0))
    along_x = along_y = 0.0
    if not patch.is_unit:
        along_x, along_y = _lift_slopes(patch, x, y, (w_u, w_v, w_z), (g1, g2), along)
    spread = across * change + abs(along) * 0.5 * change * change
    most, least = min(along + spread, steepness), along - spread
    second = bend * max(most if bend >= 0.0 else least, 0.0)
    if least < 0.0:
        # Seen from behind, the texture's valleys are convex.
        second = max(second, 0.0) - least * bend_size
    second += 2.0 * slope * w1 * min(across + steepness * change, steepness)
    second += size * w2 * steepness
    f_x = planes.z_x + t_x * along + t * along_x
    f_y = planes.z_y + t_y * along + t * along_y
    rise = _parabola_maximum(abs(f_x), second, half_x) + _parabola_maximum(abs(f_y), second, half_y)
    return planes.z_0 + planes.z_x * x + planes.z_y * y + t * along + rise


@small_kernel
def _lift_slopes(patch, x, y, w, g, along):
    """Return the derivatives of G.w by x and y for a normal that varies; G is (g, 1)."""
    v, by_x, by_y = patch.normal, patch.normal_from_x, patch.normal_from_y
    v_u = v[0] + by_x[0] * x + by_y[0] * y
    v_v = v[1] + by_x[1] * x + by_y[1] * y
    v_z = v[2] + by_x[2] * x + by_y[2] * y
    over = 1.0 / math.sqrt(v_u * v_u + v_v * v_v + v_z * v_z)
    w_x = w[0] * by_x[0] + w[1] * by_x[1] + w[2] * by_x[2]
    w_y = w[0] * by_y[0] + w[1] * by_y[1] + w[2] * by_y[2]
    return (
        (g[0] * by_x[0] + g[1] * by_x[1] + by_x[2] - along * w_x) * over,
        (g[0] * by_y[0] + g[1] * by_y[1] + by_y[2] - along * w_y) * over,
    )

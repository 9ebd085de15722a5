"""Upper bounds of the overlap over a box of a patch's parameters, which certify the search.

The smaller of two is used.

*Order zero.* The smooth bases are concave functions over each other, so tangent planes bound them;
the textures rise at most to the highest coefficient under the box.

*Second order* (`curvature_bound`): f is at most a quadratic around the centre of the box. If that
is concave, so is f, and the tangent plane at its maximum within the limits of both patches bounds
it (`tighten_bound`).
"""

from __future__ import annotations

import math

import numpy as np

from asperity._core.kernels import inner_kernel, small_kernel
from asperity.contact.narrow_phase.bounds.compliance import lowering_over
from asperity.contact.narrow_phase.bounds.curvature import (
    EVALUATED,
    FINEST_OVERHANG,
    UNEVALUATED,
    box_bound,
    concave_border_bend,
    curvature_bound,
    drift_of,
    less_base,
    quadratic_bound,
)
from asperity.contact.narrow_phase.bounds.limits import beyond_borders, is_apart
from asperity.contact.narrow_phase.bounds.plane_overlap import plane_bound
from asperity.contact.narrow_phase.bounds.sheets import nearby
from asperity.contact.narrow_phase.bounds.texture import (
    planar_slopes,
    roots_over,
    smooth_bounds,
    top_over,
    with_slopes,
)
from asperity.contact.narrow_phase.displaced_surface import (
    ellipse_form,
    parameters_at,
    parameters_over,
    place_at,
    root_at,
)
from asperity.contact.narrow_phase.outermost import highest_over, may_fold
from asperity.contact.narrow_phase.overlap import overlap_at, overlap_on_level
from asperity.contact.narrow_phase.patch_pair import pair_roughness, pair_shift, window_of
from asperity.contact.narrow_phase.plane_boxes import on_texture, texture_size
from asperity.contact.narrow_phase.surface_patch import PLANAR, entries
from asperity.texture.highest import texture_top


@small_kernel
def _base_tangent(patch, x, y):
    """Return height and slopes by (x, y) of the smooth base, and (x, y) moved into its ellipse."""
    if patch.bulge > 0.0:
        out = ellipse_form(patch, x, y)
        most = 1.0 - 0.25 * patch.min_root**2
        if out > most:
            scale = math.sqrt(most / out)
            x, y = x * scale, y * scale
    r, r_x, r_y, _, _, _ = root_at(patch, x, y)
    c, slope = patch.bulge, patch.slope
    z = patch.origin[2] + slope[0] * x + slope[1] * y + c * r
    return z, slope[0] + c * r_x, slope[1] + c * r_y, x, y


@small_kernel
def base_bound(patch, other, base_x, base_y, box, shift):
    """Return two upper bounds of the overlap of smooth bases over a box, and the other's slope.

    The first, -inf if there is no overlap, is that of two tangent planes; the slope is that of the
    other's plane over (u, v). The second, by the other's highest point, holds wherever textures
    move points laterally. `(base_x, base_y)` estimates where the bases overlap most: the bound is
    tight if the box contains it. `shift` bounds the textures' lateral displacement [m].
    """
    x0, x1, y0, y1 = box
    x, y = 0.5 * (x0 + x1), 0.5 * (y0 + y1)
    half_x, half_y = 0.5 * (x1 - x0), 0.5 * (y1 - y0)
    radius = math.sqrt(half_x * half_x + half_y * half_y)
    _, most = roots_over(patch, x, y, radius)
    if patch.bulge > 0.0 and most < patch.min_root:
        return -np.inf, -np.inf, 0.0, 0.0
    # The part of the other patch under the box.
    u, v = place_at(patch, x, y)
    bx, by = parameters_at(other, u, v)
    moved = shift / other.lateral_min
    if other.bulge == 0.0:
        _, b1, b2, _, c1, c2 = parameters_over(patch, other)
        reach_x = abs(b1) * half_x + (abs(b2) * half_y + moved)
        reach_y = abs(c1) * half_x + (abs(c2) * half_y + moved)
        sides = other.rectangle
        if bx - reach_x > sides[1] or bx + reach_x < sides[0]:
            return -np.inf, -np.inf, 0.0, 0.0
        if by - reach_y > sides[3] or by + reach_y < sides[2]:
            return -np.inf, -np.inf, 0.0, 0.0
    else:
        reach_x = reach_y = radius * patch.lateral_max / other.lateral_min + moved
        _, most = roots_over(other, bx, by, reach_x)
        if most < other.min_root:
            return -np.inf, -np.inf, 0.0, 0.0
    if beyond_borders(other, bx, by, reach_x, reach_y):
        return -np.inf, -np.inf, 0.0, 0.0
    tx, ty = min(max(base_x, x0), x1), min(max(base_y, y0), y1)
    z, z_x, z_y, px, py = _base_tangent(patch, tx, ty)
    total = z + z_x * (x - px) + z_y * (y - py)
    # Neither base is above its highest point, however steep the tangent planes are.
    top = min(total + abs(z_x) * half_x + abs(z_y) * half_y, patch.base_top) + other.base_top
    u, v = place_at(patch, tx, ty)
    qx, qy = parameters_at(other, u, v)
    z, s_x, s_y, qx, qy = _base_tangent(other, qx, qy)
    total += z + s_x * (bx - qx) + s_y * (by - qy)
    i, j, k, m = entries(other.lateral_inverse)
    g1, g2 = i * s_x + k * s_y, j * s_x + m * s_y
    a, b, c, d = entries(patch.lateral)
    z_x += g1 * a + g2 * c
    z_y += g1 * b + g2 * d
    return total + abs(z_x) * half_x + abs(z_y) * half_y, top, g1, g2


@small_kernel
def _level_bound(textures, patch, other, box, bound, threshold, at):
    """Tighten the base bound for a level textured plane and a smooth other patch."""
    x0, x1, y0, y1 = box
    x, y = 0.5 * (x0 + x1), 0.5 * (y0 + y1)
    half_x, half_y = 0.5 * (x1 - x0), 0.5 * (y1 - y0)
    u0, u1, v0, v1 = on_texture(patch, x, y, half_x, half_y)
    bound += texture_top(textures, patch.texture, u0, u1, v0, v1)
    if bound <= threshold:
        return box_bound(bound, UNEVALUATED, bound, 0.0)
    _, kappa, _ = planar_slopes(textures, patch, x, y, half_x, half_y)
    overlap_on_level(textures, patch, other, x, y, at)
    if at.f == -np.inf:
        return box_bound(bound, UNEVALUATED, bound, 0.0)
    radius = math.sqrt(half_x * half_x + half_y * half_y)
    reach = radius * patch.lateral_max / other.lateral_min
    least, most = roots_over(other, at.other_x, at.other_y, reach)
    if other.bulge > 0.0 and least < 0.5 * other.min_root:
        return box_bound(bound, EVALUATED, bound, 0.0)
    matrix = (kappa, 0.0, kappa)
    if other.bulge > 0.0:
        matrix = less_base(other, matrix, most, entries(patch.lateral))
    slack = 0.5 * reach * reach * concave_border_bend(other, least)
    return quadratic_bound(matrix, half_x, half_y, bound, slack, at)


@inner_kernel
def sphere_bound(textures, pair, box, threshold, at):
    """Return the `general_bound` of a smooth sphere over a level textured plane, 4 times as fast.

    The pair's base point is under the sphere's lowest point, so the sphere is lowest over the
    box's point nearest to it.
    """
    patch, other = pair.patch, pair.other
    x, y = pair.base_x, pair.base_y
    x0, x1, y0, y1 = box
    dx, dy = max(x0 - x, x - x1, 0.0), max(y0 - y, y - y1, 0.0)
    square = 1.0 - other.ellipse[0] * (dx * dx + dy * dy)
    if square < other.min_root * other.min_root:
        return box_bound(-np.inf, UNEVALUATED, 0.0, 0.0)
    bound = patch.origin[2] + other.origin[2] + other.bulge * math.sqrt(square)
    return _level_bound(textures, patch, other, box, bound, threshold, at)


@small_kernel
def _raised(textures, patch, other, over, over_other, highest, base):
    """Return the order-zero bound: the base bound plus the textures.

    `base` is that of `base_bound`, `highest` an upper bound of the other's texture.
    """
    bound, top, g1, g2 = base
    steepness = math.sqrt(1.0 + g1 * g1 + g2 * g2)
    if patch.texture >= 0:
        # The overlap rises by t times G.w, the lateral part of w included.
        along = over.normal_z + g1 * over.normal_u + g2 * over.normal_v
        spread = steepness * over.normal_change
        rise = over.top * (along + spread if over.top > 0.0 else max(along - spread, 0.0))
        bound += max(rise, texture_size(textures, patch) * (spread - along))
    if other.texture >= 0:
        # The other surface is below its tangent plane, moved along its normal.
        least = max(1.0 - over_other.normal_change, 0.0)
        bound += highest * (steepness if highest > 0.0 else least)
    # No point is higher than the sum of the base's top and the highest texture.
    return min(bound, top + max(over.top, 0.0) + max(highest, 0.0))


@small_kernel
def _part_under(textures, other, over_other, travel, at):
    """Return the middle and half the side of the other's part that may be under a box.

    A point is displaced along its normal by a height between the lowest and the highest: so the
    base points of all that lie under one place are near a segment along the normal's lateral part.
    `over_other` bounds the texture and the normal over a larger part; `travel` is how far points
    over the box are from its centre's in (u, v), and `at` the overlap at its centre.
    """
    texture = textures.maps[other.texture]
    cells = texture.cells_per_metre
    # No place is further from a sample than half the diagonal of a pixel.
    apart = 0.5 * math.sqrt(1.0 / (cells[0] * cells[0]) + 1.0 / (cells[1] * cells[1]))
    lowest = max(texture.lowest - texture.max_slope * apart, -texture.max_abs_surface)
    middle, half = 0.5 * (over_other.top + lowest), max(0.5 * (over_other.top - lowest), 0.0)
    x, y = parameters_at(
        other,
        at.point[0] - middle * over_other.normal_u,
        at.point[1] - middle * over_other.normal_v,
    )
    reach = travel + half * over_other.lateral + abs(middle) * over_other.normal_change
    return x, y, reach / other.lateral_min


@inner_kernel
def _textured_bound(textures, pair, box, base, threshold, search):
    """Tighten the base bound for any two patches; `base` is that of `base_bound`."""
    patch, other, at = pair.patch, pair.other, search.at
    x0, x1, y0, y1 = box
    over = top_over(textures, patch, x0, x1, y0, y1)
    x, y = 0.5 * (x0 + x1), 0.5 * (y0 + y1)
    half_x, half_y = 0.5 * (x1 - x0), 0.5 * (y1 - y0)
    radius = math.sqrt(half_x * half_x + half_y * half_y)
    size_other = texture_size(textures, other)
    shift = texture_size(textures, patch) * over.lateral
    is_explicit = other.is_level or other.texture < 0
    # The part of the other patch under the box.
    u, v = place_at(patch, x, y)
    bx, by = parameters_at(other, u, v)
    reach = radius * patch.lateral_max + shift + (0.0 if is_explicit else size_other)
    reach /= other.lateral_min
    reach_x = reach_y = reach
    if other.texture < 0:
        least, most = roots_over(other, bx, by, reach)
        over_other = smooth_bounds(0.0, least, most)
    else:
        if is_explicit and shift == 0.0:
            _, b1, b2, _, c1, c2 = parameters_over(patch, other)
            reach_x = abs(b1) * half_x + abs(b2) * half_y
            reach_y = abs(c1) * half_x + abs(c2) * half_y
        over_other = top_over(
            textures, other, bx - reach_x, bx + reach_x, by - reach_y, by + reach_y
        )
    folds, highest = may_fold(textures, other), np.inf
    if folds:
        _, b1, b2, _, c1, c2 = parameters_over(patch, other)
        moved = shift / other.lateral_min
        own_x = abs(b1) * half_x + abs(b2) * half_y + moved
        own_y = abs(c1) * half_x + abs(c2) * half_y + moved
        highest = highest_over(textures, other, (bx, by, own_x, own_y))
        if highest == -np.inf:
            return box_bound(-np.inf, UNEVALUATED, 0.0, 0.0)
    bound = _raised(textures, patch, other, over, over_other, min(over_other.top, highest), base)
    lowered = bend = known = 0.0
    if search.load > 0.0:
        lowered, bend, _ = lowering_over(textures, patch, other, box, search)
        bound -= lowered
    if bound <= threshold:
        return box_bound(bound, UNEVALUATED, bound, 0.0)
    if patch.bulge == 0.0 and other.bulge == 0.0:
        return plane_bound(textures, pair, box, bound, search)
    over = with_slopes(textures, patch, x0, x1, y0, y1, over)
    fastest = patch.lateral_max + drift_of(textures, patch, over)
    overlap_at(textures, patch, other, x, y, search, at)
    # The lateral displacement by the other's texture is known only if there is a point.
    astray = 0.0 if is_explicit else (size_other if at.f == -np.inf else 3.0 * size_other)
    far = (radius * fastest + astray) / other.lateral_min
    # Beyond the outline of a round patch there is no point, and none on the other.
    if at.other_x == at.other_x and is_apart(other, at.other_x, at.other_y, far):
        return box_bound(-np.inf, UNEVALUATED, 0.0, 0.0)
    if at.f == -np.inf:
        # The other surface overhangs there along n: it has no height.
        left = bound if radius > FINEST_OVERHANG else -np.inf
        return box_bound(left, UNEVALUATED, bound, 0.0)
    closest = other.lateral_min
    if not is_explicit:
        px, py, near = _part_under(textures, other, over_other, radius * fastest, at)
        if near < reach_x:
            bx, by, reach_x, reach_y = px, py, near, near
            over_other = top_over(textures, other, bx - near, bx + near, by - near, by + near)
            highest = min(highest, over_other.top)
            raised = _raised(textures, patch, other, over, over_other, highest, base)
            bound = min(bound, raised - lowered)
            if bound <= threshold:
                return box_bound(bound, EVALUATED, bound, 0.0)
        over_other = with_slopes(
            textures, other, bx - reach_x, bx + reach_x, by - reach_y, by + reach_y, over_other
        )
        closest -= drift_of(textures, other, over_other)
    if (not is_explicit or shift > 0.0) and closest > 0.0:
        # The point under the centre is known now: a narrower part of the other suffices.
        bx, by = at.other_x, at.other_y
        reach_x = reach_y = min(reach_x, radius * fastest / closest)
        over_other = top_over(
            textures, other, bx - reach_x, bx + reach_x, by - reach_y, by + reach_y
        )
        highest = min(highest, over_other.top)
        raised = _raised(textures, patch, other, over, over_other, highest, base)
        bound = min(bound, raised - lowered)
        if bound <= threshold:
            return box_bound(bound, EVALUATED, bound, 0.0)
    elif not is_explicit and folds:
        near, known, far = nearby(textures, other, radius * fastest, highest, search)
        over_other = near if known > 0.0 else over_other
        if known > 0.0 and is_apart(other, at.other_x, at.other_y, far):
            return box_bound(-np.inf, UNEVALUATED, 0.0, 0.0)
    if over_other.slope == np.inf:
        over_other = with_slopes(
            textures, other, bx - reach_x, bx + reach_x, by - reach_y, by + reach_y, over_other
        )
    if (patch.bulge > 0.0 and over.min_root < 0.5 * patch.min_root) or (
        other.bulge > 0.0 and over_other.min_root < 0.5 * other.min_root
    ):
        left = bound if radius > FINEST_OVERHANG else at.f
        return box_bound(left, EVALUATED, bound, 0.0)
    return curvature_bound(
        textures, patch, other, over, over_other, (half_x, half_y, bend, known), bound, at
    )


@inner_kernel
def general_bound(textures, pair, box, threshold, search):
    """Return a `BoxBound` of the overlap over a box.

    A bound up to `threshold` is not tightened further. If f at the centre of the box is known,
    `search.at` is filled as by `overlap_at`; the centre may be beyond a limit.
    """
    patch, other = pair.patch, pair.other
    base = base_bound(patch, other, pair.base_x, pair.base_y, box, pair.shift)
    if base[0] == -np.inf:
        return box_bound(-np.inf, UNEVALUATED, -np.inf, 0.0)
    is_level = patch.is_level and patch.mapping == PLANAR and patch.texture >= 0
    if is_level and other.texture < 0 and search.load == 0.0:
        smooth = min(base[0], base[1])
        return _level_bound(textures, patch, other, box, smooth, threshold, search.at)
    return _textured_bound(textures, pair, box, base, threshold, search)


@inner_kernel
def order_zero_bound(textures, patch, other):
    """Return an upper bound of the overlap of two patches, -inf without a common part [m]."""
    shift = pair_shift(textures, patch, other)
    x0, x1, y0, y1 = window_of(patch, other, shift)
    if not (x0 <= x1 and y0 <= y1):
        return -np.inf
    x, y = 0.5 * (x0 + x1), 0.5 * (y0 + y1)
    if beyond_borders(patch, x, y, x1 - x, y1 - y):
        return -np.inf
    return raised_base_bound(textures, patch, other, x, y, (x0, x1, y0, y1), shift)


@small_kernel
def raised_base_bound(textures, patch, other, base_x, base_y, box, shift):
    """Return `base_bound` raised by the largest heights of both textures [m]."""
    tangent, top, g1, g2 = base_bound(patch, other, base_x, base_y, box, shift)
    smooth = min(tangent, top)
    return smooth + pair_roughness(textures, patch, other) * math.sqrt(1.0 + g1 * g1 + g2 * g2)

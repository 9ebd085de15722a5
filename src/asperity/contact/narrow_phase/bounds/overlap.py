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
from asperity.contact.narrow_phase.bounds.curvature import (
    EVALUATED,
    UNEVALUATED,
    box_bound,
    concave_border_bend,
    less_base,
    quadratic_bound,
)
from asperity.contact.narrow_phase.bounds.smooth_bases import base_bound
from asperity.contact.narrow_phase.bounds.texture import planar_slopes, roots_over
from asperity.contact.narrow_phase.bounds.textured import textured_bound
from asperity.contact.narrow_phase.overlap import overlap_on_level
from asperity.contact.narrow_phase.plane_boxes import on_texture
from asperity.contact.narrow_phase.surface_patch import PLANAR, entries
from asperity.texture.highest import texture_top


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
    return textured_bound(textures, pair, box, base, threshold, search)

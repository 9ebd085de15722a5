"""Upper bounds of the overlap over a box of any two patches with textures."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from asperity._core.kernels import inner_kernel, small_kernel
from asperity.contact.narrow_phase.bounds.borders import is_apart
from asperity.contact.narrow_phase.bounds.compliance import lowering_over
from asperity.contact.narrow_phase.bounds.curvature import (
    EVALUATED,
    FINEST_OVERHANG,
    UNEVALUATED,
    box_bound,
    curvature_bound,
    drift_of,
)
from asperity.contact.narrow_phase.bounds.plane_overlap import plane_bound
from asperity.contact.narrow_phase.bounds.planes import box_under
from asperity.contact.narrow_phase.bounds.sheets import nearby
from asperity.contact.narrow_phase.bounds.smooth_bases import tangent_bound
from asperity.contact.narrow_phase.bounds.texture import (
    TextureBounds,
    roots_over,
    smooth_bounds,
    top_over,
    with_slopes,
)
from asperity.contact.narrow_phase.displaced_surface import surface_at
from asperity.contact.narrow_phase.outermost import highest_over, may_fold, may_fold_near
from asperity.contact.narrow_phase.overlap import overlap_at, overlap_under
from asperity.contact.narrow_phase.plane_boxes import texture_size
from asperity.contact.narrow_phase.smooth_base import parameters_at, parameters_over, place_at


class OtherPart(NamedTuple):
    """The part of the other patch that may be under a box, in its own parameters."""

    x: float
    """Its middle [m]."""
    y: float
    reach_x: float
    """Half its sides [m]."""
    reach_y: float
    over: TextureBounds
    """Bounds over it."""


@small_kernel
def _part_around(textures, other, x, y, reach_x, reach_y):
    """Return the `OtherPart` of the other patch around a point, with bounds but those of slopes."""
    over = top_over(textures, other, x - reach_x, x + reach_x, y - reach_y, y + reach_y)
    return OtherPart(x, y, reach_x, reach_y, over)


@small_kernel
def _with_slopes(textures, other, part):
    """Return a `OtherPart` with bounds of slopes."""
    x, y, reach_x, reach_y, over = part
    sides = (x - reach_x, x + reach_x, y - reach_y, y + reach_y)
    return OtherPart(x, y, reach_x, reach_y, with_slopes(textures, other, *sides, over))


@inner_kernel
def _widest_part(textures, patch, other, box, shift):
    """Return the `OtherPart` under a box (x, y, half_x, half_y), however its points are displaced.

    `shift` bounds the lateral displacement of the points over the box [m].
    """
    x, y, half_x, half_y = box
    u, v = place_at(patch, x, y)
    x, y = parameters_at(other, u, v)
    reach = math.sqrt(half_x * half_x + half_y * half_y) * patch.lateral_max + shift
    is_explicit = other.is_level or other.texture < 0
    reach += 0.0 if is_explicit else texture_size(textures, other)
    reach_x = reach_y = reach / other.lateral_min
    if other.texture < 0:
        least, most = roots_over(other, x, y, reach_x)
        return OtherPart(x, y, reach_x, reach_y, smooth_bounds(0.0, least, most))
    if is_explicit and shift == 0.0:
        x, y, reach_x, reach_y = box_under(parameters_over(patch, other), box, 0.0)
    return _part_around(textures, other, x, y, reach_x, reach_y)


@inner_kernel
def _highest_on_plane(textures, patch, other, box, shift):
    """Return the largest height under a box of the other patch, a plane that may fold [m]."""
    own = box_under(parameters_over(patch, other), box, shift / other.lateral_min)
    return highest_over(textures, other, own)


@inner_kernel
def _part_along_normal(textures, other, part, highest, travel, u, v):
    """Return the `OtherPart` under a box with a point at (u, v) and the others within `travel`.

    A point is displaced along its normal by a height between the lowest and `highest`: so the base
    points of all that lie under one place are near a segment along the normal's lateral part.
    `part` includes them all.
    """
    texture, over = textures.maps[other.texture], part.over
    cells = texture.cells_per_metre
    # No place is further from a sample than half the diagonal of a pixel.
    apart = 0.5 * math.sqrt(1.0 / (cells[0] * cells[0]) + 1.0 / (cells[1] * cells[1]))
    lowest = max(texture.lowest - texture.max_slope * apart, -texture.max_abs_surface)
    middle, half = 0.5 * (highest + lowest), max(0.5 * (highest - lowest), 0.0)
    reach = travel + half * over.lateral + abs(middle) * over.normal_change
    reach /= other.lateral_min
    if reach >= part.reach_x:
        return part
    x, y = parameters_at(other, u - middle * over.normal_u, v - middle * over.normal_v)
    return _part_around(textures, other, x, y, reach, reach)


@inner_kernel
def _highest_on_curved(textures, other, travel, u, v):
    """Return the largest height within `travel` of a place on a curved other patch [m].

    It is inf if the texture does not fold there, -inf if no point is there.
    """
    x, y = parameters_at(other, u, v)
    near = travel / other.lateral_min
    if other.bulge > 0.0 and may_fold_near(textures, other, x, y, near):
        return highest_over(textures, other, (x, y, near, near))
    return np.inf


@inner_kernel
def _raised(textures, pair, box, over, over_other, highest, base):
    """Return the order-zero bound: the base bound plus the textures.

    `base` is that of `base_bound`, `highest` an upper bound of the other's texture.
    """
    patch, other = pair.patch, pair.other
    bound, top, g1, g2 = base
    if other.bulge > 0.0 and other.texture >= 0 and highest > 0.0:
        bound, top, g1, g2 = tangent_bound(patch, other, pair.base_x, pair.base_y, box, highest)
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


@inner_kernel
def textured_bound(textures, pair, box, base, threshold, search):
    """Tighten the base bound for any two patches; `base` is that of `base_bound`."""
    patch, other, at = pair.patch, pair.other, search.at
    x0, x1, y0, y1 = box
    over = top_over(textures, patch, x0, x1, y0, y1)
    x, y = 0.5 * (x0 + x1), 0.5 * (y0 + y1)
    half_x, half_y = 0.5 * (x1 - x0), 0.5 * (y1 - y0)
    around, radius = (x, y, half_x, half_y), math.sqrt(half_x * half_x + half_y * half_y)
    size_other = texture_size(textures, other)
    shift = texture_size(textures, patch) * over.lateral
    is_explicit = other.is_level or other.texture < 0
    part = _widest_part(textures, patch, other, around, shift)
    highest = part.over.top
    if may_fold(textures, other):
        highest = min(highest, _highest_on_plane(textures, patch, other, around, shift))
        if highest == -np.inf:
            return box_bound(-np.inf, UNEVALUATED, 0.0, 0.0)
    bound = _raised(textures, pair, box, over, part.over, highest, base)
    lowered = bend = known = 0.0
    if search.load > 0.0:
        lowered, bend, _ = lowering_over(textures, patch, other, box, search)
        bound -= lowered
    if bound <= threshold:
        return box_bound(bound, UNEVALUATED, bound, 0.0)
    if patch.bulge == 0.0 and other.bulge == 0.0:
        return plane_bound(textures, pair, box, bound, search)
    over = with_slopes(textures, patch, x0, x1, y0, y1, over)
    travel = radius * (patch.lateral_max + drift_of(textures, patch, over))
    if not is_explicit:
        # Points over the box are near that over its centre.
        surface_at(textures, patch, x, y, search.surface)
        u, v = search.surface.p[0], search.surface.p[1]
        part = _part_along_normal(textures, other, part, highest, travel, u, v)
        found = _highest_on_curved(textures, other, travel, u, v)
        highest = min(highest, min(found, part.over.top))
        if highest == -np.inf:
            return box_bound(-np.inf, UNEVALUATED, 0.0, 0.0)
        raised = _raised(textures, pair, box, over, part.over, highest, base)
        bound = min(bound, raised - lowered)
        if bound <= threshold:
            return box_bound(bound, UNEVALUATED, bound, 0.0)
        overlap_under(textures, patch, other, x, y, search, at)
    else:
        overlap_at(textures, patch, other, x, y, search, at)
    # The lateral displacement by the other's texture is known only if there is a point.
    astray = 0.0 if is_explicit else (size_other if at.f == -np.inf else 3.0 * size_other)
    far = (travel + astray) / other.lateral_min
    # Beyond the outline of a round patch there is no point, and none on the other.
    if at.other_x == at.other_x and is_apart(other, at.other_x, at.other_y, far):
        return box_bound(-np.inf, UNEVALUATED, 0.0, 0.0)
    if at.f == -np.inf:
        # The other surface overhangs there along n: it has no height.
        left = bound if radius > FINEST_OVERHANG else -np.inf
        return box_bound(left, UNEVALUATED, bound, 0.0)
    closest = other.lateral_min
    if not is_explicit:
        part = _with_slopes(textures, other, part)
        closest -= drift_of(textures, other, part.over)
    if (not is_explicit or shift > 0.0) and closest > 0.0:
        # The point under the centre is known now: a narrower part of the other suffices.
        reach = min(part.reach_x, travel / closest)
        part = _part_around(textures, other, at.other_x, at.other_y, reach, reach)
        highest = min(highest, part.over.top)
        raised = _raised(textures, pair, box, over, part.over, highest, base)
        bound = min(bound, raised - lowered)
        if bound <= threshold:
            return box_bound(bound, EVALUATED, bound, 0.0)
    over_other = part.over
    if not is_explicit and closest <= 0.0:
        near, known, far = nearby(textures, other, travel, highest, search)
        over_other = near if known > 0.0 else over_other
        if known > 0.0 and is_apart(other, at.other_x, at.other_y, far):
            return box_bound(-np.inf, UNEVALUATED, 0.0, 0.0)
    elif over_other.slope == np.inf:
        over_other = _with_slopes(textures, other, part).over
    if (patch.bulge > 0.0 and over.min_root < 0.5 * patch.min_root) or (
        other.bulge > 0.0 and over_other.min_root < 0.5 * other.min_root
    ):
        left = bound if radius > FINEST_OVERHANG else at.f
        return box_bound(left, EVALUATED, bound, 0.0)
    return curvature_bound(
        textures, patch, other, over, over_other, (half_x, half_y, bend, known), bound, at
    )

"""Derivatives of the depth of a sub-region by the offsets of the lines that bound it.

If a sub-region's deepest point is on such a line, the derivative is the multiplier of that limit:
the gradient of the overlap is a sum of those of the active limits, with non-negative coefficients
(Karush, Kuhn & Tucker).
"""

from __future__ import annotations

from asperity._core.kernels import inner_kernel
from asperity.contact.narrow_phase.overlap import limits_at
from asperity.contact.narrow_phase.patch_pair import searches_a
from asperity.contact.narrow_phase.slope_normal import ON_EDGE
from asperity.contact.narrow_phase.smooth_base import base_height_at, place_at

_PARALLEL = 1e-9
"""Squared sine of the angle between limits below which they count as parallel."""


@inner_kernel
def _add_sides(patch, at, limits, count):
    """Add the sides of the searched patch's rectangle to the limits; return the new count."""
    for side in range(4):
        sign, is_x = (1.0 if side & 1 else -1.0), side < 2
        limit = limits[count]
        limit.g = sign * ((at.x if is_x else at.y) - patch.rectangle[side])
        limit.g_x, limit.g_y = (sign, 0.0) if is_x else (0.0, sign)
        count += 1
    return count


@inner_kernel
def _multiplier(limits, count, number, f_x, f_y):
    """Return the multiplier of limit `number` at a maximum with the gradient (f_x, f_y)."""
    one = limits[number]
    square = one.g_x * one.g_x + one.g_y * one.g_y
    alone = (f_x * one.g_x + f_y * one.g_y) / square
    left_x, left_y = f_x - alone * one.g_x, f_y - alone * one.g_y
    best, least = max(alone, 0.0), left_x * left_x + left_y * left_y
    for i in range(count):
        other = limits[i]
        if i == number or other.g < -ON_EDGE:
            continue
        across = one.g_x * other.g_y - one.g_y * other.g_x
        if across * across < _PARALLEL * square * (other.g_x * other.g_x + other.g_y * other.g_y):
            continue
        mine = (f_x * other.g_y - f_y * other.g_x) / across
        its = (one.g_x * f_y - one.g_y * f_x) / across
        if mine >= 0.0 and its >= 0.0 and least > 1e-12 * (f_x * f_x + f_y * f_y):
            best, least = mine, 0.0
    return best


@inner_kernel
def fill_line_rates(stride, sides, added, memory, patch_out):
    """Fill `line_rate` and `base` of a `MESH_PATCH` from a finished search.

    Parameters
    ----------
    stride : int
        Of pair numbers.
    sides : (2,) array
        Side of each line on which the sub-region is, 1 or -1; 0 if the line does not bound it.
    added : int
        Number of lines, which are the last borders of B's patches.
    memory : Workspace
    patch_out : MESH_PATCH record
        `base` is relative to the contact's origin, in the contact frame.
    """
    search, number = memory.search[0], memory.search[0].best.pair
    patch_out.line_rate[0] = patch_out.line_rate[1] = 0.0
    if number < 0:
        return
    at, limits = search.best, search.limits
    a, b = memory.patches_a[number // stride], memory.patches_b[number % stride]
    is_a = searches_a(a, b)
    patch, other = (a, b) if is_a else (b, a)
    x, y = (at.other_x, at.other_y) if is_a else (at.x, at.y)
    u, v = place_at(b, x, y)
    patch_out.base[0], patch_out.base[1], patch_out.base[2] = u, v, base_height_at(b, u, v)[0]
    count = limits_at(patch, other, at, limits)
    first = count - added
    if not is_a:
        first = patch.border_count - added + (1 if patch.bulge > 0.0 else 0)
    if patch.bulge == 0.0:
        count = _add_sides(patch, at, limits, count)
    for k in range(2):
        if sides[k] == 0.0:
            continue
        if limits[first].g > -ON_EDGE:
            patch_out.line_rate[k] = sides[k] * _multiplier(limits, count, first, at.f_x, at.f_y)
        first += 1

"""Second-order upper bounds of the overlap over a box.

Along a unit direction of the parameters of the first patch, with `G = (slope of the other, 1)`,

    f'' = G.base'' + t'' (G.w) + 2 t' (G.w') + t (G.w'') + K[q', q'],

K the curvature of the other's height over (u, v), for which the same expression holds with its
own parameters and `(-slope, 1)`. The bases' parts are concave and kept as matrices; t, t', t'' of
either texture are bounded by its pyramid, w' and w'' by the curvature of the base. The sum is a
matrix M with `f <= f(c) + f'(c) d + d^T M d / 2` everywhere in the box about c.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from asperity._core.kernels import small_kernel
from asperity.contact.narrow_phase.bounds.triplanar import MIX_1, MIX_2, MIX_3
from asperity.contact.narrow_phase.plane_boxes import texture_size
from asperity.contact.narrow_phase.surface_patch import TRIPLANAR, entries

UNEVALUATED, EVALUATED, QUADRATIC, CONCAVE = 0, 1, 2, 3
"""Kind of bound of f over a box: of order zero, without or with f at the centre; a quadratic; a
concave quadratic."""

FINEST_OVERHANG = 1e-6
"""Half diagonal below which boxes on an overhang are not divided [m]."""


class BoxBound(NamedTuple):
    """Upper bound of the overlap over a box."""

    value: float
    """[m]"""
    kind: int
    """UNEVALUATED, EVALUATED, QUADRATIC or CONCAVE."""
    level: float
    """The quadratic bound without f's rise along the tangent plane at the centre [m]."""
    slack: float
    """Upper bound of the distance of limits from their tangents within the box [m]."""


@small_kernel
def box_bound(value, kind, level, slack):
    """Return a `BoxBound`."""
    return BoxBound(value, kind, level, slack)


@small_kernel
def concave_border_bend(patch, min_root):
    """Return an upper bound of a concave border's curvature within a box [1/m]."""
    if patch.bulge == 0.0:
        return 0.0
    low = max(min_root, 0.5 * patch.min_root)
    return patch.bulge * patch.ellipse_max / (low * low * low)


@small_kernel
def _texture_part(size, over, facing, spread, steepness):
    """Return an upper bound of a texture's part of f''.

    `size` is the largest |t|; `facing` is G.w at the centre, and `spread` bounds its change over
    the box.
    """
    most, least = facing + spread, facing - spread
    bend = over.bend * max(most if over.bend >= 0.0 else least, 0.0)
    if least < 0.0:
        # Seen from behind, the texture's valleys are convex.
        bend = max(bend, 0.0) - least * over.bend_size
    return bend + (2.0 * over.slope * over.normal_slope + size * over.normal_bend) * steepness


@small_kernel
def displacement_bend(textures, patch, over, side):
    """Return a bound of |(t w)''|; `side` is as in `surface_bend`."""
    if patch.texture < 0:
        return 0.0
    size = texture_size(textures, patch)
    bend = over.bend_size * side + 2.0 * over.slope * over.normal_slope
    return bend + size * over.normal_bend


@small_kernel
def surface_bend(textures, patch, over, side):
    """Return a bound of |p''|, the second derivatives of a displaced surface by its parameters.

    `side` is the size of the normal's part that is used: 1, or that of its lateral part.
    """
    base = concave_border_bend(patch, over.min_root)
    return base + displacement_bend(textures, patch, over, side)


@small_kernel
def less_base(other, matrix, max_root, lateral):
    """Return M (11, 12, 22) minus the curvature of the other's smooth base.

    `lateral` has the four entries of the first patch's map to (u, v).
    """
    m11, m12, m22 = matrix
    c = other.bulge / max_root
    e11, e12, e22 = c * other.ellipse_uv[0], c * other.ellipse_uv[1], c * other.ellipse_uv[2]
    a, b, d, e = lateral
    m11 -= a * (e11 * a + e12 * d) + d * (e12 * a + e22 * d)
    m12 -= a * (e11 * b + e12 * e) + d * (e12 * b + e22 * e)
    m22 -= b * (e11 * b + e12 * e) + e * (e12 * b + e22 * e)
    return m11, m12, m22


@small_kernel
def _parabola_maximum(slope, bend, half):
    """Return the largest of `slope d + bend d^2 / 2` over |d| <= half, for slope >= 0."""
    if slope < -bend * half:
        return -0.5 * slope * slope / bend
    return slope * half + 0.5 * bend * half * half


@small_kernel
def quadratic_bound(matrix, half_x, half_y, bound, slack, at):
    """Return the tighter of `bound` and that of f'' <= M, given as (11, 12, 22)."""
    m11, m12, m22 = matrix
    square = max(m11, 0.0) * half_x * half_x + max(m22, 0.0) * half_y * half_y
    level = at.f + 0.5 * square + abs(m12) * half_x * half_y
    rise = _parabola_maximum(abs(at.f_x), m11, half_x) + _parabola_maximum(abs(at.f_y), m22, half_y)
    bound = min(bound, at.f + rise + abs(m12) * half_x * half_y)
    is_concave = _is_concave(m11, m12, m22)
    return box_bound(bound, CONCAVE if is_concave else QUADRATIC, level, slack)


@small_kernel
def _is_concave(m11, m12, m22):
    """Return whether a symmetric matrix is negative definite."""
    return m11 < 0.0 and m11 * m22 - m12 * m12 > 0.0


@small_kernel
def third_of_texture(textures, patch, over):
    """Return a bound of the third derivative of a plane patch's texture by its parameters."""
    if patch.texture < 0:
        return 0.0
    third = textures.maps[patch.texture].max_third_derivative * patch.map_max**3
    if not patch.is_unit and patch.mapping == TRIPLANAR:
        # The product rule for the sum of a_i t_i; w'' has a part along w, of size w1^2.
        a, s, b = texture_size(textures, patch), over.slope, over.bend_size
        w1, w2 = over.normal_slope, over.normal_bend
        third += 3.0 * MIX_1 * w1 * b + 3.0 * (MIX_2 * w1 * w1 + MIX_1 * w2) * s
        third += (MIX_3 * w1 * w1 + 3.0 * MIX_2 * w2 + 3.0 * MIX_1 * w1 * w1) * w1 * a
        third += MIX_1 * 5.0 * w1 * w2 * a
    return third


@small_kernel
def _third_order(textures, patch, other, over, over_other, fastest, closest):
    """Return a bound of the third derivative of f for two plane patches.

    Of the first patch it is the product rule for t w; of the other's height over a place, the
    rules for a function z of parameters psi that are the inverse of a map, which moves by
    `closest` at least where psi moves by 1.
    """
    side, side_other = over.lateral, over_other.lateral
    t, t_other = (
        third_of_texture(textures, patch, over),
        third_of_texture(textures, other, over_other),
    )
    a, s, b = texture_size(textures, patch), over.slope, over.bend_size
    w1, w2 = over.normal_slope, over.normal_bend
    w3 = 5.0 * w1 * w2  # of v / |v| with v linear: 15 w1^3, and w2 is 3 w1^2
    more = 3.0 * b * w1 + 3.0 * s * w2 + a * w3
    turn = b * side + 2.0 * s * w1 + a * w2  # second derivative of the point's place in (u, v)
    a, s, b = texture_size(textures, other), over_other.slope, over_other.bend_size
    w1, w2 = over_other.normal_slope, over_other.normal_bend
    more_other = 3.0 * b * w1 + 3.0 * s * w2 + 5.0 * a * w1 * w2
    turn_other = b * side_other + 2.0 * s * w1 + a * w2
    z1 = s + a * w1 + math.sqrt(other.slope[0] ** 2 + other.slope[1] ** 2)
    z2, z3 = b + 2.0 * s * w1 + a * w2, t_other + more_other
    inverse = 1.0 / closest
    psi2 = turn_other * inverse**3
    psi3 = 3.0 * turn_other * turn_other * inverse + t_other * side_other + more_other
    psi3 *= inverse**4
    h1, h2 = z1 * inverse, z2 * inverse * inverse + z1 * psi2
    h3 = z3 * inverse**3 + 3.0 * z2 * inverse * psi2 + z1 * psi3
    return t + more + h1 * (t * side + more) + 3.0 * h2 * fastest * turn + h3 * fastest**3


@small_kernel
def _tighten_by_hessian(found, third, half_x, half_y, bound, at):
    """Return the tighter of `found` and the bound by the Hessian at the centre.

    `third` bounds the change of the Hessian over the box. That bound is tighter on ridges and in
    small boxes. By Taylor's theorem the remainder is at most a third of what the whole change would
    give everywhere in the box; f is concave only if it is with the whole change.
    """
    matrix = (at.f_xx + third / 3.0, at.f_xy, at.f_yy + third / 3.0)
    by_third = quadratic_bound(matrix, half_x, half_y, bound, found.slack, at)
    if by_third.kind == CONCAVE and not _is_concave(at.f_xx + third, at.f_xy, at.f_yy + third):
        by_third = box_bound(by_third.value, QUADRATIC, by_third.level, by_third.slack)
    least = min(found.value, by_third.value)
    if by_third.kind > found.kind or (by_third.kind == found.kind and by_third.level < found.level):
        return box_bound(least, by_third.kind, by_third.level, by_third.slack)
    return box_bound(least, found.kind, found.level, found.slack)


@small_kernel
def drift_of(textures, patch, over):
    """Return a bound of the derivative of the lateral displacement along a unit direction."""
    return over.slope * over.lateral + texture_size(textures, patch) * over.normal_slope


@small_kernel
def curvature_bound(textures, patch, other, over, over_other, half, bound, at):
    """Return the tighter of `bound` and the second-order bounds of the overlap over a box.

    Parameters
    ----------
    patch, other : PATCH records
    over, over_other : TextureBounds
        Over the box, and over the part of the other patch that may be under it.
    half : tuple of float
        Half sides of the box [m], a bound of the lowering's part of f'' [1/m], and the least
        stretch of the other's (u, v) by its parameters, 0 if unknown.
    bound : float
        Order-zero bound [m].
    at : OVERLAP record
        At the centre of the box.
    """
    half_x, half_y, kappa, known = half
    radius = math.sqrt(half_x * half_x + half_y * half_y)
    side, side_other = over.lateral, over_other.lateral
    # Bounds of the derivative of (u, v) along a unit direction of the parameters.
    drift, drift_other = drift_of(textures, patch, over), drift_of(textures, other, over_other)
    fastest, slowest = patch.lateral_max + drift, max(patch.lateral_min - drift, 0.0)
    closest, widest = max(other.lateral_min - drift_other, known), other.lateral_max + drift_other
    g1, g2 = at.other_slope[0], at.other_slope[1]
    # Bound of the change of the other's slope over the box.
    turn = 0.0
    if side > 0.0 or side_other > 0.0:
        if closest == 0.0:
            return box_bound(bound if radius > FINEST_OVERHANG else at.f, EVALUATED, bound, 0.0)
        turn = surface_bend(textures, other, over_other, 1.0) * radius * fastest
        turn *= (1.0 + math.sqrt(g1 * g1 + g2 * g2)) / (closest * closest)
    steepness = math.sqrt(1.0 + g1 * g1 + g2 * g2) + turn
    if patch.texture >= 0:
        facing = over.normal_z + g1 * over.normal_u + g2 * over.normal_v
        spread = steepness * over.normal_change + turn * side
        kappa += _texture_part(texture_size(textures, patch), over, facing, spread, steepness)
    m11, m12, m22 = kappa, 0.0, kappa
    if patch.bulge > 0.0:
        c = patch.bulge / over.max_root
        e11, e12, e22 = patch.ellipse[0], patch.ellipse[1], patch.ellipse[2]
        m11, m12, m22 = m11 - c * e11, m12 - c * e12, m22 - c * e22
    if other.texture >= 0:
        facing = over_other.normal_z - g1 * over_other.normal_u - g2 * over_other.normal_v
        spread = steepness * over_other.normal_change + turn * side_other
        bend = _texture_part(texture_size(textures, other), over_other, facing, spread, steepness)
        if other.bulge > 0.0:
            bend -= other.bulge / over_other.max_root * other.ellipse_min
        ratio = fastest / closest if bend > 0.0 else slowest / widest
        bend *= ratio * ratio
        m11, m22 = m11 + bend, m22 + bend
    elif other.bulge > 0.0:
        if texture_size(textures, patch) * side == 0.0:
            lateral = entries(patch.lateral)
            m11, m12, m22 = less_base(other, (m11, m12, m22), over_other.max_root, lateral)
        else:
            c = other.bulge / over_other.max_root
            less = c * other.ellipse_uv_min * slowest * slowest
            m11, m22 = m11 - less, m22 - less
    # Bound of the limits' distance from their tangents, for the other patch by its parameters.
    slack = concave_border_bend(patch, over.min_root)
    ratio = fastest / max(closest, 1e-9)
    slack += concave_border_bend(other, over_other.min_root) * ratio * ratio
    if side > 0.0:
        slack += surface_bend(textures, patch, over, side) / closest
    if side_other > 0.0:
        slack += surface_bend(textures, other, over_other, side_other) * ratio * ratio / closest
    slack *= 0.5 * radius * radius
    found = quadratic_bound((m11, m12, m22), half_x, half_y, bound, slack, at)
    if patch.bulge > 0.0 or other.bulge > 0.0 or closest == 0.0 or patch.stiffness_map >= 0:
        return found
    third = _third_order(textures, patch, other, over, over_other, fastest, closest)
    return _tighten_by_hessian(found, radius * third, half_x, half_y, bound, at)

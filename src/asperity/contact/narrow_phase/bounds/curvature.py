r"""Bounds of the overlap's second derivatives over a box, and what they bound.

Along a unit direction of X's parameters, with `G = (slope of Y, 1)`,

    f'' = G.base'' + t'' (G.w) + 2 t' (G.w') + t (G.w'') + K[q', q'],

K the curvature of Y's height over (u, v), for which the same expression holds with Y's own
parameters and `(-slope, 1)`. The bases' parts are concave and kept as matrices; every texture's
t, t', t'' are bounded by its pyramid, w' and w'' by the base's curvature. The sum is a matrix M
with `f <= f(c) + f'(c) d + d^T M d / 2` all over the box.
"""

from __future__ import annotations

import math

from asperity._core.kernels import small_kernel
from asperity.contact.narrow_phase.bounds.triplanar import MIX_1, MIX_2, MIX_3
from asperity.contact.narrow_phase.overlap import F_X, F_XX, F_XY, F_Y, F_YY, F
from asperity.contact.narrow_phase.surface_patch import (
    E_MOST,
    EQ,
    LEAST_ROOT,
    MAPPING,
    PZ,
    TEXTURE,
    TRIPLANAR,
    UNIT,
    UV_MOST,
    C,
)

UNSEEN, SEEN, BOUNDED, CONCAVE = 0, 1, 2, 3
"""How f was bounded over a box: without its middle, by it, to the second order, and concave."""


@small_kernel
def row_bend(chart, least):
    """Return how much a border that is not convex bends within a box."""
    if chart[C] == 0.0:
        return 0.0
    low = max(least, 0.5 * chart[LEAST_ROOT])
    return chart[C] * chart[E_MOST] / (low * low * low)


@small_kernel
def shape_bend(
    textures, chart, bend_t, size_bend, slope_t, w1, w2, facing, spread, steepness
):  # fmt: skip
    """Return the part of f'' that a texture makes.

    `facing` is G.w at the middle, and `spread` how much it changes over the box.
    """
    most, least = facing + spread, facing - spread
    bend = bend_t * max(most if bend_t >= 0.0 else least, 0.0)
    if least < 0.0:
        # Seen from behind: there the texture's hollows bend outwards.
        bend = max(bend, 0.0) - least * size_bend
    size = textures.maps[int(chart[TEXTURE])].max_abs_height
    return bend + (2.0 * slope_t * w1 + size * w2) * steepness


@small_kernel
def point_bend(textures, chart, least, slope, size_bend, w1, w2, side):
    """Return a bound of |p''|, the bend of a chart's surface as its parameters are walked over.

    `side` is how much of the normal is looked at: 1, or its part in (u, v).
    """
    bend = row_bend(chart, least)
    if chart[TEXTURE] >= 0.0:
        bend += size_bend * side + 2.0 * slope * w1
        bend += textures.maps[int(chart[TEXTURE])].max_abs_height * w2
    return bend


@small_kernel
def less_base(chart, m11, m12, m22, most, q):
    """Return M less the curvature of Y's smooth base; `q` are the sides of X's map to (u, v)."""
    c = chart[C] / most
    e11, e12, e22 = c * chart[EQ], c * chart[EQ + 1], c * chart[EQ + 2]
    a, b, d, e = q
    m11 -= a * (e11 * a + e12 * d) + d * (e12 * a + e22 * d)
    m12 -= a * (e11 * b + e12 * e) + d * (e12 * b + e22 * e)
    m22 -= b * (e11 * b + e12 * e) + e * (e12 * b + e22 * e)
    return m11, m12, m22


@small_kernel
def _rise(slope, bend, half):
    """Return the largest of `slope d + bend d^2 / 2` over |d| <= half; `slope` is 0 or more."""
    if slope < -bend * half:
        return -0.5 * slope * slope / bend
    return slope * half + 0.5 * bend * half * half


@small_kernel
def second_order(m11, m12, m22, half_x, half_y, bound, loose, at):
    """Return the sharper of `bound` and that of f'' <= M; see `node_bound`."""
    square = max(m11, 0.0) * half_x * half_x + max(m22, 0.0) * half_y * half_y
    second = at[F] + 0.5 * square + abs(m12) * half_x * half_y
    rise = _rise(abs(at[F_X]), m11, half_x) + _rise(abs(at[F_Y]), m22, half_y)
    bound = min(bound, at[F] + rise + abs(m12) * half_x * half_y)
    concave = m11 < 0.0 and m11 * m22 - m12 * m12 > 0.0
    return bound, (CONCAVE if concave else BOUNDED), second, loose


@small_kernel
def _third_of_texture(textures, chart, sizes):
    """Return the largest third derivative of a plane chart's texture; `sizes` of `third_order`."""
    if chart[TEXTURE] < 0.0:
        return 0.0
    third = textures.maps[int(chart[TEXTURE])].max_third_derivative * chart[UV_MOST] ** 3
    if chart[UNIT] == 0.0 and chart[MAPPING] == TRIPLANAR:
        # The product rule for the sum of a_i t_i; w'' has a part along w, of size w1^2.
        a, s, b, w1, w2 = sizes
        third += 3.0 * MIX_1 * w1 * b + 3.0 * (MIX_2 * w1 * w1 + MIX_1 * w2) * s
        third += (MIX_3 * w1 * w1 + 3.0 * MIX_2 * w2 + 3.0 * MIX_1 * w1 * w1) * w1 * a
        third += MIX_1 * 5.0 * w1 * w2 * a
    return third


@small_kernel
def third_order(textures, cx, cy, x, y, side, side_y, fastest, closest):
    """Return a bound of the third derivative of f for two plane charts.

    `x` and `y` are the sizes of height, slope and bend of the texture, of w' and of w'', of X and
    of Y, by each one's own parameters. Of X the product rule for t w; of Y's height over a place
    the rules for a function z of parameters psi that are the inverse of a map: `closest` is how
    fast that goes at least.
    """
    a, s, b, w1, w2 = x
    t, t_y = _third_of_texture(textures, cx, x), _third_of_texture(textures, cy, y)
    w3 = 5.0 * w1 * w2  # of v / |v| with v linear: 15 w1^3, and w2 is 3 w1^2
    more = 3.0 * b * w1 + 3.0 * s * w2 + a * w3
    turn = b * side + 2.0 * s * w1 + a * w2  # how much X's place bends in (u, v)
    a, s, b, w1, w2 = y
    more_y = 3.0 * b * w1 + 3.0 * s * w2 + 5.0 * a * w1 * w2
    turn_y = b * side_y + 2.0 * s * w1 + a * w2
    z1 = s + a * w1 + math.sqrt(cy[PZ] ** 2 + cy[PZ + 1] ** 2)
    z2, z3 = b + 2.0 * s * w1 + a * w2, t_y + more_y
    over = 1.0 / closest
    psi2 = turn_y * over**3
    psi3 = (3.0 * turn_y * turn_y * over + t_y * side_y + more_y) * over**4
    h1, h2 = z1 * over, z2 * over * over + z1 * psi2
    h3 = z3 * over**3 + 3.0 * z2 * over * psi2 + z1 * psi3
    return t + more + h1 * (t * side + more) + 3.0 * h2 * fastest * turn + h3 * fastest**3


@small_kernel
def with_third(found, third, half_x, half_y, bound, loose, at):
    """Return `second_order`'s, or that by the bend at the middle, which changes by `third` at most.

    The latter is sharper on ridges, and in small boxes.
    """
    bent_x, bent_y = at[F_XX] + third, at[F_YY] + third
    other = second_order(bent_x, at[F_XY], bent_y, half_x, half_y, bound, loose, at)
    least = min(found[0], other[0])
    if other[1] > found[1] or (other[1] == found[1] and other[2] < found[2]):
        return least, other[1], other[2], other[3]
    return least, found[1], found[2], found[3]

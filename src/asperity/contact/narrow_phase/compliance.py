"""Contact where stiffness varies over a surface: the point with the largest energy.

With a map of the stiffness k of one surface, the energy of a direction is the maximum of
`k(x) f(x)^2 / 2` over all points x, f the overlap. With the compliance c = 1 / k and the *load*
`L = max f / sqrt(c)` it is L^2 / 2. L is the root of

    max over x of f(x) - L sqrt(c(x)),

which falls as L grows. Newton's method for such a ratio (Dinkelbach 1967) finds it; each step is a
search for the deepest overlap with the mapped surface *lowered* along n by L sqrt(c). Lowered
overlaps behave as overlaps do: their slope is that of the lowered surface, and by the envelope
theorem the derivative of L is that of the overlap at the deepest point, over sqrt(c).
"""

from __future__ import annotations

import math

from asperity._core.kernels import inner_kernel
from asperity.contact.narrow_phase.displaced_surface import height_on
from asperity.contact.narrow_phase.smooth_base import root_at

_LEVEL_SLOPE, _LEVEL_BEND = 1e-12, 1e-6
"""Slope [-] and curvature [1/m] below which lowering counts as constant."""


@inner_kernel
def compliance_at(textures, patch, other, x, y, usual):
    """Return the compliance c of two surfaces in series, and c_x, c_y, c_xx, c_xy, c_yy [m/N, m].

    (x, y) are the parameters of the searched patch, which is the one with a map, if any; `usual` is
    the compliance if neither surface has one.
    """
    c = patch.compliance + other.compliance
    if patch.stiffness_map < 0:
        return (c if c > 0.0 else usual), 0.0, 0.0, 0.0, 0.0, 0.0
    t, t_x, t_y, t_xx, t_xy, t_yy = height_on(
        textures, patch, patch.stiffness_map, x, y, root_at(patch, x, y)
    )
    return c - t, -t_x, -t_y, -t_xx, -t_xy, -t_yy


@inner_kernel
def lower(textures, patch, other, place, search, out):
    """Lower an `OVERLAP` by L sqrt(c), with its derivatives and the slope of the searched surface.

    `place` has the derivatives u_x, u_y, v_x, v_y of the point by the patch's parameters.
    """
    if out.f == -math.inf:
        return
    c, c_x, c_y, c_xx, c_xy, c_yy = compliance_at(
        textures, patch, other, out.x, out.y, search.usual
    )
    root = math.sqrt(c)
    out.f -= search.load * root
    if patch.stiffness_map < 0:
        return
    first, second = 0.5 * search.load / root, 0.25 * search.load / (c * root)
    is_level = first * max(abs(c_x), abs(c_y)) < _LEVEL_SLOPE
    if is_level and first * max(abs(c_xx), abs(c_xy), abs(c_yy)) < _LEVEL_BEND:
        return  # rounding would turn a plateau into peaks
    out.f_x -= first * c_x
    out.f_y -= first * c_y
    out.f_xx -= first * c_xx - second * c_x * c_x
    out.f_xy -= first * c_xy - second * c_x * c_y
    out.f_yy -= first * c_yy - second * c_y * c_y
    u_x, u_y, v_x, v_y = place
    det = u_x * v_y - u_y * v_x
    out.slope[0] -= first * (v_y * c_x - v_x * c_y) / det
    out.slope[1] -= first * (u_x * c_y - u_y * c_x) / det

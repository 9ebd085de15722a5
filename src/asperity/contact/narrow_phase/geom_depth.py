r"""Penetration depth of two bodies along n, and its gradient.

Along `n`, B's low-resolution normal, each body shows charts; the depth is the largest overlap of
any pair. Its gradient in the six directions in which A can move is, by the envelope theorem, that
of the overlap at the deepest place (n fixed in B's frame):

    d(delta)/d(translation) = -m,    d(delta)/d(rotation) = -(r x m),    m = n - s_u u - s_v v,

s the common slope of the two textured surfaces there and r the way from A's centre to the point
of A's surface. Where the deepest place lies on an edge, the slopes differ: on an edge of A, which
moves with A, B's slope counts; on an edge of B, A's; edge on edge, m is perpendicular to both.
"""

from __future__ import annotations

import math

import numpy as np

from asperity._core.kernels import clear, inner_kernel, kernel
from asperity._core.stack import stack_array
from asperity.contact.narrow_phase.displaced_surface import (
    height_on,
    over_base,
    parameters_under,
    root_at,
)
from asperity.contact.narrow_phase.penetration import (
    LOOKED,
    PAIR,
    begin,
    fill_result,
    search_looks,
)
from asperity.contact.narrow_phase.surface_patch import QINV, TEXTURE, charts_of


@inner_kernel
def geom_charts(geometry, g, frame, body, charts_out, first):
    """Fill the charts of a geom from `first` on, as seen along the third row of `frame`.

    `body` (3, 4) is the rotation of its body and its place, seen from the contact's origin.
    Returns how many charts there are then.
    """
    place, axes = stack_array((3,)), stack_array((3, 3))
    b = geometry.body[g]
    for i in range(3):
        place[i] = 0.0
        for k in range(3):
            world = body[k, 3]
            for j in range(3):
                world += body[k, j] * geometry.position[g, j]
            place[i] += frame[i, k] * world
    for i in range(3):
        for c in range(3):
            total = 0.0
            for k in range(3):
                world = 0.0
                for j in range(3):
                    world += body[k, j] * geometry.rotation[g, j, c]
                total += frame[i, k] * world
            axes[i, c] = total
    return charts_of(
        geometry.kind[g], geometry.size[g], place, axes, frame, body,
        geometry.texture[b], float(geometry.mapping[b]), geometry.origin[b],
        geometry.around[g], charts_out, first,
    )  # fmt: skip


@inner_kernel
def all_charts(geometry, geoms, count, frame, body, charts_out):
    """Fill the charts of `count` geoms of one body; see `geom_charts`."""
    made = np.int64(0)
    for n in range(count):
        made = geom_charts(geometry, geoms[n], frame, body, charts_out, made)
    return made


@inner_kernel
def frame_round(n, frame_out):
    """Fill a right-handed frame with rows u, v, n."""
    # The axis that n is least along gives u; for n along z, u and v are x and y.
    if abs(n[0]) < 0.9:
        x, y, z = 1.0 - n[0] * n[0], -n[0] * n[1], -n[0] * n[2]
    else:
        x, y, z = -n[1] * n[0], 1.0 - n[1] * n[1], -n[1] * n[2]
    size = math.sqrt(x * x + y * y + z * z)
    frame_out[0, 0], frame_out[0, 1], frame_out[0, 2] = x / size, y / size, z / size
    frame_out[1, 0] = (n[1] * z - n[2] * y) / size
    frame_out[1, 1] = (n[2] * x - n[0] * z) / size
    frame_out[1, 2] = (n[0] * y - n[1] * x) / size
    frame_out[2, 0], frame_out[2, 1], frame_out[2, 2] = n[0], n[1], n[2]


@inner_kernel
def fill_depth_along(
    textures, geometry, geoms_a, count_a, geoms_b, count_b, body_a, body_b, n, guess,
    tolerance, max_nodes, space, result_out,
):  # fmt: skip
    """Fill a `PENETRATION` record with the depth of A in B along `n`.

    Parameters
    ----------
    textures : Textures
    geometry : Geometry
    geoms_a, geoms_b : int64 arrays
        Geoms of A and of B that may touch; the first `count_a` and `count_b` count.
    body_a, body_b : (3, 4) arrays
        Rotation of each body, and in the last column its place seen from the origin of the
        contact [m]; world axes.
    n : (3,) array
        Unit normal of B towards A, world axes.
    guess : (3,) array
        Where the contact was last, seen from the origin; nan if unknown.
    tolerance : float
        The gap between the bounds that is asked for [m].
    max_nodes : int
        Most boxes to look at.
    space : Workspace
    result_out : PENETRATION record
    """
    # Nothing is allocated here: that would take longer than the small sums below.
    frame = space.frame
    frame_round(n, frame)
    made_b = all_charts(geometry, geoms_b, count_b, frame, body_b, space.charts_b)
    gu = frame[0, 0] * guess[0] + frame[0, 1] * guess[1] + frame[0, 2] * guess[2]
    gv = frame[1, 0] * guess[0] + frame[1, 1] * guess[1] + frame[1, 2] * guess[2]
    for i in range(3):
        frame[2, i] = -n[i]
    made_a = all_charts(geometry, geoms_a, count_a, frame, body_a, space.charts_a)
    begin(space, max_nodes, -np.inf)
    for pair in range(made_a * made_b):
        # To be looked at before any is searched.
        space.looks[pair, 0], space.looks[pair, LOOKED] = np.inf, 0.0
        space.looks[pair, PAIR] = pair
    search_looks(textures, made_b, made_a * made_b, gu, gv, tolerance, space)
    fill_result(textures, made_b, n, tolerance, space, result_out)


@kernel
def depth_along(
    textures, geometry, geoms_a, count_a, geoms_b, count_b, body_a, body_b, n, guess,
    tolerance, max_nodes, space, result_out,
):  # fmt: skip
    """Do what `fill_depth_along` does, called from Python."""
    fill_depth_along(
        textures, geometry, geoms_a, count_a, geoms_b, count_b, body_a, body_b, n, guess,
        tolerance, max_nodes, space, result_out[0],
    )  # fmt: skip


@inner_kernel
def smooth_texture_under(textures, geometry, geoms, count, body, n, place, space, gradient_out):
    """Return the height of B's texture at a place of its smooth surface, over its lowest [m].

    Fills the height's gradient (3,) across n, world axes. `place` (3,) as seen from the origin.
    """
    clear(gradient_out)
    frame = stack_array((3, 3))
    frame_round(n, frame)
    made = all_charts(geometry, geoms, count, frame, body, space.charts_b)
    u = frame[0, 0] * place[0] + frame[0, 1] * place[1] + frame[0, 2] * place[2]
    v = frame[1, 0] * place[0] + frame[1, 1] * place[1] + frame[1, 2] * place[2]
    best, which = -np.inf, -1
    for i in range(made):
        z = over_base(space.charts_b[i], u, v)[0]
        if z > best:
            best, which = z, i
    if which < 0 or space.charts_b[which, TEXTURE] < 0.0:
        return 0.0
    chart = space.charts_b[which]
    x, y = parameters_under(chart, u, v)
    t, t_x, t_y, _, _, _ = height_on(textures, chart, x, y, root_at(chart, x, y))
    g1 = chart[QINV] * t_x + chart[QINV + 2] * t_y
    g2 = chart[QINV + 1] * t_x + chart[QINV + 3] * t_y
    for k in range(3):
        gradient_out[k] = g1 * frame[0, k] + g2 * frame[1, k]
    return t - textures.maps[int(chart[TEXTURE])].lowest

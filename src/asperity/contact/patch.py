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
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity.compiled import clear, inner_kernel, kernel
from asperity.contact.chart import (
    LEVEL,
    QINV,
    RECTANGLE,
    RECTANGLE_HARD,
    SIZE,
    TEXTURE,
    C,
    charts_of,
)
from asperity.contact.climb import FEASIBLE
from asperity.contact.overlap import (
    ABOVE,
    BORDERS,
    LINES,
    ON_X,
    ON_Y,
    OVERLAP_SIZE,
    POINT,
    SLOPE_X,
    SLOPE_Y,
    TURN,
    WORK_SHAPE,
    F,
    X,
    Y,
    borders_at,
)
from asperity.contact.search import (
    BEST,
    LIMIT,
    MOST_TIES,
    NODES,
    SAME,
    SPENT,
    STATE_SIZE,
    TIE,
    TIES,
    UPPER,
    first_look,
    search_pair,
)
from asperity.contact.surface import (
    P_X,
    P_Y,
    height_on,
    over_base,
    parameters_under,
    root_at,
    surface_at,
)

CERTIFIED, BUDGET_SPENT = 0, 1
"""Whether the gap is within the tolerance, or the search ran out of nodes before it was."""

# What a search leaves; one row of numbers.
DEPTH, GAP, COUNT_NODES, STATUS, COUNT_TIES = 0, 1, 2, 3, 4
POINT_X, M_X, MOMENT = 5, 8, 11  # place on A, m and the mean of place x m; all seen from the origin
RESULT_SIZE = 14


class Workspace(NamedTuple):
    """What the search writes to, allocated once."""

    charts_a: NDArray[np.float64]
    charts_b: NDArray[np.float64]
    state: NDArray[np.float64]
    best: NDArray[np.float64]
    ties: NDArray[np.float64]
    nodes: NDArray[np.float64]
    work: NDArray[np.float64]
    looks: NDArray[np.float64]
    at: NDArray[np.float64]
    frame: NDArray[np.float64]
    vectors: NDArray[np.float64]
    near: NDArray[np.float64]


def workspace(geoms: int) -> Workspace:
    """Return room for the search between bodies of at most `geoms` geoms each."""
    return Workspace(
        np.zeros((3 * geoms, SIZE)),
        np.zeros((3 * geoms, SIZE)),
        np.zeros(STATE_SIZE),
        np.zeros(OVERLAP_SIZE + 1),
        np.zeros((MOST_TIES, OVERLAP_SIZE + 2)),
        np.zeros((1028, 5)),
        np.zeros(WORK_SHAPE),
        np.zeros((9 * geoms * geoms, 3)),
        np.zeros(OVERLAP_SIZE),
        np.zeros((3, 3)),
        np.zeros((10, 3)),
        np.zeros((2, 3, 4)),
    )


@inner_kernel
def _charts(geometry, geoms, count, frame, body, charts_out):
    """Fill the charts of `count` geoms of one body, as seen along the third row of `frame`."""
    made = np.int64(0)
    place, axes = np.empty(3), np.empty((3, 3))
    for n in range(count):
        g = geoms[n]
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
        made = charts_of(
            geometry.kind[g], geometry.size[g], place, axes, frame, body,
            geometry.texture[b], float(geometry.mapping[b]), geometry.origin[b],
            geometry.around[g], charts_out, made,
        )  # fmt: skip
    return made


@inner_kernel
def _hidden(chart):
    """Return whether the height over a place has to be found by iteration."""
    return chart[TEXTURE] >= 0.0 and chart[LEVEL] == 0.0


@inner_kernel
def walks_on_a(a, b):
    """Return whether the search walks over A's chart: over the one that is harder to look up."""
    if _hidden(a) != _hidden(b):
        return _hidden(a)
    if _hidden(a):
        return True
    if b[TEXTURE] >= 0.0 or a[TEXTURE] >= 0.0:
        return b[TEXTURE] < 0.0
    return a[C] == 0.0


@inner_kernel
def _edge(borders, count, code):
    """Return the direction across the edge of a chart that a place lies on, if it lies on one."""
    for i in range(count):
        if borders[i, 3] % 4.0 == code and borders[i, 0] > -10.0 * FEASIBLE:
            return True, borders[i, 1], borders[i, 2]
    return False, 0.0, 0.0


@inner_kernel
def _on_rectangle(chart, x, y):
    """Return whether (x, y) lies on a side of a chart's rectangle that is an edge."""
    if chart[RECTANGLE_HARD] == 0.0:
        return False, 0.0, 0.0
    near = 10.0 * FEASIBLE
    if x < chart[RECTANGLE] + near or x > chart[RECTANGLE + 1] - near:
        return True, 1.0, 0.0
    if y < chart[RECTANGLE + 2] + near or y > chart[RECTANGLE + 3] - near:
        return True, 0.0, 1.0
    return False, 0.0, 0.0


@inner_kernel
def _met_before(ties, t, count):
    """Return whether a deeper tie is the same place: charts share their common edge."""
    for i in range(count):
        near = abs(ties[i, POINT] - ties[t, POINT]) + abs(ties[i, POINT + 1] - ties[t, POINT + 1])
        deeper = ties[i, F] > ties[t, F] or (ties[i, F] == ties[t, F] and i < t)
        if near < SAME and i != t and deeper:
            return True
    return False


@inner_kernel
def _slope_normal(textures, cx, cy, x_is_a, at, work, out):
    """Fill m = (-s_u, -s_v, 1) in the contact frame at a place of `overlap_at`."""
    borders, point = work[BORDERS:LINES], work[0]
    count = borders_at(cx, cy, at, borders)
    edge_x, across_x, across_y = _on_rectangle(cx, at[X], at[Y])
    if not edge_x:
        edge_x, across_x, across_y = _edge(borders, count, 1.0)
    edge_y, over_x, over_y = _edge(borders, count, 2.0)
    sign_x, sign_y = (-1.0, 1.0) if x_is_a else (1.0, -1.0)
    out[2] = 1.0
    if edge_x and edge_y:
        # Both edges in (u, v, n); m is perpendicular to them.
        surface_at(textures, cx, at[X], at[Y], point)
        e = (
            across_x * point[P_Y] - across_y * point[P_X],
            across_x * point[P_Y + 1] - across_y * point[P_X + 1],
            sign_x * (across_x * point[P_Y + 2] - across_y * point[P_X + 2]),
        )
        det = at[TURN] * at[TURN + 3] - at[TURN + 1] * at[TURN + 2]
        g_a = (over_x * at[TURN + 3] - over_y * at[TURN + 2]) / det
        g_b = (over_y * at[TURN] - over_x * at[TURN + 1]) / det
        surface_at(textures, cy, at[ON_X], at[ON_Y], point)
        f = (
            g_a * point[P_Y] - g_b * point[P_X],
            g_a * point[P_Y + 1] - g_b * point[P_X + 1],
            sign_y * (g_a * point[P_Y + 2] - g_b * point[P_X + 2]),
        )
        up = e[0] * f[1] - e[1] * f[0]
        size = math.sqrt((e[0] ** 2 + e[1] ** 2) * (f[0] ** 2 + f[1] ** 2))
        if abs(up) > 1e-6 * size:
            out[0] = (e[1] * f[2] - e[2] * f[1]) / up
            out[1] = (e[2] * f[0] - e[0] * f[2]) / up
            return
    # An edge of one body slides on the other: the other's slope counts.
    from_y = edge_x if edge_x != edge_y else x_is_a
    slope, sign = (SLOPE_Y, sign_y) if from_y else (SLOPE_X, sign_x)
    out[0], out[1] = -sign * at[slope], -sign * at[slope + 1]


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


@kernel
def depth_along(
    textures, geometry, geoms_a, count_a, geoms_b, count_b, body_a, body_b, n, guess,
    tolerance, max_nodes, space, result_out,
):  # fmt: skip
    """Fill `result_out` (14,) with the depth of A in B along `n`, and where; see `DEPTH`, ...

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
    result_out : (14,) array
        Depth [m] (-inf: nothing overlaps along n), gap between the bounds [m], nodes looked at,
        status, number of places that are equally deep; their mean place on A's surface, m, and
        the mean of place x m, seen from the origin in world axes.
    """
    # Nothing is allocated here: that would take longer than the small sums below.
    frame = space.frame
    frame_round(n, frame)
    made_b = _charts(geometry, geoms_b, count_b, frame, body_b, space.charts_b)
    gu = frame[0, 0] * guess[0] + frame[0, 1] * guess[1] + frame[0, 2] * guess[2]
    gv = frame[1, 0] * guess[0] + frame[1, 1] * guess[1] + frame[1, 2] * guess[2]
    for i in range(3):
        frame[2, i] = -n[i]
    made_a = _charts(geometry, geoms_a, count_a, frame, body_a, space.charts_a)
    state = space.state
    state[BEST], state[UPPER], state[NODES] = -np.inf, -np.inf, 0.0
    state[LIMIT], state[TIES], state[SPENT] = max_nodes, 0.0, 0.0
    space.best[OVERLAP_SIZE] = -1.0
    looks = space.looks
    for i in range(made_a):
        for j in range(made_b):
            a, b = space.charts_a[i], space.charts_b[j]
            pair = i * made_b + j
            x, y = (a, b) if walks_on_a(a, b) else (b, a)
            first_look(
                textures, x, y, pair, gu, gv, state, space.best, space.ties, space.work, space.at,
                looks[pair],
            )  # fmt: skip
    while True:
        # The most promising pair first: what it finds saves work in the others.
        pair = np.int64(0)  # a plain 0 is a type of its own, and all below is compiled for it too
        for k in range(1, made_a * made_b):
            if looks[k, 0] > looks[pair, 0]:
                pair = k
        if made_a * made_b == 0 or looks[pair, 0] <= state[BEST] - TIE or looks[pair, 0] == -np.inf:
            break
        above, looks[pair, 0] = looks[pair, 0], -np.inf
        a, b = space.charts_a[pair // made_b], space.charts_b[pair % made_b]
        x, y = (a, b) if walks_on_a(a, b) else (b, a)
        search_pair(
            textures, x, y, pair, looks[pair, 1], looks[pair, 2], above, tolerance, state,
            space.best, space.ties, space.nodes, space.work, space.at,
        )  # fmt: skip
    clear(result_out)
    result_out[DEPTH] = state[BEST]
    result_out[COUNT_NODES] = state[NODES]
    if state[BEST] == -np.inf:
        return
    gap = max(state[UPPER] - state[BEST], 0.0)
    result_out[GAP] = gap
    result_out[STATUS] = CERTIFIED if gap <= tolerance else BUDGET_SPENT
    work, m, p, q = space.work, space.vectors[0], space.vectors[1], space.vectors[2]
    spread = 0.0
    for t in range(int(state[TIES])):
        at = space.ties[t]
        if at[F] >= state[BEST] - TIE and not _met_before(space.ties, t, int(state[TIES])):
            spread += at[OVERLAP_SIZE + 1]
    total = 0.0
    for t in range(int(state[TIES])):
        at = space.ties[t]
        if at[F] < state[BEST] - TIE or _met_before(space.ties, t, int(state[TIES])):
            continue
        # Where an area or a line is equally deep, single places do not count.
        share = at[OVERLAP_SIZE + 1] if spread > 0.0 else 1.0
        if share == 0.0:
            continue
        i, j = int(at[OVERLAP_SIZE]) // made_b, int(at[OVERLAP_SIZE]) % made_b
        a, b = space.charts_a[i], space.charts_b[j]
        x_is_a = walks_on_a(a, b)
        x, y = (a, b) if x_is_a else (b, a)
        _slope_normal(textures, x, y, x_is_a, at, work, m)
        height = -at[POINT + 2] if x_is_a else -at[ABOVE]
        result_out[COUNT_TIES] += 1.0
        total += share
        for k in range(3):
            p[k] = frame[0, k] * at[POINT] + frame[1, k] * at[POINT + 1] + n[k] * height
            q[k] = frame[0, k] * m[0] + frame[1, k] * m[1] + n[k]
        for k in range(3):
            result_out[POINT_X + k] += share * p[k]
            result_out[M_X + k] += share * q[k]
            one, two = (k + 1) % 3, (k + 2) % 3
            result_out[MOMENT + k] += share * (p[one] * q[two] - p[two] * q[one])
    for k in range(POINT_X, RESULT_SIZE):
        result_out[k] /= total


@inner_kernel
def smooth_texture_under(textures, geometry, geoms, count, body, n, place, space, gradient_out):
    """Return the height of B's texture at a place of its smooth surface, over its lowest [m].

    Fills the height's gradient (3,) across n, world axes. `place` (3,) as seen from the origin.
    """
    clear(gradient_out)
    frame = np.empty((3, 3))
    frame_round(n, frame)
    made = _charts(geometry, geoms, count, frame, body, space.charts_b)
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
    return t - textures.scales[int(chart[TEXTURE]), 6]

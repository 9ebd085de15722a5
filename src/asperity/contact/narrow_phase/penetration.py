r"""The deepest overlap of many pairs of charts, and what follows from its place.

The gradient of the depth is that of the overlap at the deepest place: see `patch`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity._core.kernels import inner_kernel, small_kernel
from asperity._core.records import clear_record
from asperity.contact.narrow_phase.branch_and_bound import (
    MOST_TIES,
    SAME,
    TIE,
    first_look,
    search_pair,
)
from asperity.contact.narrow_phase.displaced_surface import P_X, P_Y, surface_at
from asperity.contact.narrow_phase.incumbent import (
    BEST,
    NODES,
    STATE_SIZE,
    TIES,
    UPPER,
    begin_state,
)
from asperity.contact.narrow_phase.newton_ascent import FEASIBLE
from asperity.contact.narrow_phase.overlap import (
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
from asperity.contact.narrow_phase.records import BUDGET_SPENT, CERTIFIED
from asperity.contact.narrow_phase.surface_patch import (
    LEVEL,
    RECTANGLE,
    RECTANGLE_HARD,
    SIZE,
    TEXTURE,
    C,
)

# Of a pair of charts before it is searched: an upper bound, where the smooth bases overlap most.
LOOKED, PAIR = 3, 4  # whether it has been climbed once; number of A's chart * stride + that of B's
LOOK_BOX = 5  # of plane charts: the part of X's parameters over which they overlap
LOOK_COVERS = 9
"""Of planes of which one is rough: least and largest u, least and largest v where both may be."""
LOOK_SIZE = 13


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


def workspace(charts: int, pairs: int) -> Workspace:
    """Return room for the search among so many charts of one body, and pairs of them."""
    return Workspace(
        np.zeros((charts, SIZE)),
        np.zeros((charts, SIZE)),
        np.zeros(STATE_SIZE),
        np.zeros(OVERLAP_SIZE + 1),
        np.zeros((MOST_TIES, OVERLAP_SIZE + 2)),
        np.zeros((1037, 5)),
        np.zeros(WORK_SHAPE),
        np.zeros((pairs, LOOK_SIZE)),
        np.zeros(OVERLAP_SIZE),
        np.zeros((3, 3)),
        np.zeros((10, 3)),
        np.zeros((2, 3, 4)),
    )


@inner_kernel
def begin(space, max_nodes, floor):
    """Forget what an earlier search found; look for places deeper than `floor` [m] only."""
    begin_state(space.state, max_nodes, floor)
    space.best[OVERLAP_SIZE] = -1.0


@inner_kernel
def search_looks(textures, stride, count, guess_u, guess_v, tolerance, space):
    """Search the first `count` pairs of `space.looks`, the most promising first."""
    state, looks = space.state, space.looks
    while count > 0:
        k = np.int64(0)  # a plain 0 is a type of its own, and all below is compiled for it too
        for i in range(1, count):
            if looks[i, 0] > looks[k, 0]:
                k = i
        above = looks[k, 0]
        if above <= state[BEST] - TIE or above == -np.inf:
            break
        pair = int(looks[k, PAIR])
        a, b = space.charts_a[pair // stride], space.charts_b[pair % stride]
        x, y = (a, b) if walks_on_a(a, b) else (b, a)
        if looks[k, LOOKED] == 0.0:
            looks[k, LOOKED] = 1.0
            first_look(
                textures, x, y, pair, guess_u, guess_v, state, space.best, space.ties,
                space.work, space.at, looks[k],
            )  # fmt: skip
            looks[k, 0] = min(looks[k, 0], above)
            continue
        looks[k, 0] = -np.inf
        search_pair(
            textures, x, y, pair, looks[k, 1], looks[k, 2], above, tolerance, state,
            space.best, space.ties, space.nodes, space.work, space.at,
        )  # fmt: skip


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
    """Return whether (x, y) lies on a side of a chart's rectangle that is an edge, and outwards."""
    near = 10.0 * FEASIBLE
    for axis in range(2 if chart[RECTANGLE_HARD] != 0.0 else 0):
        place = x if axis == 0 else y
        low, high = chart[RECTANGLE + 2 * axis], chart[RECTANGLE + 2 * axis + 1]
        if place < low + near or place > high - near:
            sign = 1.0 if place > high - near else -1.0
            return True, (sign if axis == 0 else 0.0), (sign if axis == 1 else 0.0)
    return False, 0.0, 0.0


@inner_kernel
def _same_place(one, other):
    """Return whether two ties are at one place."""
    return abs(one[POINT] - other[POINT]) + abs(one[POINT + 1] - other[POINT + 1]) < SAME


@inner_kernel
def _met_before(ties, t, count):
    """Return whether a deeper tie is the same place: charts share their common edge."""
    for i in range(count):
        deeper = ties[i, F] > ties[t, F] or (ties[i, F] == ties[t, F] and i < t)
        if i != t and deeper and _same_place(ties[i], ties[t]):
            return True
    return False


@small_kernel
def _outwards(edge, u, v):
    """Return the unit vector of (u, v) across an edge, on the side that (u, v) is on."""
    size = math.sqrt(edge[0] * edge[0] + edge[1] * edge[1])
    if edge[1] * u - edge[0] * v < 0.0:
        size = -size
    return edge[1] / size, -edge[0] / size


@inner_kernel
def _slope_normal(textures, cx, cy, x_is_a, at, work, out):
    """Fill m = (-s_u, -s_v, 1) in the contact frame at a place of `overlap_at`.

    Returns whether it is certain. Where two edges are parallel and leave each other's facet on the
    same side, what slopes there may be depends on the facets beyond the edges.
    """
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
        x_u = across_x * point[P_X] + across_y * point[P_Y]
        x_v = across_x * point[P_X + 1] + across_y * point[P_Y + 1]
        e = (
            across_x * point[P_Y] - across_y * point[P_X],
            across_x * point[P_Y + 1] - across_y * point[P_X + 1],
            sign_x * (across_x * point[P_Y + 2] - across_y * point[P_X + 2]),
        )
        det = at[TURN] * at[TURN + 3] - at[TURN + 1] * at[TURN + 2]
        g_a = (over_x * at[TURN + 3] - over_y * at[TURN + 2]) / det
        g_b = (over_y * at[TURN] - over_x * at[TURN + 1]) / det
        surface_at(textures, cy, at[ON_X], at[ON_Y], point)
        y_u = g_a * point[P_X] + g_b * point[P_Y]
        y_v = g_a * point[P_X + 1] + g_b * point[P_Y + 1]
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
            return True
        out_u, out_v = _outwards(e, x_u, x_v)
        over_u, over_v = _outwards(f, y_u, y_v)
        fall_x = at[SLOPE_X] * out_u + at[SLOPE_X + 1] * out_v
        fall_y = at[SLOPE_Y] * over_u + at[SLOPE_Y + 1] * over_v
        certain = out_u * over_u + out_v * over_v < 0.0
        # Beyond its edge either falls faster than before it: the one that falls faster counts.
        from_y = fall_y < fall_x if certain else x_is_a
    else:
        # An edge of one body slides on the other: the other's slope counts.
        certain, from_y = True, edge_x if edge_x != edge_y else x_is_a
    slope, sign = (SLOPE_Y, sign_y) if from_y else (SLOPE_X, sign_x)
    out[0], out[1] = -sign * at[slope], -sign * at[slope + 1]
    return certain


@inner_kernel
def _slope_of_tie(textures, stride, at, space, out):
    """Fill m of a tie; return whether it is certain, and whether it was A that was walked on."""
    pair = int(at[OVERLAP_SIZE])
    a, b = space.charts_a[pair // stride], space.charts_b[pair % stride]
    x_is_a = walks_on_a(a, b)
    x, y = (a, b) if x_is_a else (b, a)
    return _slope_normal(textures, x, y, x_is_a, at, space.work, out), x_is_a


@inner_kernel
def fill_result(textures, stride, n, tolerance, space, result_out):
    """Fill a `PENETRATION` record with the result of a search."""
    state, frame = space.state, space.frame
    clear_record(result_out)
    if space.best[OVERLAP_SIZE] < 0.0:
        state[BEST] = -np.inf  # nothing was found, whatever was looked for
    result_out.depth = state[BEST]
    result_out.nodes = int(state[NODES])
    if state[BEST] == -np.inf:
        return
    gap = max(state[UPPER] - state[BEST], 0.0)
    result_out.gap = gap
    result_out.status = CERTIFIED if gap <= tolerance else BUDGET_SPENT
    m, p, q = space.vectors[0], space.vectors[1], space.vectors[2]
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
        certain, x_is_a = _slope_of_tie(textures, stride, at, space, m)
        for other in range(0 if certain else int(state[TIES])):
            # The same place as seen from a facet beside it.
            if certain or other == t or space.ties[other, F] < state[BEST] - TIE:
                continue
            if _same_place(space.ties[other], at):
                certain, _ = _slope_of_tie(textures, stride, space.ties[other], space, p)
                for k in range(3 if certain else 0):
                    m[k] = p[k]
        height = -at[POINT + 2] if x_is_a else -at[ABOVE]
        result_out.ties += 1
        total += share
        for k in range(3):
            p[k] = frame[0, k] * at[POINT] + frame[1, k] * at[POINT + 1] + n[k] * height
            q[k] = frame[0, k] * m[0] + frame[1, k] * m[1] + n[k]
        for k in range(3):
            result_out.point[k] += share * p[k]
            result_out.slope_normal[k] += share * q[k]
            one, two = (k + 1) % 3, (k + 2) % 3
            result_out.moment[k] += share * (p[one] * q[two] - p[two] * q[one])
    for k in range(3):
        result_out.point[k] /= total
        result_out.slope_normal[k] /= total
        result_out.moment[k] /= total

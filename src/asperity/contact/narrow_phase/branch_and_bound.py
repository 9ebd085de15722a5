"""The deepest overlap of two charts, by branch and bound.

A box of chart X's parameters is either closed, because its upper bound does not exceed what has
been found already, or quartered. The deepest place has been climbed to, so the result is a local
maximum to the grain of the numbers, and no other place is deeper by more than the gap.

Places within a nanometre of the deepest count as equally deep: flat on flat, or textures in
register, have many, and the force acts at their middle. So boxes that may hold one are divided
further, though not for ever: down to a twentieth of the contact.
"""

from __future__ import annotations

import math

import numpy as np

from asperity._core.kernels import inner_kernel, small_kernel
from asperity.contact.narrow_phase.bounds.borders import beyond_rows
from asperity.contact.narrow_phase.bounds.curvature import BOUNDED, CONCAVE, UNSEEN
from asperity.contact.narrow_phase.bounds.overlap import ball_bound, base_bound, node_bound
from asperity.contact.narrow_phase.bounds.plane_overlap import plane_bound
from asperity.contact.narrow_phase.bounds.texture import sideways
from asperity.contact.narrow_phase.displaced_surface import parameters_under
from asperity.contact.narrow_phase.flat_on_flat import flat_best, is_straight
from asperity.contact.narrow_phase.incumbent import BEST, JUDGED, NODES, TIES, UPPER, is_spent
from asperity.contact.narrow_phase.newton_ascent import climb, is_within
from asperity.contact.narrow_phase.overlap import (
    BORDERS,
    F_X,
    F_XX,
    F_XY,
    F_Y,
    F_YY,
    LINES,
    OVERLAP_SIZE,
    F,
    X,
    Y,
    borders_at,
    overlap_at,
)
from asperity.contact.narrow_phase.sphere_on_plane import is_ball_over_plate
from asperity.contact.narrow_phase.surface_patch import (
    B0,
    B1,
    B2,
    LEVEL,
    MAPPING,
    PLANAR,
    PZ,
    QINV,
    RECTANGLE,
    TEXTURE,
    TOP,
    C,
    E,
    O,
    Q,
)
from asperity.contact.narrow_phase.tighten import sharpest_bound

TIE = 1e-9
"""Places that are less deep than the deepest by at most this count as equally deep [m]."""
MOST_TIES = 1024
SAME = 1e-6
"""Places closer than this are one [m]."""
FINEST_TIE = 1.0 / 20.0
_STACK = 1024
ANY, BALL, PLANES = 0, 1, 2
"""What charts are judged: any, a ball over a level plate, two planes."""
_PLATEAU = 1e-7  # slopes below this are none
_GRAIN = 1e-12  # a bound this close to its own maximum says that there is no more [m]
SMALLEST = 1e-10  # boxes are not divided below this [m]


@inner_kernel
def _extent(chart):
    """Return the half sides in (u, v) of what a chart covers, and its middle."""
    if chart[C] == 0.0 or chart[E] == 0.0:
        x = 0.5 * (chart[RECTANGLE] + chart[RECTANGLE + 1])
        y = 0.5 * (chart[RECTANGLE + 2] + chart[RECTANGLE + 3])
        half_x, half_y = chart[RECTANGLE + 1] - x, chart[RECTANGLE + 3] - y
    else:
        x = y = 0.0
        half_x, half_y = chart[RECTANGLE + 1], chart[RECTANGLE + 3]
    u, v = (
        chart[O] + chart[Q] * x + chart[Q + 1] * y,
        chart[O + 1] + chart[Q + 2] * x + chart[Q + 3] * y,
    )
    half_u = abs(chart[Q]) * half_x + abs(chart[Q + 1]) * half_y
    half_v = abs(chart[Q + 2]) * half_x + abs(chart[Q + 3]) * half_y
    return u, v, half_u, half_v


@inner_kernel
def window_of(cx, cy, shift):
    """Return the box of X's parameters that Y covers, as far as X goes."""
    u, v, half_u, half_v = _extent(cy)
    half_u, half_v = half_u + shift, half_v + shift
    x, y = parameters_under(cx, u, v)
    i, j, k, m = cx[QINV], cx[QINV + 1], cx[QINV + 2], cx[QINV + 3]
    half_x, half_y = abs(i) * half_u + abs(j) * half_v, abs(k) * half_u + abs(m) * half_v
    return (
        max(x - half_x, cx[RECTANGLE]), min(x + half_x, cx[RECTANGLE + 1]),
        max(y - half_y, cx[RECTANGLE + 2]), min(y + half_y, cx[RECTANGLE + 3]),
    )  # fmt: skip


@small_kernel
def _under_ball(textures, cx, cy, ax, ay, window, enough):
    """Return the part of the window over which a ball can be deeper in a plate than `enough`.

    Farther from the ball's lowest point even the texture's highest does not reach it.
    """
    high = textures.maps[int(cx[TEXTURE])].max_abs_height
    root = (enough - cx[O + 2] - cy[O + 2] - high) / cy[C]
    if not root > 0.0:
        return window
    reach = math.sqrt(max(1.0 - root * root, 0.0) / cy[E])
    x0, x1, y0, y1 = window
    return max(x0, ax - reach), min(x1, ax + reach), max(y0, ay - reach), min(y1, ay + reach)


@inner_kernel
def _blocks(textures, cx, window, boxes_out):
    """Fill start boxes that cover the window; blocks of the texture's pyramid where they fit.

    Bounds over a whole block are read at one place, and are sharper than over any other box.
    """
    x0, x1, y0, y1 = window
    boxes_out[0, 0], boxes_out[0, 1], boxes_out[0, 2], boxes_out[0, 3] = x0, x1, y0, y1
    if cx[LEVEL] == 0.0 or cx[TEXTURE] < 0.0 or cx[MAPPING] != PLANAR:
        return 1
    k = int(cx[TEXTURE])
    along = abs(cx[B1 + 1]) < 1e-12 and abs(cx[B2]) < 1e-12
    if not along and not (abs(cx[B1]) < 1e-12 and abs(cx[B2 + 1]) < 1e-12):
        return 1
    a, b = (0, 1) if along else (1, 0)
    # Cells along x and along y: place = start + step * x.
    scale = textures.maps[k].cells_per_metre
    step_x, step_y = cx[B1 + a] * scale[a], cx[B2 + b] * scale[b]
    start_x = cx[B0 + a] * scale[a] + 0.5
    start_y = cx[B0 + b] * scale[b] + 0.5
    size = max(abs(step_x) * (x1 - x0), abs(step_y) * (y1 - y0))
    block = 1.0
    while 2.0 * block < size:
        block *= 2.0
    low_x = min(start_x + step_x * x0, start_x + step_x * x1)
    low_y = min(start_y + step_y * y0, start_y + step_y * y1)
    first_x, first_y = math.floor(low_x / block) * block, math.floor(low_y / block) * block
    count = 0
    for i in range(3):
        for j in range(3):
            c0, r0 = first_x + i * block, first_y + j * block
            p0, p1 = (c0 - start_x) / step_x, (c0 + block - start_x) / step_x
            q0, q1 = (r0 - start_y) / step_y, (r0 + block - start_y) / step_y
            p0, p1 = max(min(p0, p1), cx[RECTANGLE]), min(max(p0, p1), cx[RECTANGLE + 1])
            q0, q1 = max(min(q0, q1), cx[RECTANGLE + 2]), min(max(q0, q1), cx[RECTANGLE + 3])
            if p0 < x1 and p1 > x0 and q0 < y1 and q1 > y0:
                boxes_out[count, 0], boxes_out[count, 1] = p0, p1
                boxes_out[count, 2], boxes_out[count, 3] = q0, q1
                count += 1
    return count


@inner_kernel
def _keep(at, pair, weight, state, best, ties):
    """Note a place that has been climbed to: the deepest so far, or one as deep.

    `weight` is the area that it stands for, where it is one of a plateau or of a ridge.
    """
    depth = at[F]
    if depth < state[BEST] - TIE:
        return
    bend = at[F_XX] + at[F_YY]
    if at[F_XX] * at[F_YY] - at[F_XY] * at[F_XY] > 1e-6 * bend * bend:
        weight = 0.0  # a peak, whatever box it was found from
    if depth > state[BEST]:
        state[BEST] = depth
        for i in range(OVERLAP_SIZE):
            best[i] = at[i]
        best[OVERLAP_SIZE] = pair
    count = int(state[TIES])
    for i in range(count):
        near = abs(ties[i, X] - at[X]) < SAME and abs(ties[i, Y] - at[Y]) < SAME
        if near and ties[i, OVERLAP_SIZE] == pair and ties[i, F] >= state[BEST] - TIE:
            if depth > ties[i, F]:
                for j in range(OVERLAP_SIZE):
                    ties[i, j] = at[j]
            ties[i, OVERLAP_SIZE + 1] = max(ties[i, OVERLAP_SIZE + 1], weight)
            return
    if count == MOST_TIES:
        # Make room: drop what has turned out less deep.
        kept = 0
        for i in range(count):
            if ties[i, F] >= state[BEST] - TIE:
                for j in range(OVERLAP_SIZE + 2):
                    ties[kept, j] = ties[i, j]
                kept += 1
        count = kept
        if count == MOST_TIES:
            return
    for i in range(OVERLAP_SIZE):
        ties[count, i] = at[i]
    ties[count, OVERLAP_SIZE], ties[count, OVERLAP_SIZE + 1] = pair, weight
    state[TIES] = count + 1


@inner_kernel
def _clear_of_borders(cx, cy, at, box, work):
    """Return whether a box round a place touches no border, the borders being straight."""
    borders = work[BORDERS:LINES]
    half_x, half_y = 0.5 * (box[1] - box[0]), 0.5 * (box[3] - box[2])
    for i in range(borders_at(cx, cy, at, borders)):
        reach = abs(borders[i, 1]) * half_x + abs(borders[i, 2]) * half_y
        if borders[i, 0] + reach > 0.0:
            return False
    return True


@inner_kernel
def _base_best(textures, cx, cy, window, work, at):
    """Return where on X the smooth bases overlap most, or nearly so."""
    u, v, _, _ = _extent(cy)
    x, y = parameters_under(cx, u, v)
    x0, x1, y0, y1 = window
    if cx[C] == cx[PZ] == cx[PZ + 1] == 0.0 and cy[PZ] == cy[PZ + 1] == 0.0:
        # Both are level there.
        return min(max(x, x0), x1), min(max(y, y0), y1)
    texture_x, texture_y = cx[TEXTURE], cy[TEXTURE]
    cx[TEXTURE], cy[TEXTURE] = -1.0, -1.0
    climb(textures, cx, cy, window, x, y, max(x1 - x0, y1 - y0), work, at)
    cx[TEXTURE], cy[TEXTURE] = texture_x, texture_y
    return at[X], at[Y]


@small_kernel
def _shift(textures, cx, cy):
    """Return how far the textures move points sideways at most [m]."""
    return sideways(textures, cx) + sideways(textures, cy)


@small_kernel
def _rough(textures, cx, cy):
    """Return how far the textures rise above the smooth bases at most [m]."""
    rough = 0.0
    for chart in (cx, cy):
        if chart[TEXTURE] >= 0.0:
            rough += max(min(textures.maps[int(chart[TEXTURE])].max_abs_height, chart[TOP]), 0.0)
    return rough


@inner_kernel
def quick_bound(textures, cx, cy):
    """Return an upper bound of the overlap of two charts, -inf if they do not meet."""
    shift = _shift(textures, cx, cy)
    x0, x1, y0, y1 = window_of(cx, cy, shift)
    if not (x0 <= x1 and y0 <= y1):
        return -np.inf
    x, y = 0.5 * (x0 + x1), 0.5 * (y0 + y1)
    if beyond_rows(cx, x, y, x1 - x, y1 - y):
        return -np.inf
    smooth, g1, g2 = base_bound(cx, cy, x, y, x0, x1, y0, y1, shift)
    return smooth + _rough(textures, cx, cy) * math.sqrt(1.0 + g1 * g1 + g2 * g2)


@inner_kernel
def first_look(
    textures, cx, cy, pair, guess_u, guess_v, state, best, ties, work, at, out
):  # fmt: skip
    """Climb once, so that all pairs of charts know a good depth before any of them is searched.

    `(guess_u, guess_v)` is a place in the contact frame to begin at; the last contact, say, nan
    if there was none. Fills `out` (3,): an upper bound of the depth, -inf where nothing overlaps,
    and where on X the smooth bases overlap most.
    """
    shift = _shift(textures, cx, cy)
    window = window_of(cx, cy, shift)
    x0, x1, y0, y1 = window
    out[0] = -np.inf
    if not (x0 <= x1 and y0 <= y1):
        return
    if is_straight(cx) and is_straight(cy):
        # Nothing is left to be searched.
        found, area = flat_best(textures, cx, cy, TIE, work, at)
        if found:
            state[NODES] += 1.0
            state[UPPER] = max(state[UPPER], at[F])
            _keep(at, pair, area, state, best, ties)
        return
    span = max(x1 - x0, y1 - y0)
    ax, ay = _base_best(textures, cx, cy, window, work, at)
    out[1], out[2] = ax, ay
    smooth, g1, g2 = base_bound(cx, cy, ax, ay, x0, x1, y0, y1, shift)
    if smooth == -np.inf:
        return
    out[0] = smooth + _rough(textures, cx, cy) * math.sqrt(1.0 + g1 * g1 + g2 * g2)
    gx, gy = parameters_under(cx, guess_u, guess_v)
    if not (x0 <= gx <= x1 and y0 <= gy <= y1):
        gx, gy = ax, ay
    if climb(textures, cx, cy, window, gx, gy, 0.1 * span, work, at):
        _keep(at, pair, 0.0, state, best, ties)


@inner_kernel
def judge(
    textures, cx, cy, pair, ax, ay, window, box, bound, shift, how, state, best, ties, work, at
):  # fmt: skip
    """Return a bound of the overlap over a box that has to be divided further, else -inf.

    `bound` is that of the box it comes from, or of `PLANES` its own. What is found on the way is
    kept.
    """
    p0, p1, q0, q1 = box
    state[NODES] += 1.0
    enough = state[BEST] - TIE
    middle_x, middle_y = 0.5 * (p0 + p1), 0.5 * (q0 + q1)
    state[JUDGED] = -np.inf
    if beyond_rows(cx, middle_x, middle_y, p1 - middle_x, q1 - middle_y):
        return -np.inf
    if how == BALL:
        high, kind, second, loose = ball_bound(textures, cx, cy, ax, ay, box, enough, at)
    elif how == PLANES:
        high, kind, second, loose = plane_bound(textures, cx, cy, box, bound, enough, work, at)
    else:
        high, kind, second, loose = node_bound(
            textures, cx, cy, ax, ay, box, shift, enough, work, at
        )
    seen, high = kind != UNSEEN, min(high, bound)
    if kind >= BOUNDED and high > enough:
        high, seen = sharpest_bound(
            textures, cx, cy, box, kind, high, second, loose, enough,
            best, best[OVERLAP_SIZE] == pair, work, at,
        )  # fmt: skip
    state[JUDGED] = high
    closed = seen and kind == CONCAVE and high <= at[F] + _GRAIN
    if (
        # The middle of a box, or the highest place in it: the maximum may be near. One beyond a
        # border says little of what lies within, and there may be many that are deeper there.
        seen
        and at[F] > state[BEST] - TIE
        and is_within(cx, cy, at, work)
        and climb(textures, cx, cy, window, at[X], at[Y], p1 - p0 + q1 - q0, work, at)
    ):
        _keep(at, pair, 0.0, state, best, ties)
    if high <= state[BEST] - TIE:
        return -np.inf
    if closed:
        state[UPPER] = max(state[UPPER], high)
        return -np.inf
    flat = cx[C] == cy[C] == 0.0 and cx[TEXTURE] < 0.0 and cy[TEXTURE] < 0.0
    if flat and seen and high <= at[F] + TIE and _clear_of_borders(cx, cy, at, box, work):
        # All of it is equally deep: flat on flat.
        state[UPPER] = max(state[UPPER], high)
        _keep(at, pair, (p1 - p0) * (q1 - q0), state, best, ties)
        return -np.inf
    return high


@inner_kernel
def settle(textures, cx, cy, pair, window, box, bound, state, best, ties, work, at):
    """Look for a place as deep as the deepest in a small box that is as good as certified."""
    x0, x1, y0, y1 = box
    state[UPPER] = max(state[UPPER], bound)
    weight = (x1 - x0) * (y1 - y0)
    px, py = 0.5 * (x0 + x1), 0.5 * (y0 + y1)
    if cx[C] == cy[C] == 0.0 and cx[TEXTURE] < 0.0 and cy[TEXTURE] < 0.0:
        overlap_at(textures, cx, cy, px, py, work, at)
        if abs(at[F_X]) + abs(at[F_Y]) < _PLATEAU:
            # Flat on flat: the box counts if its middle does.
            if _clear_of_borders(cx, cy, at, (px, px, py, py), work):
                _keep(at, pair, weight, state, best, ties)
            return
    if climb(textures, cx, cy, window, px, py, x1 - x0 + y1 - y0, work, at):
        _keep(at, pair, weight, state, best, ties)


@inner_kernel
def search_pair(
    textures, cx, cy, pair, ax, ay, above, tolerance, state, best, ties, nodes, work, at
):
    """Search one pair of charts; improve what `state`, `best` and `ties` hold.

    Parameters
    ----------
    cx, cy : (165,) arrays
        Charts; the search walks over the parameters of `cx`.
    pair : int
        Noted with every place.
    ax, ay : float
        Where the smooth bases overlap most, and
    above : float
        an upper bound of the depth [m], as `first_look` has them.
    tolerance : float
        Boxes are closed when they cannot be deeper than the deepest by more than this [m].
    state : (9,) array
        See `search_state`.
    best : (23,) array
        The deepest place, as by `overlap_at`, and its pair.
    ties : (1024, 30) array
        Places as deep as the deepest (and stale ones), their pairs and weights.
    nodes : (1037, 5) array
    work : (136, 28) array
    at : (28,) array
        Working memory.
    """
    shift = _shift(textures, cx, cy)
    window = window_of(cx, cy, shift)
    x0, x1, y0, y1 = window
    span = max(x1 - x0, y1 - y0)
    ball = is_ball_over_plate(cx, cy)
    how = BALL if ball else ANY
    part = window
    if ball:
        ax, ay = parameters_under(cx, cy[O], cy[O + 1])
        part = _under_ball(textures, cx, cy, ax, ay, window, state[BEST] - TIE)
    boxes = nodes[_STACK + 4 :]
    top = 0
    for i in range(_blocks(textures, cx, part, boxes)):
        box = (boxes[i, 0], boxes[i, 1], boxes[i, 2], boxes[i, 3])
        high = judge(
            textures, cx, cy, pair, ax, ay, window, box, above, shift, how, state, best, ties,
            work, at,
        )  # fmt: skip
        if high > -np.inf:
            nodes[top, 0], nodes[top, 1], nodes[top, 2], nodes[top, 3] = box
            nodes[top, 4] = high
            top += 1
    finest = max(span * FINEST_TIE, SMALLEST)
    while top > 0:
        top -= 1
        bound = nodes[top, 4]
        if bound <= state[BEST] - TIE:
            continue
        x0, x1, y0, y1 = nodes[top, 0], nodes[top, 1], nodes[top, 2], nodes[top, 3]
        if bound <= state[BEST] + tolerance and max(x1 - x0, y1 - y0) <= finest:
            settle(
                textures, cx, cy, pair, window, (x0, x1, y0, y1), bound, state, best, ties, work, at
            )
            continue
        if is_spent(state) or top + 4 > _STACK or x1 - x0 + y1 - y0 < SMALLEST:
            state[UPPER] = max(state[UPPER], bound)
            continue
        # Oblong boxes are halved, others quartered.
        cut_x, cut_y = 2.0 * (x1 - x0) > y1 - y0, 2.0 * (y1 - y0) > x1 - x0
        mx, my = 0.5 * (x0 + x1), 0.5 * (y0 + y1)
        start = top
        for child in range(4):
            if (child & 1 and not cut_x) or (child & 2 and not cut_y):
                continue
            p0, p1 = (mx if child & 1 else x0), (mx if cut_x and not child & 1 else x1)
            q0, q1 = (my if child & 2 else y0), (my if cut_y and not child & 2 else y1)
            high = judge(
                textures, cx, cy, pair, ax, ay, window, (p0, p1, q0, q1), bound, shift, how,
                state, best, ties, work, at,
            )  # fmt: skip
            if high == -np.inf:
                continue
            # Insertion keeps the most promising child on top of the stack.
            place = top
            while place > start and nodes[place - 1, 4] > high:
                for j in range(5):
                    nodes[place, j] = nodes[place - 1, j]
                place -= 1
            nodes[place, 0], nodes[place, 1], nodes[place, 2], nodes[place, 3] = p0, p1, q0, q1
            nodes[place, 4] = high
            top += 1

"""The deepest overlap among many plane charts: the most promising box first, of all pairs.

Wide contact of two textured bodies has thousands of places that are nearly as deep. Boxes of all
pairs of charts stand in one heap, ordered by a bound that costs two looks into the textures'
pyramids; a box is quartered until it is about as large as their finest waves, and only then
searched as `search` does it, with second-order bounds and climbs. So what the budget is spent on
is where the deepest place may be, and what is left is bounded by the top of the heap.
"""

from __future__ import annotations

import math

import numpy as np

from asperity.compiled import inner_kernel, small_kernel
from asperity.contact.borders import beyond_rows
from asperity.contact.chart import (
    COVERS,
    LEAST_W,
    MAPPING,
    PLANAR,
    PZ,
    Q_LEAST,
    Q_MOST,
    QINV,
    RECTANGLE,
    RISE,
    ROWS,
    SUMMIT,
    TEXTURE,
    TOP,
    UNIT,
    UV_MOST,
    V0,
    V1,
    V2,
    C,
    O,
    Q,
)
from asperity.contact.deepest import LOOK_BOX, LOOKED, PAIR, walks_on_a
from asperity.contact.flat_pair import plane_overlap
from asperity.contact.overlap import POLYGON
from asperity.contact.search import (
    BEST,
    JUDGED,
    LIMIT,
    NODES,
    PLANES,
    SMALLEST,
    TIE,
    UPPER,
    first_look,
    judge,
    quick_bound,
    search_pair,
    settle,
)
from asperity.contact.surface import parameters_under
from asperity.contact.texture_bound import on_texture, sideways
from asperity.texture.highest import texture_top

MAX_BOXES = 32768
_LAST = 16
"""Boxes that are climbed in when the budget is spent."""
BOX_SIZE = 6  # x0, x1, y0, y1, row of its pair among the looks, bound
_LEAF = 1.0
"""Boxes are searched that are this large [grains of the finer texture]."""
_SETTLED = 1.5
"""Boxes that are as good as certified are not divided below this [grains]."""
_CHEAP = 0.1
"""What a bound from the pyramids alone costs [nodes of `search`]."""


@small_kernel
def _cap(textures, chart):
    """Return the highest point of a chart's texture all over the chart."""
    if chart[TEXTURE] < 0.0:
        return 0.0
    return min(chart[TOP], textures.scales[int(chart[TEXTURE]), 2])


@small_kernel
def _highest(textures, chart, x, y, half_x, half_y):
    """Return the highest point of a chart's texture over a box of its parameters."""
    known = _cap(textures, chart)
    if chart[TEXTURE] < 0.0 or chart[MAPPING] != PLANAR:
        return known
    u0, u1, v0, v1 = on_texture(chart, x, y, half_x, half_y)
    return min(known, texture_top(textures, int(chart[TEXTURE]), u0, u1, v0, v1))


@small_kernel
def _flat(cx, cy):
    """Return what bounds of the overlap of two plane charts take from the charts.

    Y's parameters over X's, `b0 + b1 x + b2 y` and `c0 + c1 x + c2 y`; the smooth overlap by x,
    by y, at (0, 0); how much higher a unit of X's texture, and of Y's, lifts it.
    """
    i, j, k, m = cy[QINV], cy[QINV + 1], cy[QINV + 2], cy[QINV + 3]
    du, dv = cx[O] - cy[O], cx[O + 1] - cy[O + 1]
    b0, b1, b2 = i * du + j * dv, i * cx[Q] + j * cx[Q + 2], i * cx[Q + 1] + j * cx[Q + 3]
    c0, c1, c2 = k * du + m * dv, k * cx[Q] + m * cx[Q + 2], k * cx[Q + 1] + m * cx[Q + 3]
    z_x = cx[PZ] + cy[PZ] * b1 + cy[PZ + 1] * c1
    z_y = cx[PZ + 1] + cy[PZ] * b2 + cy[PZ + 1] * c2
    z_0 = cx[O + 2] + cy[O + 2] + cy[PZ] * b0 + cy[PZ + 1] * c0
    g1, g2 = i * cy[PZ] + k * cy[PZ + 1], j * cy[PZ] + m * cy[PZ + 1]
    lift_x, lift_y = _lift(cx, g1, g2), _lift(cy, -g1, -g2)
    return b0, b1, b2, c0, c1, c2, z_x, z_y, z_0, lift_x, lift_y


@small_kernel
def _lift(chart, g1, g2):
    """Return how much higher a plane is over a place, moved by 1 along its normal, at most."""
    lift = chart[V0 + 2] + g1 * chart[V0] + g2 * chart[V0 + 1]
    if chart[UNIT] == 1.0:
        return lift
    # Before w is made a unit vector it is linear.
    x = chart[V1 + 2] + g1 * chart[V1] + g2 * chart[V1 + 1]
    y = chart[V2 + 2] + g1 * chart[V2] + g2 * chart[V2 + 1]
    lift += abs(x) * chart[RECTANGLE + 1] + abs(y) * chart[RECTANGLE + 3]
    return min(max(lift, 0.0) / chart[LEAST_W], math.sqrt(1.0 + g1 * g1 + g2 * g2))


@small_kernel
def _on_other(flat, x, y, half_x, half_y, moved):
    """Return middle and half sides, by Y's parameters, of what may lie under a box of X's."""
    b0, b1, b2, c0, c1, c2, _, _, _, _, _ = flat
    return (
        b0 + b1 * x + b2 * y,
        c0 + c1 * x + c2 * y,
        abs(b1) * half_x + abs(b2) * half_y + moved,
        abs(c1) * half_x + abs(c2) * half_y + moved,
    )


@small_kernel
def _beyond(chart, first, x, y, half_x, half_y):
    """Return whether a box round (x, y) lies beyond one of a plane chart's rows from `first` on."""
    for n in range(first, int(chart[ROWS])):
        row = ROWS + 1 + 6 * n
        k1, k2, k4 = chart[row + 1], chart[row + 2], chart[row + 4]
        g = chart[row] + k1 * x + k2 * y
        if k4 != 0.0:
            g += k4 * (x * x + y * y)
            k1, k2 = k1 + 2.0 * k4 * x, k2 + 2.0 * k4 * y
        if g > abs(k1) * half_x + abs(k2) * half_y:
            return True
    return False


@small_kernel
def _flat_bound(textures, cx, cy, flat, box, moved, enough):
    """Return an upper bound of the overlap of two plane charts over a box of X's parameters.

    -inf where they do not meet. `moved`: how far their textures move points sideways at most, in
    Y's parameters [m]. Once the bound falls to `enough` it is not sharpened.
    """
    x0, x1, y0, y1 = box
    x, y = 0.5 * (x0 + x1), 0.5 * (y0 + y1)
    half_x, half_y = 0.5 * (x1 - x0), 0.5 * (y1 - y0)
    on_y = _on_other(flat, x, y, half_x, half_y, moved)
    bx, by, reach_x, reach_y = on_y
    if bx - reach_x > cy[RECTANGLE + 1] or bx + reach_x < cy[RECTANGLE]:
        return -np.inf
    if by - reach_y > cy[RECTANGLE + 3] or by + reach_y < cy[RECTANGLE + 2]:
        return -np.inf
    z_x, z_y, z_0 = flat[6], flat[7], flat[8]
    bound = z_0 + z_x * x + z_y * y + abs(z_x) * half_x + abs(z_y) * half_y
    bound = _risen(textures, cx, cy, bound, (x, y, half_x, half_y), on_y, flat, enough)
    if bound <= enough:
        return bound
    if _beyond(cx, 0, x, y, half_x, half_y) or _beyond(cy, 0, bx, by, reach_x, reach_y):
        return -np.inf
    return bound


@small_kernel
def _lifted(cx, cy, flat, bound, top, high_x, high_y):
    """Return the sharper of two bounds, with textures that are so high."""
    # No point is higher than that of the base which it was, and its texture's highest.
    if cx[UNIT] == 1.0:
        bound, top = bound + flat[9] * high_x, top + high_x * cx[V0 + 2]
    else:
        high_x = max(high_x, 0.0)
        bound, top = bound + flat[9] * high_x, top + high_x * cx[RISE]
    if cy[UNIT] == 1.0:
        bound, top = bound + flat[10] * high_y, top + high_y * cy[V0 + 2]
    else:
        high_y = max(high_y, 0.0)
        bound, top = bound + flat[10] * high_y, top + high_y * cy[RISE]
    return min(bound, top)


@small_kernel
def _risen(textures, cx, cy, bound, on_x, on_y, flat, enough):
    """Return a bound of the smooth overlap over a box, and what the textures add to it there.

    `on_x`, `on_y`: middle and half sides of the box on either chart. The texture that is the
    rougher is looked up first: mostly it shows that the bound is below `enough`.
    """
    x, y, half_x, half_y = on_x
    bx, by, reach_x, reach_y = on_y
    top = cx[O + 2] + cx[PZ] * x + cx[PZ + 1] * y
    top += abs(cx[PZ]) * half_x + abs(cx[PZ + 1]) * half_y
    base = cy[O + 2] + cy[PZ] * bx + cy[PZ + 1] * by
    base += abs(cy[PZ]) * reach_x + abs(cy[PZ + 1]) * reach_y
    top = min(top, cx[SUMMIT]) + min(base, cy[SUMMIT])
    high_x, high_y = _cap(textures, cx), _cap(textures, cy)
    x_first = high_x >= high_y
    if x_first:
        high_x = _highest(textures, cx, x, y, half_x, half_y)
    else:
        high_y = _highest(textures, cy, bx, by, reach_x, reach_y)
    first = _lifted(cx, cy, flat, bound, top, high_x, high_y)
    if first <= enough:
        return first
    if x_first:
        high_y = _highest(textures, cy, bx, by, reach_x, reach_y)
    else:
        high_x = _highest(textures, cx, x, y, half_x, half_y)
    return _lifted(cx, cy, flat, bound, top, high_x, high_y)


@inner_kernel
def pair_bound(textures, cx, cy, work, look_out):
    """Fill an upper bound of the overlap of two charts, -inf if they do not meet.

    With it, for plane charts, the part of X's parameters over which they do: `LOOK_BOX`.
    """
    if cx[C] > 0.0 or cy[C] > 0.0:
        look_out[0] = quick_bound(textures, cx, cy)
        return
    look_out[0] = -np.inf
    shift = sideways(textures, cx) + sideways(textures, cy)
    polygon = work[POLYGON:]
    size, at_zero, g_x, g_y = plane_overlap(cx, cy, shift, polygon)
    if size == 0:
        return
    smooth = -np.inf
    x0, y0 = polygon[0, 0], polygon[0, 1]
    x1, y1 = x0, y0
    for j in range(size):
        x, y = polygon[j, 0], polygon[j, 1]
        smooth = max(smooth, at_zero + g_x * x + g_y * y)
        x0, x1, y0, y1 = min(x0, x), max(x1, x), min(y0, y), max(y1, y)
    look_out[LOOK_BOX], look_out[LOOK_BOX + 1] = x0, x1
    look_out[LOOK_BOX + 2], look_out[LOOK_BOX + 3] = y0, y1
    x, y, half_x, half_y = 0.5 * (x0 + x1), 0.5 * (y0 + y1), 0.5 * (x1 - x0), 0.5 * (y1 - y0)
    look_out[1], look_out[2] = x, y
    flat, moved = _flat(cx, cy), shift / cy[Q_LEAST]
    on_y = _on_other(flat, x, y, half_x, half_y, moved)
    look_out[0] = _risen(textures, cx, cy, smooth, (x, y, half_x, half_y), on_y, flat, -np.inf)


@inner_kernel
def _is_there(cx, cy, u, v):
    """Return whether a place of the contact frame lies on a chart and is not beside the other."""
    for chart in (cx, cy):
        if chart[COVERS + 1] > chart[COVERS] and not (
            chart[COVERS] <= u <= chart[COVERS + 1] and chart[COVERS + 2] <= v <= chart[COVERS + 3]
        ):
            return False
    x, y = parameters_under(cx, u, v)
    if not (cx[RECTANGLE] <= x <= cx[RECTANGLE + 1]):
        return False
    if not (cx[RECTANGLE + 2] <= y <= cx[RECTANGLE + 3]) or beyond_rows(cx, x, y, 0.0, 0.0):
        return False
    x, y = parameters_under(cy, u, v)
    if not (cy[RECTANGLE] <= x <= cy[RECTANGLE + 1]):
        return False
    return cy[RECTANGLE + 2] <= y <= cy[RECTANGLE + 3] and not beyond_rows(cy, x, y, 0.0, 0.0)


@small_kernel
def _grain(textures, chart):
    """Return over how many metres of a chart's parameters its texture bends to its own height."""
    if chart[TEXTURE] < 0.0:
        return np.inf
    k = int(chart[TEXTURE])
    # Of a sinusoid that is its length over 2 pi.
    return math.sqrt(textures.scales[k, 2] / max(textures.scales[k, 4], 1e-300)) / chart[UV_MOST]


@inner_kernel
def _push(heap, keys, size, number, key):
    """Put a box into the heap, whose largest key is on top."""
    at = size
    while at > 0:
        above = (at - 1) >> 1
        if keys[above] >= key:
            break
        keys[at], heap[at] = keys[above], heap[above]
        at = above
    keys[at], heap[at] = key, number


@inner_kernel
def _pop(heap, keys, size):
    """Take the top off a heap of `size` boxes."""
    key, number = keys[size - 1], heap[size - 1]
    last = size - 1
    at = 0
    while True:
        child = 2 * at + 1
        if child >= last:
            break
        if child + 1 < last and keys[child + 1] > keys[child]:
            child += 1
        if keys[child] <= key:
            break
        keys[at], heap[at] = keys[child], heap[child]
        at = child
    keys[at], heap[at] = key, number


@small_kernel
def _beside_part(cx, cy, flat, a_is_x, added, x0, x1, y0, y1):
    """Return whether a box lies beyond the rows that were added to A's chart last."""
    x, y = 0.5 * (x0 + x1), 0.5 * (y0 + y1)
    half_x, half_y = 0.5 * (x1 - x0), 0.5 * (y1 - y0)
    if a_is_x:
        return _beyond(cx, int(cx[ROWS]) - added, x, y, half_x, half_y)
    bx, by, reach_x, reach_y = _on_other(flat, x, y, half_x, half_y, 0.0)
    return _beyond(cy, int(cy[ROWS]) - added, bx, by, reach_x, reach_y)


@inner_kernel
def _look_at(textures, stride, count, guess_u, guess_v, space):
    """Climb from where the contact was, in every pair of plane charts that has the place.

    Other pairs are looked at when it is their turn.
    """
    looks = space.looks
    for row in range(count):
        pair = int(looks[row, PAIR])
        cx, cy = space.charts_a[pair // stride], space.charts_b[pair % stride]
        if not walks_on_a(cx, cy):
            cx, cy = cy, cx
        rough = cx[TEXTURE] >= 0.0 or cy[TEXTURE] >= 0.0
        looks[row, LOOKED] = 0.0
        if cx[C] == 0.0 and cy[C] == 0.0 and rough:
            # Climbing in every pair would take most of the time.
            looks[row, LOOKED] = 1.0
            if _is_there(cx, cy, guess_u, guess_v):
                first_look(
                    textures, cx, cy, pair, guess_u, guess_v, space.state, space.best, space.ties,
                    space.work, space.at, looks[row],
                )  # fmt: skip
                space.state[NODES] += 2.0


@inner_kernel
def sieve(textures, stride, count, guess_u, guess_v, tolerance, space, room, added):
    """Search the first `count` pairs of `space.looks`, as `search_looks` does.

    `room` has the arrays of the heap: `boxes`, `heap`, `keys`. What is closed is kept on its
    `shelf`: `added` is the number of rows that A's charts have got since the last search that
    added none; if there are any, the search goes on from what that one has left.
    """
    state, looks = space.state, space.looks
    boxes, heap, keys, shelf = room.boxes, room.heap, room.keys, room.shelf
    _look_at(textures, stride, count, guess_u, guess_v, space)
    size, used, left = np.int64(0), np.int64(0), np.int64(0)
    if added == 0:
        for row in range(count):
            # A box that is no number stands for all of a pair.
            boxes[used, 4], boxes[used, 5], boxes[used, 0] = row, looks[row, 0], np.nan
            if looks[row, 0] <= state[BEST] - TIE:
                left = _put_by(room, left, used)
            else:
                _push(heap, keys, size, used, looks[row, 0])
                size += 1
            used += 1
    else:
        used = room.left[1]
        for i in range(room.left[0]):
            number = shelf[i]
            if boxes[number, 5] <= state[BEST] - TIE:
                continue
            row = int(boxes[number, 4])
            pair = int(looks[row, PAIR])
            a, b = space.charts_a[pair // stride], space.charts_b[pair % stride]
            if a[C] == 0.0 and b[C] == 0.0:
                x0, x1, y0, y1 = _sides(boxes[number], looks[row])
                a_is_x = walks_on_a(a, b)
                cx, cy = (a, b) if a_is_x else (b, a)
                if _beside_part(cx, cy, _flat(cx, cy), a_is_x, added, x0, x1, y0, y1):
                    continue
            _push(heap, keys, size, number, boxes[number, 5])
            size += 1
    while size > 0:
        above, number = keys[0], heap[0]
        if above <= state[BEST] - TIE:
            break
        if state[NODES] >= state[LIMIT] or used + 4 > MAX_BOXES:
            state[UPPER] = max(state[UPPER], above)
            _last_climbs(textures, stride, size, space, room)
            break
        _pop(heap, keys, size)
        size -= 1
        row = int(boxes[number, 4])
        pair = int(looks[row, PAIR])
        cx, cy = space.charts_a[pair // stride], space.charts_b[pair % stride]
        if not walks_on_a(cx, cy):
            cx, cy = cy, cx
        if looks[row, LOOKED] == 0.0:
            looks[row, LOOKED] = 1.0
            first_look(
                textures, cx, cy, pair, guess_u, guess_v, state, space.best, space.ties,
                space.work, space.at, looks[row],
            )  # fmt: skip
            state[NODES] += 2.0
            above = min(above, looks[row, 0])
            # Of two that are straight nothing is left, but for a part of them.
            _push(heap, keys, size, number, above)
            size += 1
            continue
        if cx[C] > 0.0 or cy[C] > 0.0:
            search_pair(
                textures, cx, cy, pair, looks[row, 1], looks[row, 2], above, tolerance, state,
                space.best, space.ties, space.nodes, space.work, space.at,
            )  # fmt: skip
            if added == 0:
                left = _put_by(room, left, number)
            continue
        flat, shift = _flat(cx, cy), sideways(textures, cx) + sideways(textures, cy)
        moved = shift / cy[Q_LEAST]
        x0, x1, y0, y1 = _sides(boxes[number], looks[row])
        window = (cx[RECTANGLE], cx[RECTANGLE + 1], cx[RECTANGLE + 2], cx[RECTANGLE + 3])
        grain = min(_grain(textures, cx), _grain(textures, cy) * cy[Q_LEAST] / cx[Q_MOST])
        while True:
            large = max(x1 - x0, y1 - y0)
            done = large < SMALLEST or used + 4 > MAX_BOXES
            if above <= state[BEST] + tolerance and large <= _SETTLED * grain:
                done = True
                state[NODES] += 1.0
                settle(
                    textures, cx, cy, pair, window, (x0, x1, y0, y1), above, state, space.best,
                    space.ties, space.work, space.at,
                )  # fmt: skip
            elif done:
                state[UPPER] = max(state[UPPER], above)
            if done:
                if added == 0:
                    left = _put_by(room, left, number)
                break
            first, best, highest = used, np.int64(-1), -np.inf
            cut_x, cut_y = 2.0 * (x1 - x0) > y1 - y0, 2.0 * (y1 - y0) > x1 - x0
            mx, my = 0.5 * (x0 + x1), 0.5 * (y0 + y1)
            for child in range(4):
                if (child & 1 and not cut_x) or (child & 2 and not cut_y):
                    continue
                p0, p1 = (mx if child & 1 else x0), (mx if cut_x and not child & 1 else x1)
                q0, q1 = (my if child & 2 else y0), (my if cut_y and not child & 2 else y1)
                state[NODES] += _CHEAP
                enough = state[BEST] - TIE
                high = _flat_bound(textures, cx, cy, flat, (p0, p1, q0, q1), moved, enough)
                high = min(high, above)
                if high == -np.inf:
                    continue
                boxes[used, 0], boxes[used, 1], boxes[used, 2], boxes[used, 3] = p0, p1, q0, q1
                boxes[used, 4], boxes[used, 5] = row, high
                used += 1
                if high > enough and large <= _LEAF * grain:
                    high = judge(
                        textures, cx, cy, pair, looks[row, 1], looks[row, 2], window,
                        (p0, p1, q0, q1), high, shift, PLANES, state, space.best, space.ties,
                        space.work, space.at,
                    )  # fmt: skip
                    boxes[used - 1, 5] = min(boxes[used - 1, 5], state[JUDGED])
                elif high <= enough:
                    high = -np.inf
                if high == -np.inf:
                    if added == 0:
                        left = _put_by(room, left, used - 1)
                    boxes[used - 1, 4] = -1.0 - row
                    continue
                if high > highest:
                    best, highest = used - 1, high
            # On to the best of them, until it is small: what is found there closes others.
            plunge = highest > state[BEST] - TIE and large > _LEAF * grain
            for k in range(first, used):
                if boxes[k, 4] < 0.0:
                    boxes[k, 4] = -1.0 - boxes[k, 4]  # closed
                elif k != best or not plunge:
                    _push(heap, keys, size, k, boxes[k, 5])
                    size += 1
            if not plunge:
                break
            x0, x1, y0, y1 = boxes[best, 0], boxes[best, 1], boxes[best, 2], boxes[best, 3]
            above, number = highest, best
    if added == 0:
        for i in range(size):
            left = _put_by(room, left, heap[i])
        room.left[0], room.left[1] = left, used


@inner_kernel
def _last_climbs(textures, stride, size, space, room):
    """Climb from the middles of the most promising boxes, of which there are `size`.

    A search that ends before it has seen them would else report what it happened to find.
    """
    for k in range(min(size, _LAST)):
        number = room.heap[k]
        look = space.looks[int(room.boxes[number, 4])]
        pair = int(look[PAIR])
        cx, cy = space.charts_a[pair // stride], space.charts_b[pair % stride]
        if not walks_on_a(cx, cy):
            cx, cy = cy, cx
        if cx[C] == 0.0 and cy[C] == 0.0:
            x0, x1, y0, y1 = _sides(room.boxes[number], look)
            window = (cx[RECTANGLE], cx[RECTANGLE + 1], cx[RECTANGLE + 2], cx[RECTANGLE + 3])
            settle(
                textures, cx, cy, pair, window, (x0, x1, y0, y1), room.boxes[number, 5],
                space.state, space.best, space.ties, space.work, space.at,
            )  # fmt: skip


@small_kernel
def _sides(box, look):
    """Return x0, x1, y0, y1 of a box, which may stand for all of its pair."""
    if box[0] != box[0]:
        return look[LOOK_BOX], look[LOOK_BOX + 1], look[LOOK_BOX + 2], look[LOOK_BOX + 3]
    return box[0], box[1], box[2], box[3]


@small_kernel
def _put_by(room, left, number):
    """Put a box on the shelf; return how many there are."""
    room.shelf[left] = number
    return left + 1

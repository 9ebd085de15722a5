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

from asperity._core.kernels import inner_kernel, small_kernel
from asperity._core.stack import stack_array
from asperity.contact.narrow_phase.bounds.plane_pairs import (
    between_planes,
    beyond,
    on_other,
    quarter_bounds,
)
from asperity.contact.narrow_phase.bounds.texture import sideways
from asperity.contact.narrow_phase.branch_and_bound import (
    PLANES,
    SMALLEST,
    TIE,
    first_look,
    judge,
    search_pair,
    settle,
)
from asperity.contact.narrow_phase.incumbent import BEST, CUT, JUDGED, NODES, UPPER, is_spent
from asperity.contact.narrow_phase.penetration import (
    LOOK_BOX,
    LOOK_COVERS,
    LOOKED,
    PAIR,
    walks_on_a,
)
from asperity.contact.narrow_phase.surface_patch import (
    Q_LEAST,
    Q_MOST,
    RECTANGLE,
    ROWS,
    TEXTURE,
    UV_MOST,
    C,
)
from asperity.contact.narrow_phase.warm_start import is_there

MAX_BOXES = 131072
_LAST, _LAST_CUT = 16, 2
"""Boxes that are climbed in when the budget is spent, and when the time is."""
BOX_SIZE = 6  # x0, x1, y0, y1, row of its pair among the looks, bound
_LEAF = 1.0
"""Boxes are searched that are this large [grains of the finer texture]."""
_SETTLED = 1.5
"""Boxes that are as good as certified are not divided below this [grains]."""
_CHEAP = 0.1
"""What a bound from the pyramids alone costs [nodes of `search`]."""


@small_kernel
def _grain(textures, chart):
    """Return over how many metres of a chart's parameters its texture bends to its own height."""
    if chart[TEXTURE] < 0.0:
        return np.inf
    k = int(chart[TEXTURE])
    # Of a sinusoid that is its length over 2 pi.
    texture = textures.maps[k]
    return math.sqrt(texture.max_abs_height / max(texture.max_curvature, 1e-300)) / chart[UV_MOST]


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
        return beyond(cx, int(cx[ROWS]) - added, x, y, half_x, half_y)
    bx, by, reach_x, reach_y = on_other(flat, x, y, half_x, half_y, 0.0)
    return beyond(cy, int(cy[ROWS]) - added, bx, by, reach_x, reach_y)


@inner_kernel
def _look_at(textures, stride, count, guess_u, guess_v, space):
    """Climb from where the contact was, in every pair of plane charts that has the place.

    Other pairs are looked at when it is their turn.
    """
    looks = space.looks
    for row in range(count):
        look = looks[row]
        # Climbing in every pair would take most of the time.
        looks[row, LOOKED] = 1.0 if look[LOOK_COVERS] == look[LOOK_COVERS] else 0.0
        if not (
            look[LOOK_COVERS] <= guess_u <= look[LOOK_COVERS + 1]
            and look[LOOK_COVERS + 2] <= guess_v <= look[LOOK_COVERS + 3]
        ):
            continue
        pair = int(look[PAIR])
        cx, cy = space.charts_a[pair // stride], space.charts_b[pair % stride]
        if not walks_on_a(cx, cy):
            cx, cy = cy, cx
        if is_there(cx, cy, guess_u, guess_v):
            first_look(
                textures, cx, cy, pair, guess_u, guess_v, space.state, space.best, space.ties,
                space.work, space.at, look,
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
    bounds = stack_array((4,))
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
                if _beside_part(cx, cy, between_planes(cx, cy), a_is_x, added, x0, x1, y0, y1):
                    continue
            _push(heap, keys, size, number, boxes[number, 5])
            size += 1
    while size > 0:
        above, number = keys[0], heap[0]
        if above <= state[BEST] - TIE:
            break
        if is_spent(state) or used + 4 > MAX_BOXES:
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
        flat, shift = between_planes(cx, cy), sideways(textures, cx) + sideways(textures, cy)
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
            quarter_bounds(
                textures, cx, cy, flat, (x0, x1, y0, y1), moved, state[BEST] - TIE, bounds
            )
            for child in range(4):
                if (child & 1 and not cut_x) or (child & 2 and not cut_y):
                    continue
                p0, p1 = (mx if child & 1 else x0), (mx if cut_x and not child & 1 else x1)
                q0, q1 = (my if child & 2 else y0), (my if cut_y and not child & 2 else y1)
                state[NODES] += _CHEAP
                enough = state[BEST] - TIE
                high = min(bounds[child], above)
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
    most = _LAST if space.state[CUT] == 0.0 else _LAST_CUT
    for k in range(min(size, most)):
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

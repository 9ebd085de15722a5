"""From a place uphill to a local maximum of the overlap, within the charts' borders.

Each step maximises the quadratic that agrees with the overlap in value, slope and curvature,
within a box and the borders taken as straight lines (sequential quadratic programming). With two
unknowns that needs no solver: the maximum is inside, on one line, or where two lines meet, and
all of these are looked at.
"""

from __future__ import annotations

import math

import numpy as np

from asperity._core.kernels import inner_kernel
from asperity.contact.narrow_phase.overlap import (
    BORDERS,
    F_X,
    F_XX,
    F_XY,
    F_Y,
    F_YY,
    LINES,
    OVERLAP_SIZE,
    POLYGON,
    TRIAL,
    F,
    borders_at,
    overlap_at,
)
from asperity.contact.narrow_phase.sphere_on_plane import is_ball_over_plate, rolled_uphill

FEASIBLE = 1e-11
"""A place this far beyond a border is still on it [m]."""
_STEPS = 40
_SHORTEST = 1e-14
_CLOSE = 1e-10
_HELD = 1e-8  # a place this near a border may be held by it [m]
_ALMOST = 1e-9
_GRAIN = 1e-15
_LEVEL = 1e-12  # slopes below this are none
_CORRECTIONS = 3


@inner_kernel
def _level_step(g_x, g_y, h_xx, h_xy, h_yy):
    """Return the shortest step to the ridge or plateau of a quadratic that has one.

    That is where it bends down in one direction, or none, and is level in the others.
    """
    half, gap = 0.5 * (h_xx + h_yy), 0.5 * (h_xx - h_yy)
    root = math.sqrt(gap * gap + h_xy * h_xy)
    low, high = half - root, half + root
    if high > 1e-9 * max(abs(low), 1.0):
        return 0.0, 0.0, False
    # The direction that bends least.
    e_x, e_y = (h_xy, high - h_xx) if abs(h_xy) > 1e-12 * root else (1.0, 0.0)
    if abs(h_xy) <= 1e-12 * root and h_xx < h_yy:
        e_x, e_y = 0.0, 1.0
    size = math.sqrt(e_x * e_x + e_y * e_y)
    e_x, e_y = e_x / size, e_y / size
    if abs(g_x * e_x + g_y * e_y) > _LEVEL:
        return 0.0, 0.0, False
    across = g_y * e_x - g_x * e_y
    if low > -1e-9:
        return 0.0, 0.0, abs(across) <= _LEVEL
    step = -across / low
    return -step * e_y, step * e_x, True


@inner_kernel
def _best_step(at, h_xx, h_xy, h_yy, lines, count):
    """Return the step (dx, dy) that maximises a quadratic where all lines allow it.

    The quadratic has the slope at `at` and the bend given.

    A line allows `lines[i, 1] dx + lines[i, 2] dy <= lines[i, 0]`. Without an allowed step the
    flag returned third is false.
    """
    g_x, g_y = at[F_X], at[F_Y]
    det = h_xx * h_yy - h_xy * h_xy
    if h_xx < 0.0 and det > 0.0:
        dx, dy = -(h_yy * g_x - h_xy * g_y) / det, -(h_xx * g_y - h_xy * g_x) / det
        fits = True
        for i in range(count):
            if lines[i, 1] * dx + lines[i, 2] * dy > lines[i, 0]:
                fits = False
                break
        if fits:
            return dx, dy, True
    dx, dy, fits = _level_step(g_x, g_y, h_xx, h_xy, h_yy)
    if fits:
        for i in range(count):
            fits = fits and lines[i, 1] * dx + lines[i, 2] * dy <= lines[i, 0]
        if fits:
            return dx, dy, True
    best, best_x, best_y, found = -np.inf, 0.0, 0.0, False
    for i in range(count):
        a, b, r = lines[i, 1], lines[i, 2], lines[i, 0]
        square = a * a + b * b
        if square == 0.0:
            continue
        base_x, base_y = a * r / square, b * r / square
        along_x, along_y = -b, a
        bend = h_xx * along_x * along_x + 2.0 * h_xy * along_x * along_y + h_yy * along_y * along_y
        rise = (g_x + h_xx * base_x + h_xy * base_y) * along_x
        rise += (g_y + h_xy * base_x + h_yy * base_y) * along_y
        for j in range(i, count):
            if j == i:
                if bend >= 0.0:
                    continue
                s = -rise / bend
            else:
                cross = lines[j, 1] * along_x + lines[j, 2] * along_y
                if abs(cross) <= 1e-14 * square:
                    continue
                s = (lines[j, 0] - lines[j, 1] * base_x - lines[j, 2] * base_y) / cross
            dx, dy = base_x + s * along_x, base_y + s * along_y
            value = g_x * dx + g_y * dy
            value += 0.5 * (h_xx * dx * dx + 2.0 * h_xy * dx * dy + h_yy * dy * dy)
            if value <= best:
                continue
            fits = True
            for k in range(count):
                if k != i and k != j:
                    over = lines[k, 1] * dx + lines[k, 2] * dy - lines[k, 0]
                    if over > 1e-15 + 1e-12 * abs(lines[k, 0]):
                        fits = False
                        break
            if fits:
                best, best_x, best_y, found = value, dx, dy, True
    return best_x, best_y, found


@inner_kernel
def _bent_along(at, borders, count):
    """Return the bend of the overlap, less that of the borders that hold it (Lagrange).

    Along a curved border it is this that steps have to know, or they come closer but slowly.
    """
    h_xx, h_xy, h_yy = at[F_XX], at[F_XY], at[F_YY]
    for i in range(count):
        if borders[i, 0] > -_HELD:
            a, b = borders[i, 1], borders[i, 2]
            hold = (at[F_X] * a + at[F_Y] * b) / max(a * a + b * b, 1e-300)
            if hold > 0.0:
                h_xx -= hold * borders[i, 4]
                h_xy -= hold * borders[i, 5]
                h_yy -= hold * borders[i, 6]
    return h_xx, h_xy, h_yy


@inner_kernel
def _over(borders, count):
    """Return how far the worst border is passed [m]."""
    worst = 0.0
    for i in range(count):
        worst = max(worst, borders[i, 0])
    return worst


@inner_kernel
def is_within(cx, cy, at, work):
    """Return whether a place of `overlap_at` lies within the borders of both charts."""
    borders = work[BORDERS:LINES]
    return _over(borders, borders_at(cx, cy, at, borders)) <= FEASIBLE


@inner_kernel
def _back(borders, count, x, y, box):
    """Return (x, y) moved back onto the border that it passes most."""
    worst = 0
    for i in range(1, count):
        if borders[i, 0] > borders[worst, 0]:
            worst = i
    a, b = borders[worst, 1], borders[worst, 2]
    share = borders[worst, 0] / max(a * a + b * b, 1e-300)
    x0, x1, y0, y1 = box
    return min(max(x - share * a, x0), x1), min(max(y - share * b, y0), y1)


@inner_kernel
def step_within(at, x, y, box, stride, borders, count, lines):
    """Return the best step (dx, dy) from (x, y) within a box and `count` borders, if there is one.

    No part of it is longer than `stride`.
    """
    x0, x1, y0, y1 = box
    near = np.int64(0)
    for i in range(count):
        # Lines that no step of this length can reach are left out.
        if stride * (abs(borders[i, 1]) + abs(borders[i, 2])) > -borders[i, 0]:
            lines[near, 0] = -borders[i, 0]
            lines[near, 1], lines[near, 2] = borders[i, 1], borders[i, 2]
            near += 1
    for side in range(4):
        lines[near, 1], lines[near, 2] = 0.0, 0.0
        lines[near, 1 + (side >> 1)] = 1.0 if side & 1 else -1.0
        near += 1
    lines[near - 4, 0] = min(x - x0, stride)
    lines[near - 3, 0] = min(x1 - x, stride)
    lines[near - 2, 0] = min(y - y0, stride)
    lines[near - 1, 0] = min(y1 - y, stride)
    h_xx, h_xy, h_yy = _bent_along(at, borders, count)
    return _best_step(at, h_xx, h_xy, h_yy, lines, near)


@inner_kernel
def climb(textures, cx, cy, box, x, y, stride, work, at_out):
    """Climb from (x, y) to a local maximum within `box` and the borders; fill `at_out` (28,).

    Returns whether the place is within the borders. `box` is (x0, x1, y0, y1); no step is longer
    than `stride` along an axis.
    """
    x0, x1, y0, y1 = box
    x, y = min(max(x, x0), x1), min(max(y, y0), y1)
    if is_ball_over_plate(cx, cy):
        x, y = rolled_uphill(textures, cx, cy, box, x, y, stride)
    at = at_out
    trial, borders, lines = work[TRIAL], work[BORDERS:LINES], work[LINES:POLYGON]
    overlap_at(textures, cx, cy, x, y, work, at)
    if at[F] == -np.inf:
        return False
    count = borders_at(cx, cy, at, borders)
    over = _over(borders, count)
    length = np.inf
    for _ in range(_STEPS):
        dx, dy, found = step_within(at, x, y, box, stride, borders, count, lines)
        if not found:
            # Out of reach of the borders: what can be gained is a shorter way over them.
            return over <= FEASIBLE
        length, last = abs(dx) + abs(dy), length
        if length < _SHORTEST or (length < _CLOSE and length > 0.5 * last):
            break
        penalty = 10.0 * (1.0 + abs(at[F_X]) + abs(at[F_Y]))
        new_x, new_y = min(max(x + dx, x0), x1), min(max(y + dy, y0), y1)
        overlap_at(textures, cx, cy, new_x, new_y, work, trial)
        better = False
        if trial[F] > -np.inf:
            trial_count = borders_at(cx, cy, trial, borders)
            trial_over = _over(borders, trial_count)
            for _ in range(_CORRECTIONS):
                if trial_over <= _GRAIN:
                    break
                # A step along a curved border ends beyond it: straight back, or what is gained
                # along the border would seem lost.
                new_x, new_y = _back(borders, trial_count, new_x, new_y, box)
                overlap_at(textures, cx, cy, new_x, new_y, work, trial)
                if trial[F] == -np.inf:
                    break
                trial_count = borders_at(cx, cy, trial, borders)
                trial_over = _over(borders, trial_count)
            gain = trial[F] - at[F] - penalty * (max(trial_over, _GRAIN) - max(over, _GRAIN))
            # A place a grain beyond a border is higher by a grain. Short steps that shrink are
            # Newton's, and are right all the same.
            trusted = length < _HELD and length < 0.5 * last
            better = gain >= (-penalty * _GRAIN if trusted else -1e-17)
        if better:
            for i in range(OVERLAP_SIZE):
                at[i] = trial[i]
            x, y, over, count = new_x, new_y, trial_over, trial_count
            if length < _ALMOST and length < 1e-3 * last:
                # Newton's steps shrink by their square: the next is below the grain.
                break
        else:
            stride = 0.25 * max(abs(dx), abs(dy))
            if stride < _SHORTEST:
                break
            length = np.inf
            count = borders_at(cx, cy, at, borders)
    return over <= FEASIBLE

r"""Finding the periodic motion of a dragged hand.

Over one period of the drive the hand's (u - v t, u') goes to P(u - v t, u'); a motion that
repeats is a fixed point of P. Left alone, the hand falls towards it by `exp(-b T / 2 m)` a
period, which takes dozens of periods of a fine texture.

The idea: P is nearly linear, so three periods in a row tell its 2 x 2 Jacobian `J`, and the fixed
point follows as `y + (I - J)^-1 (P(y) - y)` (Steffensen's method in two dimensions). It is
accepted only if the next period confirms it, and only if no eigenvalue of J reaches 1: a fixed
point that no hand would stay at is no answer. Otherwise the hand is simply dragged on, and the
motion compared with those of up to eight periods before.
"""

from __future__ import annotations

import math

import numpy as np

from asperity._core.kernels import kernel
from asperity.dynamics.dragged_hand.integrator import (
    DRIVE,
    HOLD,
    INTERVAL,
    PLACE,
    SPEED,
    STRETCH,
    Pull,
    advance_period,
    lay_out,
)

_CYCLES = 8
_FIRST_PERIODS = 2
_APART = 1000.0
"""Tolerances by which the periods of a subharmonic motion differ from each other, at least; what
misses its repeat by more does not repeat."""
_RECORDINGS = 60
_STABLE = 0.98
"""Largest eigenvalue of the Jacobian, in size, of a motion that is taken for stable."""


@kernel
def place_at(state, lag, speed, phase, course):
    """Set the state: the hand `lag` ahead of a drive that stands at `phase` of the period."""
    period = course.jumps[course.jumps.size - 1]
    wraps = math.floor((phase + lag) / period)
    state[PLACE] = phase + lag - wraps * period
    state[DRIVE] = phase - wraps * period
    state[SPEED], state[HOLD], state[INTERVAL], state[STRETCH] = speed, np.nan, 0.0, 0.0
    if course.jumps.size > 1:
        stretch = np.searchsorted(course.jumps, state[PLACE], side="right") - 1
        state[STRETCH] = min(max(stretch, 0), course.jumps.size - 2)


@kernel
def _jacobian(y, jacobian_out):
    """Fill the Jacobian of P from four points in a row, shape (4, 2); tell whether it is known."""
    a, c = y[1, 0] - y[0, 0], y[1, 1] - y[0, 1]
    b, d = y[2, 0] - y[1, 0], y[2, 1] - y[1, 1]
    e, f = y[3, 0] - y[2, 0], y[3, 1] - y[2, 1]
    determinant = a * d - b * c
    if abs(determinant) <= 1e-9 * (a * a + c * c):
        return False
    # J [[a, b], [c, d]] = [[b, e], [d, f]]
    jacobian_out[0, 0] = (b * d - e * c) / determinant
    jacobian_out[0, 1] = (e * a - b * b) / determinant
    jacobian_out[1, 0] = (d * d - f * c) / determinant
    jacobian_out[1, 1] = (f * a - d * b) / determinant
    return True


@kernel
def _largest_eigenvalue(j):
    """Return the size of the largest eigenvalue of a 2 x 2 matrix."""
    half, determinant = 0.5 * (j[0, 0] + j[1, 1]), j[0, 0] * j[1, 1] - j[0, 1] * j[1, 0]
    inside = half * half - determinant
    if inside < 0.0:
        return math.sqrt(determinant)
    return abs(half) + math.sqrt(inside)


@kernel
def _jump_ahead(state, before, after, j, tolerance, phase, course):
    """Set the state to the fixed point `y + (I - J)^-1 (P(y) - y)`, from y and P(y), scaled."""
    determinant = (1.0 - j[0, 0]) * (1.0 - j[1, 1]) - j[0, 1] * j[1, 0]
    d0, d1 = after[0] - before[0], after[1] - before[1]
    lag = before[0] + ((1.0 - j[1, 1]) * d0 + j[0, 1] * d1) / determinant
    speed = before[1] + (j[1, 0] * d0 + (1.0 - j[0, 0]) * d1) / determinant
    place_at(state, lag * tolerance[0], speed * tolerance[1], phase, course)


@kernel
def _scaled(state, tolerance):
    """Return (u - v t, u') of a state, in parts of the tolerance."""
    return np.array([(state[PLACE] - state[DRIVE]) / tolerance[0], state[SPEED] / tolerance[1]])


@kernel
def extrapolate_repeat(state, phase, steps, step, course, pull, tolerance, jacobian_out):
    """Look for the fixed point; return (found, periods run, mismatch) and fill the Jacobian.

    `tolerance` scales (u - v t, u'); `mismatch` is in parts of it. Where nothing is found the
    state is left somewhere on the way.
    """
    nothing, extremes = np.empty((0, 3)), np.zeros(2)
    y = np.empty((4, 2))
    for _ in range(_FIRST_PERIODS):
        advance_period(state, steps, step, course, pull, extremes, nothing)
    run, stable = _FIRST_PERIODS, False
    mismatch = np.inf
    for _ in range(_CYCLES):
        for k in range(4):
            if k > 0:
                advance_period(state, steps, step, course, pull, extremes, nothing)
                run += 1
            y[k] = _scaled(state, tolerance)
            if k > 0:
                mismatch = max(abs(y[k, 0] - y[k - 1, 0]), abs(y[k, 1] - y[k - 1, 1]))
                if mismatch <= 1.0 and stable:
                    return True, run, mismatch
        if not _jacobian(y, jacobian_out):
            continue
        stable = _largest_eigenvalue(jacobian_out) < _STABLE
        if not stable:
            return False, run, mismatch
        _jump_ahead(state, y[2], y[3], jacobian_out, tolerance, phase, course)
    return False, run, mismatch


@kernel
def run_until_repeat(state, steps, step, course, pull, tolerance, most_periods, history):
    """Advance by whole periods until (u - v t, u') repeats.

    Returns
    -------
    tuple (repeats_after, periods_run, mismatch)
        `repeats_after` is 0 where the motion has not repeated within `most_periods`;
        `mismatch` is what the last period missed a repeat by, relative to `tolerance`.
    """
    depth = history.shape[0]
    nothing, extremes = np.empty((0, 3)), np.zeros(2)
    mismatch = np.inf
    for period in range(most_periods + 1):
        lag, speed = state[PLACE] - state[DRIVE], state[SPEED]
        for back in range(1, min(depth, period) + 1):
            old = (period - back) % depth
            miss = max(
                abs(lag - history[old, 0]) / tolerance[0],
                abs(speed - history[old, 1]) / tolerance[1],
            )
            if back == 1:
                mismatch = miss
            # A motion that still alternates while it settles is near itself two periods ago.
            if miss <= 1.0 and (back == 1 or mismatch > _APART):
                return back, period, miss
        history[period % depth, 0], history[period % depth, 1] = lag, speed
        if period < most_periods:
            advance_period(state, steps, step, course, pull, extremes, nothing)
    return 0, most_periods, mismatch


@kernel
def drag_until_repeat(table, hand, speed, start, steps, most_periods, extrapolate, how):
    """Find the periodic motion, or give up, and record it.

    Parameters
    ----------
    table : (edges, coefficients, jumps)
        Of the force.
    hand : (mass, stiffness, damping)
    speed, start : float
        Of the drive, and where it sets out.
    steps : int
        Steps a period.
    most_periods : int
        How long the hand is dragged on where nothing is found before.
    extrapolate : bool
        Whether to look for the fixed point first.
    how : (int, int, int, float)
        How far back a repeat is looked for; how many periods to record of a motion that does not
        repeat; how many samples to record for each step; the tolerance, in parts of the period
        and of the speed.

    Returns
    -------
    tuple (repeats_after, periods_run, mismatch, smallest, largest, record)
    """
    course = lay_out(table[0], table[1], table[2])
    pull = Pull(hand[0], hand[1], hand[2], speed)
    period = course.edges[course.edges.size - 1]
    origin = table[2][0] if table[2].size > 0 else 0.0
    phase = start - origin - math.floor((start - origin) / period) * period
    step = period / speed / steps
    depth, without, finer, relative = how
    tolerance = np.array([relative * period, relative * speed])
    state = np.empty(6)
    place_at(state, 0.0, speed, phase, course)
    repeat, run, mismatch = 0, 0, np.inf
    jacobian, ahead = np.zeros((2, 2)), False
    if extrapolate:
        ahead, run, mismatch = extrapolate_repeat(
            state, phase, steps, step, course, pull, tolerance, jacobian
        )
        repeat = 1 if ahead else 0
    if repeat == 0:
        place_at(state, 0.0, speed, phase, course)
        history = np.empty((depth, 2))
        repeat, run, mismatch = run_until_repeat(
            state, steps, step, course, pull, tolerance, most_periods, history
        )
    record = np.empty(((repeat if repeat > 0 else without) * steps * finer, 3))
    extremes = np.array([np.inf, -np.inf])
    nearest, least = state, np.inf
    for _ in range(_RECORDINGS):
        before = _scaled(state, tolerance)
        extremes[0], extremes[1] = np.inf, -np.inf
        advance_period(state, record.shape[0], step / finer, course, pull, extremes, record)
        after = _scaled(state, tolerance)
        if repeat == 0:
            break
        # The record's finer steps have a fixed point of their own, close by.
        mismatch = max(abs(after[0] - before[0]), abs(after[1] - before[1]))
        if mismatch <= 1.0:
            break
        run += repeat
        if ahead and mismatch < least:
            nearest, least = state.copy(), mismatch
            _jump_ahead(state, before, after, jacobian, tolerance, phase, course)
        elif ahead:
            # That jump led away: the Jacobian was read off where the motion hardly changed any
            # more. From the nearest place the hand falls towards the fixed point by itself.
            ahead, state = False, nearest
    if repeat > 0 and not mismatch <= _APART:
        repeat = 0
        record = np.empty((without * steps * finer, 3))
        extremes[0], extremes[1] = np.inf, -np.inf
        advance_period(state, record.shape[0], step / finer, course, pull, extremes, record)
    return repeat, run, mismatch * relative, extremes[0], extremes[1], record


@kernel
def drag_a_length(table, hand, speed, start, step, settle_steps, finer, record_steps):
    """Record a stretch of the motion after some steps, whether or not it repeats.

    The record's steps are `finer` times shorter than `step`.

    Returns
    -------
    tuple (smallest, largest, record)
    """
    course = lay_out(table[0], table[1], table[2])
    pull = Pull(hand[0], hand[1], hand[2], speed)
    period = course.edges[course.edges.size - 1]
    origin = table[2][0] if table[2].size > 0 else 0.0
    phase = start - origin - math.floor((start - origin) / period) * period
    state = np.empty(6)
    place_at(state, 0.0, speed, phase, course)
    advance_period(state, settle_steps, step, course, pull, np.zeros(2), np.empty((0, 3)))
    record, extremes = np.empty((record_steps, 3)), np.array([np.inf, -np.inf])
    advance_period(state, record_steps, step / finer, course, pull, extremes, record)
    return extremes[0], extremes[1], record

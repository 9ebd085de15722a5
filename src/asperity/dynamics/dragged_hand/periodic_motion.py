r"""Finding the periodic motion of a dragged hand.

Over one period of the drive the hand's state (u - v t, u') is mapped to P(u - v t, u'); a periodic
motion is a fixed point of P. Plain iteration converges to it by a factor `exp(-b T / 2 m)` a
period, which takes dozens of periods of a fine texture.

The idea: P is nearly linear, so three successive periods determine its 2 x 2 Jacobian `J`, and the
fixed point follows as `y + (I - J)^-1 (P(y) - y)` (Steffensen's method in two dimensions). It is
accepted only if the next period confirms it and all eigenvalues of J are smaller than 1 in
magnitude, because an unstable fixed point is not a motion that a hand settles to. If this fails,
the hand is dragged on, and its state is compared with those of up to eight periods before.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from asperity._core.kernels import inner_kernel, kernel
from asperity.dynamics.dragged_hand.integrator import DRAG_STATE, advance_period, force_table

PERIODIC_TOLERANCE = 1e-6
"""(u - v t, u') repeats to this fraction of (the surface's period, the speed)."""
MAX_SUBHARMONIC = 8
"""Largest number of periods after which the motion may repeat."""
_APERIODIC_PERIODS = 16
"""Periods of the surface in the record of an aperiodic motion."""
_CYCLES = 8
_FIRST_PERIODS = 2
_APART = 1000.0
"""Periods of a subharmonic motion differ by more than this many tolerances; a motion that misses
its repeat by more does not repeat."""
_RECORDINGS = 60
_STABLE = 0.98
"""Largest magnitude of the Jacobian's eigenvalues at which a motion counts as stable."""


class PeriodSearch(NamedTuple):
    """How to look for a periodic motion, and how to record it."""

    steps: int
    """Integration steps a period."""
    max_periods: int
    """Periods after which the motion counts as aperiodic."""
    extrapolate: bool
    """Whether to look for the fixed point by extrapolation first."""
    samples: int
    """Recorded samples for each integration step."""


@kernel
def place_at(motion, lag, speed, phase, table):
    """Put the hand at `lag` [m] ahead of a drive at `phase` [m] of the period."""
    state = motion[0]
    period = table.jumps[table.jumps.size - 1]
    wraps = math.floor((phase + lag) / period)
    state.position = phase + lag - wraps * period
    state.drive = phase - wraps * period
    state.velocity, state.hold, state.interval, state.segment = speed, np.nan, 0, 0
    if table.jumps.size > 1:
        segment = np.searchsorted(table.jumps, state.position, side="right") - 1
        state.segment = min(max(segment, 0), table.jumps.size - 2)


@inner_kernel
def _jacobian(y, jacobian_out):
    """Fill the Jacobian of P from four successive states (4, 2); return whether it is defined."""
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


@inner_kernel
def _largest_eigenvalue(j):
    """Return the largest magnitude of the eigenvalues of a 2 x 2 matrix."""
    half, determinant = 0.5 * (j[0, 0] + j[1, 1]), j[0, 0] * j[1, 1] - j[0, 1] * j[1, 0]
    inside = half * half - determinant
    if inside < 0.0:
        return math.sqrt(determinant)
    return abs(half) + math.sqrt(inside)


@inner_kernel
def _jump_ahead(motion, before, after, j, tolerance, phase, table):
    """Move to the fixed point `y + (I - J)^-1 (P(y) - y)`, with y and P(y) in tolerances."""
    determinant = (1.0 - j[0, 0]) * (1.0 - j[1, 1]) - j[0, 1] * j[1, 0]
    d0, d1 = after[0] - before[0], after[1] - before[1]
    lag = before[0] + ((1.0 - j[1, 1]) * d0 + j[0, 1] * d1) / determinant
    speed = before[1] + (j[1, 0] * d0 + (1.0 - j[0, 0]) * d1) / determinant
    place_at(motion, lag * tolerance[0], speed * tolerance[1], phase, table)


@kernel
def _scaled(motion, tolerance):
    """Return (u - v t, u'), each over its tolerance."""
    state = motion[0]
    return np.array([(state.position - state.drive) / tolerance[0], state.velocity / tolerance[1]])


@kernel
def _run_period(motion, search, table, model):
    """Advance by one period, without a record."""
    step = table.edges[table.edges.size - 1] / model.speed / search.steps
    advance_period(motion, search.steps, step, table, model, np.zeros(2), np.empty((0, 3)))


@kernel
def _recorded(motion, steps, step, table, model):
    """Advance by `steps` steps; return the smallest and largest u'', and the record."""
    record, extremes = np.empty((steps, 3)), np.array([np.inf, -np.inf])
    advance_period(motion, steps, step, table, model, extremes, record)
    return extremes[0], extremes[1], record


@kernel
def extrapolate_repeat(motion, phase, search, table, model, tolerance, jacobian_out):
    """Look for the fixed point; return (found, periods run, mismatch) and fill the Jacobian.

    `tolerance` (2,) scales (u - v t, u'), and `mismatch` is in units of it. If nothing is found,
    the motion is left where the search ended.
    """
    y = np.empty((4, 2))
    for _ in range(_FIRST_PERIODS):
        _run_period(motion, search, table, model)
    run, stable = _FIRST_PERIODS, False
    mismatch = np.inf
    for _ in range(_CYCLES):
        for k in range(4):
            if k > 0:
                _run_period(motion, search, table, model)
                run += 1
            y[k] = _scaled(motion, tolerance)
            if k > 0:
                mismatch = max(abs(y[k, 0] - y[k - 1, 0]), abs(y[k, 1] - y[k - 1, 1]))
                if mismatch <= 1.0 and stable:
                    return True, run, mismatch
        if not _jacobian(y, jacobian_out):
            continue
        stable = _largest_eigenvalue(jacobian_out) < _STABLE
        if not stable:
            return False, run, mismatch
        _jump_ahead(motion, y[2], y[3], jacobian_out, tolerance, phase, table)
    return False, run, mismatch


@kernel
def run_until_repeat(motion, search, table, model, tolerance):
    """Advance by whole periods until (u - v t, u') repeats.

    Returns
    -------
    tuple (repeats_after, periods_run, mismatch)
        `repeats_after` is 0 if the motion has not repeated within `search.max_periods`;
        `mismatch` is that of the last period, in tolerances.
    """
    state = motion[0]
    history = np.empty((MAX_SUBHARMONIC, 2))
    mismatch = np.inf
    for period in range(search.max_periods + 1):
        lag, speed = state.position - state.drive, state.velocity
        for back in range(1, min(MAX_SUBHARMONIC, period) + 1):
            old = (period - back) % MAX_SUBHARMONIC
            miss = max(
                abs(lag - history[old, 0]) / tolerance[0],
                abs(speed - history[old, 1]) / tolerance[1],
            )
            if back == 1:
                mismatch = miss
            # A motion that alternates while it settles is also close to itself two periods ago.
            if miss <= 1.0 and (back == 1 or mismatch > _APART):
                return back, period, miss
        latest = period % MAX_SUBHARMONIC
        history[latest, 0], history[latest, 1] = lag, speed
        if period < search.max_periods:
            _run_period(motion, search, table, model)
    return 0, search.max_periods, mismatch


@inner_kernel
def _phase(cubics, start):
    """Return `start` relative to the force table's beginning, within its period."""
    period = cubics[0][cubics[0].size - 1]
    origin = cubics[2][0] if cubics[2].size > 0 else 0.0
    return start - origin - math.floor((start - origin) / period) * period


@kernel
def drag_until_repeat(cubics, model, start, search):
    """Find the periodic motion of a dragged hand, or give up, and record it.

    Parameters
    ----------
    cubics : (edges, coefficients, jumps)
        Of the force, as in `PiecewiseCubic`.
    model : DragModel
    start : float
        Position at which the drive starts [m].
    search : PeriodSearch

    Returns
    -------
    tuple (repeats_after, periods_run, mismatch, smallest, largest, record)
        `repeats_after` is 0 if no periodic motion was found; `mismatch` is relative to the period
        and the speed; `smallest` and `largest` are the extremes of u'' [m/s^2]; `record` (n, 3)
        holds u - v t, u' and u''.
    """
    table = force_table(cubics[0], cubics[1], cubics[2])
    period = table.edges[table.edges.size - 1]
    phase = _phase(cubics, start)
    steps, samples = search.steps, search.samples
    step = period / model.speed / steps
    tolerance = np.array([PERIODIC_TOLERANCE * period, PERIODIC_TOLERANCE * model.speed])
    motion = np.empty(1, DRAG_STATE)
    place_at(motion, 0.0, model.speed, phase, table)
    repeat, run, mismatch = 0, 0, np.inf
    jacobian, is_ahead = np.zeros((2, 2)), False
    if search.extrapolate:
        is_ahead, run, mismatch = extrapolate_repeat(
            motion, phase, search, table, model, tolerance, jacobian
        )
        repeat = 1 if is_ahead else 0
    if repeat == 0:
        place_at(motion, 0.0, model.speed, phase, table)
        repeat, run, mismatch = run_until_repeat(motion, search, table, model, tolerance)
    periods = repeat if repeat > 0 else _APERIODIC_PERIODS
    nearest, least = motion, np.inf
    for _ in range(_RECORDINGS):
        before = _scaled(motion, tolerance)
        smallest, largest, record = _recorded(
            motion, periods * steps * samples, step / samples, table, model
        )
        after = _scaled(motion, tolerance)
        if repeat == 0:
            break
        # The finer steps of the record have a slightly different fixed point.
        mismatch = max(abs(after[0] - before[0]), abs(after[1] - before[1]))
        if mismatch <= 1.0:
            break
        run += repeat
        if is_ahead and mismatch < least:
            nearest, least = motion.copy(), mismatch
            _jump_ahead(motion, before, after, jacobian, tolerance, phase, table)
        elif is_ahead:
            # The extrapolation diverged, because the Jacobian was measured where the motion hardly
            # changed any more. From the nearest state plain iteration converges.
            is_ahead, motion = False, nearest
    if repeat > 0 and not mismatch <= _APART:
        repeat = 0
        smallest, largest, record = _recorded(
            motion, _APERIODIC_PERIODS * steps * samples, step / samples, table, model
        )
    return repeat, run, mismatch * PERIODIC_TOLERANCE, smallest, largest, record


@kernel
def drag_a_length(cubics, model, start, step, settle_steps, samples, record_steps):
    """Record part of the motion after some steps, whether or not it repeats.

    Parameters
    ----------
    cubics, model, start
        As for `drag_until_repeat`.
    step : float
        Integration step [s].
    settle_steps : int
        Steps before the record begins.
    samples : int
        Recorded samples for each `step`.
    record_steps : int
        Samples in the record.

    Returns
    -------
    tuple (smallest, largest, record)
    """
    table = force_table(cubics[0], cubics[1], cubics[2])
    motion = np.empty(1, DRAG_STATE)
    place_at(motion, 0.0, model.speed, _phase(cubics, start), table)
    advance_period(motion, settle_steps, step, table, model, np.zeros(2), np.empty((0, 3)))
    return _recorded(motion, record_steps, step / samples, table, model)

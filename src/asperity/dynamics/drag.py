"""The compiled integrator behind `asperity.dynamics.hand`: see there for the idea.

A drag's state is an array: place and speed of the hand, place of the drive (both counted from the
start of the current period of the surface), the stretch between jumps and the table's interval
that the place lies in, and the force that holds the hand at rest in a notch (else NaN).
"""

from __future__ import annotations

import math

import numpy as np

from asperity.compiled import kernel
from asperity.geometry.piecewise import locate, value_and_slope

PLACE, SPEED, DRIVE, STRETCH, INTERVAL, HOLD = range(6)

_SECANT_STEPS = 40
_MAX_EVENTS = 2000
_SHORT_HOP = 0.002
"""Part of a step: a hand that bounces in a notch for less than this at a time rests in it."""
_LOW_HOP = 1e-7
"""Part of the period, likewise: hops lower than an atom."""


@kernel
def texture_force(state, place, ends, edges, coefficients):
    """Return F_u [N] and dF_u/du at `place`, by the cubics of the stretch with these ends."""
    if ends[0] == -np.inf:
        period = edges[edges.size - 1]
        place -= math.floor(place / period) * period
    else:
        place = min(max(place, ends[0]), ends[1])
    interval = locate(edges, place, int(state[INTERVAL]))
    if place >= ends[1] and interval > 0 and edges[interval] >= ends[1]:
        interval -= 1  # an edge belongs to both sides; this is the one below
    state[INTERVAL] = interval
    return value_and_slope(edges, coefficients, interval, place)


@kernel
def _acceleration(state, place, speed, drive, ends, edges, coefficients, hand):
    """Return u''; `hand` is (mass, stiffness, damping, drag speed)."""
    force, _ = texture_force(state, place, ends, edges, coefficients)
    return (hand[1] * (drive - place) + hand[2] * (hand[3] - speed) - force) / hand[0]


@kernel
def _runge_kutta(state, step, ends, edges, coefficients, hand):
    """Return (place, speed) after one classical Runge-Kutta step from `state`."""
    place, speed, drive = state[PLACE], state[SPEED], state[DRIVE]
    half = 0.5 * step
    middle, end = drive + half * hand[3], drive + step * hand[3]
    a1 = _acceleration(state, place, speed, drive, ends, edges, coefficients, hand)
    v2 = speed + half * a1
    a2 = _acceleration(state, place + half * speed, v2, middle, ends, edges, coefficients, hand)
    v3 = speed + half * a2
    a3 = _acceleration(state, place + half * v2, v3, middle, ends, edges, coefficients, hand)
    v4 = speed + step * a3
    a4 = _acceleration(state, place + step * v3, v4, end, ends, edges, coefficients, hand)
    return (
        place + step / 6.0 * (speed + 2.0 * (v2 + v3) + v4),
        speed + step / 6.0 * (a1 + 2.0 * (a2 + a3) + a4),
    )


@kernel
def stretch_ends(jumps, period, stretch):
    """Return where the smooth stretch number `stretch` begins and ends."""
    if jumps.size == 0:
        return -np.inf, np.inf
    high = jumps[stretch + 1] if stretch + 1 < jumps.size else period
    return jumps[stretch], high


@kernel
def _cross(state, forward, jumps, period):
    """Move the state, which stands on a jump, into the stretch on the other side."""
    stretch = int(state[STRETCH]) + (1 if forward else -1)
    if stretch == jumps.size:
        stretch = 0
        state[PLACE], state[DRIVE] = jumps[0], state[DRIVE] - period
    elif stretch < 0:
        stretch = jumps.size - 1
        state[PLACE], state[DRIVE] = period, state[DRIVE] + period
    state[STRETCH] = stretch


@kernel
def _step_to_jump(state, step, target, end_place, ends, edges, coefficients, hand):
    """Return the time after which `place` meets `target`, between 0 and `step` (Illinois)."""
    low, high = 0.0, step
    at_low, at_high = state[PLACE] - target, end_place - target
    if at_low * at_high >= 0.0:
        # The state stands on the jump already. It moves out of the stretch at once, or first
        # into it and comes back: then shorten the step until it is inside.
        if state[SPEED] * at_high >= 0.0:
            return 0.0
        while at_low * at_high >= 0.0:
            if low > 0.0:
                high, at_high = low, at_low
            low = 0.5 * high
            if low < 1e-15 * step:
                return 0.0
            place, _ = _runge_kutta(state, low, ends, edges, coefficients, hand)
            at_low = place - target
    side = 0
    time = step
    for _ in range(_SECANT_STEPS):
        time = (low * at_high - high * at_low) / (at_high - at_low)
        place, _ = _runge_kutta(state, time, ends, edges, coefficients, hand)
        miss = place - target
        if abs(miss) < 1e-13 or high - low < 1e-15 * step:
            break
        if miss * at_high > 0.0:
            high, at_high = time, miss
            if side == -1:
                at_low *= 0.5
            side = -1
        else:
            low, at_low = time, miss
            if side == 1:
                at_high *= 0.5
            side = 1
    return time


@kernel
def _note_extremes(extremes, a0, a1, state0, state1, step):
    """Widen (smallest, largest) by u'' over a smooth step: a cubic through its ends' jerks."""
    extremes[0] = min(extremes[0], a0, a1)
    extremes[1] = max(extremes[1], a0, a1)
    j0, j1 = state0 * step, state1 * step
    if j0 * j1 >= 0.0:
        return
    # Hermite: a(t) = a0 + j0 t + c t^2 + d t^3, whose derivative vanishes once inside.
    c, d = 3.0 * (a1 - a0) - 2.0 * j0 - j1, 2.0 * (a0 - a1) + j0 + j1
    low, high = 0.0, 1.0
    for _ in range(30):
        t = 0.5 * (low + high)
        if (j0 + t * (2.0 * c + 3.0 * d * t)) * j0 > 0.0:
            low = t
        else:
            high = t
    value = a0 + t * (j0 + t * (c + t * d))
    # A smooth peak rises above its ends by less than the gentler jerk could lift it; a jerk read
    # off in a very short stretch of the table may be wild, and must not invent a peak.
    lift = min(abs(j0), abs(j1))
    value = min(max(value, min(a0, a1) - lift), max(a0, a1) + lift)
    extremes[0] = min(extremes[0], value)
    extremes[1] = max(extremes[1], value)


@kernel
def acceleration_and_jerk(state, ends, edges, coefficients, hand):
    """Return u'' and u''' of the state, by the cubics of the stretch with these ends."""
    force, slope = texture_force(state, state[PLACE], ends, edges, coefficients)
    lag, excess = state[DRIVE] - state[PLACE], hand[3] - state[SPEED]
    acceleration = (hand[1] * lag + hand[2] * excess - force) / hand[0]
    jerk = (hand[1] * excess - hand[2] * acceleration - slope * state[SPEED]) / hand[0]
    return acceleration, jerk


@kernel
def _cross_or_rest(state, step, ends, forward, jumps, edges, coefficients, hand):
    """Move a state that stands on a jump to the other side, or lay it to rest in the notch.

    Between two asperities the force on either side pushes the hand back into the notch, and it
    bounces from side to side, ever lower. Once the hops are too short or too low to matter, it
    rests: on the far side, until the drive's pull exceeds the force there.
    """
    period = edges[edges.size - 1]
    before, _ = texture_force(state, state[PLACE], ends, edges, coefficients)
    _cross(state, forward, jumps, period)
    beyond = stretch_ends(jumps, period, int(state[STRETCH]))
    after, _ = texture_force(state, state[PLACE], beyond, edges, coefficients)
    behind, ahead = (before, after) if forward else (after, before)
    pull = hand[1] * (state[DRIVE] - state[PLACE]) + hand[2] * hand[3]
    back = min(pull - behind, ahead - pull)
    momentum = hand[0] * abs(state[SPEED])
    short = 2.0 * momentum <= _SHORT_HOP * step * back
    low = momentum * abs(state[SPEED]) <= 2.0 * _LOW_HOP * period * back
    if behind < pull < ahead and (short or low):
        if not forward:
            _cross(state, True, jumps, period)
        state[SPEED], state[HOLD] = 0.0, ahead


@kernel
def _wait_in_notch(state, remaining, hand):
    """Let the drive go on while the hand rests; return the time that is left after the wait."""
    pull = hand[1] * (state[DRIVE] - state[PLACE]) + hand[2] * hand[3]
    wait = max((state[HOLD] - pull) / (hand[1] * hand[3]), 0.0)
    if wait < remaining:
        state[HOLD] = np.nan
    wait = min(wait, remaining)
    state[DRIVE] += wait * hand[3]
    return remaining - wait


@kernel
def advance(state, step, jumps, edges, coefficients, hand, extremes):
    """Advance the state by a step, across any jumps, and widen the extremes of u''.

    The extremes become NaN if the step meets more jumps than it can cross.
    """
    period = edges[edges.size - 1]
    remaining = step
    for _ in range(_MAX_EVENTS):
        if not math.isnan(state[HOLD]):
            remaining = _wait_in_notch(state, remaining, hand)
            _note_extremes(extremes, 0.0, 0.0, 0.0, 0.0, 0.0)
            if remaining <= 0.0:
                return
        ends = stretch_ends(jumps, period, int(state[STRETCH]))
        a0, j0 = acceleration_and_jerk(state, ends, edges, coefficients, hand)
        place, speed = _runge_kutta(state, remaining, ends, edges, coefficients, hand)
        taken, target = remaining, place
        if not ends[0] <= place <= ends[1]:
            target = ends[1] if place > ends[1] else ends[0]
            taken = _step_to_jump(
                state, remaining, target, place, ends, edges, coefficients, hand
            )
            _, speed = _runge_kutta(state, taken, ends, edges, coefficients, hand)
        arrived = target == place
        state[PLACE], state[SPEED] = target, speed
        state[DRIVE] += taken * hand[3]
        remaining -= taken
        a1, j1 = acceleration_and_jerk(state, ends, edges, coefficients, hand)
        _note_extremes(extremes, a0, a1, j0, j1, taken)
        if arrived:
            if jumps.size == 0:
                wraps = math.floor(state[PLACE] / period)
                state[PLACE] -= wraps * period
                state[DRIVE] -= wraps * period
            return
        forward = target == ends[1]
        _cross_or_rest(state, step, ends, forward, jumps, edges, coefficients, hand)
    extremes[0] = extremes[1] = np.nan


@kernel
def advance_period(state, steps, step, jumps, edges, coefficients, hand, extremes, record_out):
    """Advance by `steps` steps; fill (place - drive, speed, u'') before each, shape (steps, 3).

    With an empty `record_out` nothing is recorded.
    """
    period = edges[edges.size - 1]
    for i in range(steps):
        if record_out.shape[0] > 0:
            record_out[i, 0] = state[PLACE] - state[DRIVE]
            record_out[i, 1] = state[SPEED]
            record_out[i, 2] = 0.0
            if math.isnan(state[HOLD]):
                ends = stretch_ends(jumps, period, int(state[STRETCH]))
                record_out[i, 2], _ = acceleration_and_jerk(
                    state, ends, edges, coefficients, hand
                )
        advance(state, step, jumps, edges, coefficients, hand, extremes)


@kernel
def run_until_repeat(
    state, steps, step, jumps, edges, coefficients, hand, tolerance, most_periods, history
):
    """Advance by whole periods until (place - drive, speed) repeats.

    Returns
    -------
    tuple (repeats_after, periods_run, mismatch)
        `repeats_after` is 0 where the motion has not repeated within `most_periods`;
        `mismatch` is what the last period missed a repeat by, relative to `tolerance`.
    """
    depth = history.shape[0]
    nothing = np.empty((0, 3))
    extremes = np.zeros(2)
    mismatch = np.inf
    for period in range(most_periods + 1):
        lag, speed = state[PLACE] - state[DRIVE], state[SPEED]
        for back in range(1, min(depth, period) + 1):
            old = history[(period - back) % depth]
            miss = max(abs(lag - old[0]) / tolerance[0], abs(speed - old[1]) / tolerance[1])
            if back == 1:
                mismatch = miss
            if miss <= 1.0:
                return back, period, miss
        history[period % depth, 0], history[period % depth, 1] = lag, speed
        if period < most_periods:
            advance_period(
                state, steps, step, jumps, edges, coefficients, hand, extremes, nothing
            )
    return 0, most_periods, mismatch

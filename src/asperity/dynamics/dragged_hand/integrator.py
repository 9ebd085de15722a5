"""The compiled integrator of a dragged hand; `dragged_hand.hand` describes the method.

Kernels that advance a motion take it as `motion`, an array (1,) of `DRAG_STATE`, and change it in
place. Between two jumps of the force the table is a *segment* of smooth cubics.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from asperity._core.arrays import Array, Indices
from asperity._core.kernels import inner_kernel, kernel

DRAG_STATE = np.dtype(
    [
        ("position", "f8"),  # u of the hand, from the start of the current period [m]
        ("velocity", "f8"),  # u' [m/s]
        ("drive", "f8"),  # v t, from the start of the hand's current period [m]
        ("hold", "f8"),  # force that the hand rests against in a notch [N]; NaN in motion
        ("segment", "i8"),  # segment between jumps that the hand is on
        ("interval", "i8"),  # interval of the table where the hand was last, a search hint
    ],
    align=True,
)
_SECANT_STEPS = 40
_MAX_EVENTS = 2000
"""Largest number of jumps that one step crosses."""
_SHORT_HOP = 2e-3
"""A hand that bounces in a notch for less than this fraction of sqrt(m / k) counts as resting."""
_LOW_HOP = 1e-6
"""So does one that hops lower than this fraction of the period, a few atoms."""


class ForceTable(NamedTuple):
    """A piecewise cubic force, with its period starting at a jump if there is one."""

    edges: Array
    """Left edges of the n intervals, then the period [m]."""
    powers: Array
    """Coefficients of 1, x, x^2, x^3, with x [m] from the interval's left edge (n, 4)."""
    jumps: Array
    """Positions of the force's jumps, then the period [m]; only the period if it has none."""
    firsts: Indices
    """Interval that begins at each of `jumps`; the last entry is n."""


class DragModel(NamedTuple):
    """The hand of Eq. 7 and the speed of its drive."""

    mass: float
    """[kg]"""
    stiffness: float
    """[N/m]"""
    damping: float
    """[N s/m]"""
    speed: float
    """[m/s]"""


@kernel
def force_table(edges, coefficients, jumps):
    """Return the `ForceTable` of a `PiecewiseCubic`'s edges, coefficients and jumps."""
    n = coefficients.shape[0]
    period = edges[n]
    first = np.searchsorted(edges, jumps[0]) if jumps.size > 0 else 0
    origin = edges[first]
    shifted, powers = np.empty(n + 1), np.empty((n, 4))
    for k in range(n):
        i = (first + k) % n
        shifted[k] = edges[i] - origin if i >= first else edges[i] + period - origin
        width, scale = edges[i + 1] - edges[i], 1.0
        for power in range(4):
            powers[k, power] = coefficients[i, power] * scale
            scale /= width
    shifted[n] = period
    ends, firsts = np.empty(jumps.size + 1), np.empty(jumps.size + 1, dtype=np.int64)
    for k in range(jumps.size):
        ends[k] = jumps[k] - origin
        firsts[k] = np.searchsorted(shifted, ends[k])
    ends[jumps.size], firsts[jumps.size] = period, n
    return ForceTable(shifted, powers, ends, firsts)


@inner_kernel
def _interval_at(table, place, interval, segment):
    """Return the interval of a segment that contains `place`, by walking from `interval`."""
    first, last = 0, table.powers.shape[0] - 1
    if table.jumps.size > 1:
        first, last = table.firsts[segment], table.firsts[segment + 1] - 1
    i = min(max(interval, first), last)
    while i > first and place < table.edges[i]:
        i -= 1
    while i < last and place >= table.edges[i + 1]:
        i += 1
    return i


@kernel
def _clamp_or_wrap(table, place, segment):
    """Return `place` clamped to its segment, or wrapped into the period if there are no jumps."""
    if table.jumps.size > 1:
        return min(max(place, table.jumps[segment]), table.jumps[segment + 1])
    period = table.jumps[0]
    if place >= period:
        return place - period
    return place + period if place < 0.0 else place


@kernel
def _force(table, place, interval, segment):
    """Return (F_u, interval) at `place` on a segment, whose end values extend beyond it."""
    place = _clamp_or_wrap(table, place, segment)
    i = _interval_at(table, place, interval, segment)
    x = place - table.edges[i]
    c = table.powers
    return c[i, 0] + x * (c[i, 1] + x * (c[i, 2] + x * c[i, 3])), i


@kernel
def force_at(table, place):
    """Return F_u at any place, found by bisection."""
    period = table.edges[table.edges.size - 1]
    place -= math.floor(place / period) * period
    i = np.searchsorted(table.edges, place, side="right") - 1
    i = min(i, table.powers.shape[0] - 1)
    x, c = place - table.edges[i], table.powers
    return c[i, 0] + x * (c[i, 1] + x * (c[i, 2] + x * c[i, 3]))


@inner_kernel
def _runge_kutta(motion, step, table, model):
    """Return position and velocity after one classical Runge-Kutta step."""
    state = motion[0]
    place, speed, drive = state.position, state.velocity, state.drive
    segment, i = state.segment, state.interval
    k, b, v = model.stiffness, model.damping, model.speed
    per_mass, half = 1.0 / model.mass, 0.5 * step
    force, i = _force(table, place, i, segment)
    state.interval = i
    a1 = (k * (drive - place) + b * (v - speed) - force) * per_mass
    p2, v2 = place + half * speed, speed + half * a1
    drive += half * v
    force, i = _force(table, p2, i, segment)
    a2 = (k * (drive - p2) + b * (v - v2) - force) * per_mass
    p3, v3 = place + half * v2, speed + half * a2
    force, i = _force(table, p3, i, segment)
    a3 = (k * (drive - p3) + b * (v - v3) - force) * per_mass
    p4, v4 = place + step * v3, speed + step * a3
    drive += half * v
    force, i = _force(table, p4, i, segment)
    a4 = (k * (drive - p4) + b * (v - v4) - force) * per_mass
    return (
        place + step / 6.0 * (speed + 2.0 * (v2 + v3) + v4),
        speed + step / 6.0 * (a1 + 2.0 * (a2 + a3) + a4),
    )


@inner_kernel
def acceleration_and_jerk(motion, table, model):
    """Return u'' and u''' of a motion on its segment."""
    state = motion[0]
    segment = state.segment
    place = _clamp_or_wrap(table, state.position, segment)
    i = _interval_at(table, place, state.interval, segment)
    x, c = place - table.edges[i], table.powers
    force = c[i, 0] + x * (c[i, 1] + x * (c[i, 2] + x * c[i, 3]))
    slope = c[i, 1] + x * (2.0 * c[i, 2] + 3.0 * x * c[i, 3])
    lag, excess = state.drive - state.position, model.speed - state.velocity
    acceleration = (model.stiffness * lag + model.damping * excess - force) / model.mass
    jerk = (
        model.stiffness * excess - model.damping * acceleration - slope * state.velocity
    ) / model.mass
    return acceleration, jerk


@inner_kernel
def _time_to_jump(motion, step, target, end_place, table, model):
    """Return the time, 0 to `step`, at which u reaches `target` (Illinois method)."""
    state = motion[0]
    low, high = 0.0, step
    at_low, at_high = state.position - target, end_place - target
    if at_low * at_high >= 0.0:
        # The hand is at the jump already. It leaves the segment at once, or first enters it and
        # returns: in that case shorten the step until it ends inside.
        if state.velocity * at_high >= 0.0:
            return 0.0
        while at_low * at_high >= 0.0:
            if low > 0.0:
                high, at_high = low, at_low
            low = 0.5 * high
            if low < 1e-15 * step:
                return 0.0
            place, _ = _runge_kutta(motion, low, table, model)
            at_low = place - target
    side = 0
    time = step
    for _ in range(_SECANT_STEPS):
        time = (low * at_high - high * at_low) / (at_high - at_low)
        place, _ = _runge_kutta(motion, time, table, model)
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
def _cross(motion, forward, table):
    """Move a hand that is at a jump to the segment on the other side."""
    state = motion[0]
    count = table.jumps.size - 1
    period = table.jumps[count]
    segment = state.segment + (1 if forward else -1)
    if segment == count:
        segment = 0
        state.position, state.drive = 0.0, state.drive - period
    elif segment < 0:
        segment = count - 1
        state.position, state.drive = period, state.drive + period
    state.segment = segment


@inner_kernel
def _cross_or_rest(motion, forward, table, model):
    """Move a hand that is at a jump to the other side, or bring it to rest in the notch.

    In the notch between two asperities the force on either side pushes the hand back, and it
    bounces with decreasing amplitude. Once the hops are shorter than `_SHORT_HOP` or lower than
    `_LOW_HOP`, it rests on the far side until the drive's force exceeds the texture's there.
    """
    state = motion[0]
    before, _ = _force(table, state.position, state.interval, state.segment)
    _cross(motion, forward, table)
    after, _ = _force(table, state.position, state.interval, state.segment)
    behind, ahead = (before, after) if forward else (after, before)
    tension = model.stiffness * (state.drive - state.position) + model.damping * model.speed
    if not behind < tension < ahead:
        return
    back = min(tension - behind, ahead - tension)
    momentum = model.mass * abs(state.velocity)
    short = 2.0 * momentum <= _SHORT_HOP * math.sqrt(model.mass / model.stiffness) * back
    period = table.jumps[table.jumps.size - 1]
    low = momentum * abs(state.velocity) <= 2.0 * _LOW_HOP * period * back
    if short or low:
        if not forward:
            _cross(motion, True, table)
        state.velocity, state.hold = 0.0, ahead


@inner_kernel
def _wait_in_notch(motion, remaining, model):
    """Advance the drive while the hand rests; return the time that remains after the wait."""
    state = motion[0]
    tension = model.stiffness * (state.drive - state.position) + model.damping * model.speed
    wait = max((state.hold - tension) / (model.stiffness * model.speed), 0.0)
    if wait < remaining:
        state.hold = np.nan
    wait = min(wait, remaining)
    state.drive += wait * model.speed
    return remaining - wait


@inner_kernel
def _widen_extremes(extremes, a0, a1, jerk0, jerk1, step):
    """Widen (smallest, largest) by u'' over a smooth step, interpolated by a cubic."""
    extremes[0] = min(extremes[0], a0, a1)
    extremes[1] = max(extremes[1], a0, a1)
    j0, j1 = jerk0 * step, jerk1 * step
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
    # A smooth peak exceeds the ends by less than the smaller jerk allows. This keeps a jerk that
    # is wrong, as in a very short interval of the table, from creating a peak.
    lift = min(abs(j0), abs(j1))
    value = min(max(value, min(a0, a1) - lift), max(a0, a1) + lift)
    extremes[0] = min(extremes[0], value)
    extremes[1] = max(extremes[1], value)


@kernel
def advance(motion, step, table, model, extremes, watch):
    """Advance a motion by a step, across any jumps; if `watch`, widen the extremes of u''.

    If the step meets more than `_MAX_EVENTS` jumps, the extremes become NaN.
    """
    state = motion[0]
    remaining = step
    bounded = table.jumps.size > 1
    a0 = j0 = 0.0
    for _ in range(_MAX_EVENTS):
        if not math.isnan(state.hold):
            remaining = _wait_in_notch(motion, remaining, model)
            if watch:
                _widen_extremes(extremes, 0.0, 0.0, 0.0, 0.0, 0.0)
            if remaining <= 0.0:
                return
        if watch:
            a0, j0 = acceleration_and_jerk(motion, table, model)
        place, speed = _runge_kutta(motion, remaining, table, model)
        taken, target, arrived = remaining, place, True
        if bounded:
            segment = state.segment
            low, high = table.jumps[segment], table.jumps[segment + 1]
            if not low <= place <= high:
                arrived = False
                target = high if place > high else low
                taken = _time_to_jump(motion, remaining, target, place, table, model)
                _, speed = _runge_kutta(motion, taken, table, model)
        state.position, state.velocity = target, speed
        state.drive += taken * model.speed
        remaining -= taken
        if watch:
            a1, j1 = acceleration_and_jerk(motion, table, model)
            _widen_extremes(extremes, a0, a1, j0, j1, taken)
        if arrived:
            if not bounded:
                wraps = math.floor(state.position / table.jumps[0])
                state.position -= wraps * table.jumps[0]
                state.drive -= wraps * table.jumps[0]
            return
        _cross_or_rest(motion, place > target, table, model)
    extremes[0] = extremes[1] = np.nan


@inner_kernel
def advance_period(motion, steps, step, table, model, extremes, record_out):
    """Advance by `steps` steps; fill (u - v t, u', u'') before each into `record_out` (steps, 3).

    With an empty `record_out` nothing is recorded, and the extremes do not change.
    """
    state = motion[0]
    watch = record_out.shape[0] > 0
    for i in range(steps):
        if watch:
            record_out[i, 0] = state.position - state.drive
            record_out[i, 1] = state.velocity
            record_out[i, 2] = 0.0
            if math.isnan(state.hold):
                record_out[i, 2], _ = acceleration_and_jerk(motion, table, model)
        advance(motion, step, table, model, extremes, watch)

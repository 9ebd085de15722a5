"""The compiled integrator behind `asperity.dynamics.dragged_hand.hand`: see there for the idea.

A drag's state is an array: place and speed of the hand, place of the drive (both counted from the
start of the current period of the surface), the stretch between jumps and the table's interval
that the place lies in, and the force that holds the hand at rest in a notch (else NaN).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity._core.kernels import kernel

PLACE, SPEED, DRIVE, STRETCH, INTERVAL, HOLD = range(6)

_SECANT_STEPS = 40
_MAX_EVENTS = 2000
_SHORT_HOP = 2e-3
"""Part of the hand's own time, sqrt(m / k): a hand that bounces in a notch for less than this at
a time rests in it."""
_LOW_HOP = 1e-6
"""Part of the period: hops of lower height, a few atoms, are no motion either."""


class Course(NamedTuple):
    """A force table laid out for the integrator; its period begins at a jump, if it has one."""

    edges: NDArray[np.float64]
    """Where the cubics begin, then the period [m]."""
    powers: NDArray[np.float64]
    """Coefficients of 1, x, x^2, x^3 with x [m] from the interval's edge, shape (n, 4)."""
    jumps: NDArray[np.float64]
    """Where the force jumps [m], then the period; just the period where it never does."""
    firsts: NDArray[np.int64]
    """The interval that begins at each of `jumps`; the last entry is n."""


class Pull(NamedTuple):
    """The hand of Eq. 7 and the speed of its drag."""

    mass: float
    stiffness: float
    damping: float
    speed: float


@kernel
def lay_out(edges, coefficients, jumps):
    """Return the `Course` of a table of cubics (see `PiecewiseCubic`)."""
    n = coefficients.shape[0]
    period = edges[n]
    first = np.searchsorted(edges, jumps[0]) if jumps.size > 0 else 0
    origin = edges[first]
    laid, powers = np.empty(n + 1), np.empty((n, 4))
    for k in range(n):
        i = (first + k) % n
        laid[k] = edges[i] - origin if i >= first else edges[i] + period - origin
        width, scale = edges[i + 1] - edges[i], 1.0
        for power in range(4):
            powers[k, power] = coefficients[i, power] * scale
            scale /= width
    laid[n] = period
    ends, firsts = np.empty(jumps.size + 1), np.empty(jumps.size + 1, dtype=np.int64)
    for k in range(jumps.size):
        ends[k] = jumps[k] - origin
        firsts[k] = np.searchsorted(laid, ends[k])
    ends[jumps.size], firsts[jumps.size] = period, n
    return Course(laid, powers, ends, firsts)


@kernel
def _interval_at(course, place, interval, stretch):
    """Return the interval of a stretch that holds `place`, by walking from `interval`."""
    first, last = 0, course.powers.shape[0] - 1
    if course.jumps.size > 1:
        first, last = course.firsts[stretch], course.firsts[stretch + 1] - 1
    i = min(max(interval, first), last)
    while i > first and place < course.edges[i]:
        i -= 1
    while i < last and place >= course.edges[i + 1]:
        i += 1
    return i


@kernel
def _inside(course, place, stretch):
    """Return `place` brought to where the cubics of its stretch are defined."""
    if course.jumps.size > 1:
        return min(max(place, course.jumps[stretch]), course.jumps[stretch + 1])
    period = course.jumps[0]
    if place >= period:
        return place - period
    return place + period if place < 0.0 else place


@kernel
def _force(course, place, interval, stretch):
    """Return (F_u, interval) at `place`, by the cubics of its stretch, held beyond its ends."""
    place = _inside(course, place, stretch)
    i = _interval_at(course, place, interval, stretch)
    x = place - course.edges[i]
    c = course.powers
    return c[i, 0] + x * (c[i, 1] + x * (c[i, 2] + x * c[i, 3])), i


@kernel
def force_at(course, place):
    """Return F_u at any place, found by bisection: for peers and tests, with no state to hint."""
    period = course.edges[course.edges.size - 1]
    place -= math.floor(place / period) * period
    i = np.searchsorted(course.edges, place, side="right") - 1
    i = min(i, course.powers.shape[0] - 1)
    x, c = place - course.edges[i], course.powers
    return c[i, 0] + x * (c[i, 1] + x * (c[i, 2] + x * c[i, 3]))


@kernel
def _runge_kutta(state, step, course, pull):
    """Return (place, speed) after one classical Runge-Kutta step from `state`."""
    place, speed, drive = state[PLACE], state[SPEED], state[DRIVE]
    stretch, i = int(state[STRETCH]), int(state[INTERVAL])
    k, b, v = pull.stiffness, pull.damping, pull.speed
    per_mass, half = 1.0 / pull.mass, 0.5 * step
    force, i = _force(course, place, i, stretch)
    state[INTERVAL] = i
    a1 = (k * (drive - place) + b * (v - speed) - force) * per_mass
    p2, v2 = place + half * speed, speed + half * a1
    drive += half * v
    force, i = _force(course, p2, i, stretch)
    a2 = (k * (drive - p2) + b * (v - v2) - force) * per_mass
    p3, v3 = place + half * v2, speed + half * a2
    force, i = _force(course, p3, i, stretch)
    a3 = (k * (drive - p3) + b * (v - v3) - force) * per_mass
    p4, v4 = place + step * v3, speed + step * a3
    drive += half * v
    force, i = _force(course, p4, i, stretch)
    a4 = (k * (drive - p4) + b * (v - v4) - force) * per_mass
    return (
        place + step / 6.0 * (speed + 2.0 * (v2 + v3) + v4),
        speed + step / 6.0 * (a1 + 2.0 * (a2 + a3) + a4),
    )


@kernel
def acceleration_and_jerk(state, course, pull):
    """Return u'' and u''' of the state, by the cubics of its stretch."""
    stretch = int(state[STRETCH])
    place = _inside(course, state[PLACE], stretch)
    i = _interval_at(course, place, int(state[INTERVAL]), stretch)
    x, c = place - course.edges[i], course.powers
    force = c[i, 0] + x * (c[i, 1] + x * (c[i, 2] + x * c[i, 3]))
    slope = c[i, 1] + x * (2.0 * c[i, 2] + 3.0 * x * c[i, 3])
    lag, excess = state[DRIVE] - state[PLACE], pull.speed - state[SPEED]
    acceleration = (pull.stiffness * lag + pull.damping * excess - force) / pull.mass
    jerk = (
        pull.stiffness * excess - pull.damping * acceleration - slope * state[SPEED]
    ) / pull.mass
    return acceleration, jerk


@kernel
def _time_to_jump(state, step, target, end_place, course, pull):
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
            place, _ = _runge_kutta(state, low, course, pull)
            at_low = place - target
    side = 0
    time = step
    for _ in range(_SECANT_STEPS):
        time = (low * at_high - high * at_low) / (at_high - at_low)
        place, _ = _runge_kutta(state, time, course, pull)
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
def _cross(state, forward, course):
    """Move a state that stands on a jump into the stretch on the other side."""
    count = course.jumps.size - 1
    period = course.jumps[count]
    stretch = int(state[STRETCH]) + (1 if forward else -1)
    if stretch == count:
        stretch = 0
        state[PLACE], state[DRIVE] = 0.0, state[DRIVE] - period
    elif stretch < 0:
        stretch = count - 1
        state[PLACE], state[DRIVE] = period, state[DRIVE] + period
    state[STRETCH] = stretch


@kernel
def _cross_or_rest(state, forward, course, pull):
    """Move a state that stands on a jump to the other side, or lay it to rest in the notch.

    Between two asperities the force on either side pushes the hand back into the notch, and it
    bounces from side to side, ever lower. Once the hops are too short or too low to matter, it
    rests: on the far side, until the drive's pull exceeds the force there.
    """
    before, _ = _force(course, state[PLACE], int(state[INTERVAL]), int(state[STRETCH]))
    _cross(state, forward, course)
    after, _ = _force(course, state[PLACE], int(state[INTERVAL]), int(state[STRETCH]))
    behind, ahead = (before, after) if forward else (after, before)
    tension = pull.stiffness * (state[DRIVE] - state[PLACE]) + pull.damping * pull.speed
    if not behind < tension < ahead:
        return
    back = min(tension - behind, ahead - tension)
    momentum = pull.mass * abs(state[SPEED])
    short = 2.0 * momentum <= _SHORT_HOP * math.sqrt(pull.mass / pull.stiffness) * back
    period = course.jumps[course.jumps.size - 1]
    low = momentum * abs(state[SPEED]) <= 2.0 * _LOW_HOP * period * back
    if short or low:
        if not forward:
            _cross(state, True, course)
        state[SPEED], state[HOLD] = 0.0, ahead


@kernel
def _wait_in_notch(state, remaining, pull):
    """Let the drive go on while the hand rests; return the time that is left after the wait."""
    tension = pull.stiffness * (state[DRIVE] - state[PLACE]) + pull.damping * pull.speed
    wait = max((state[HOLD] - tension) / (pull.stiffness * pull.speed), 0.0)
    if wait < remaining:
        state[HOLD] = np.nan
    wait = min(wait, remaining)
    state[DRIVE] += wait * pull.speed
    return remaining - wait


@kernel
def _note_extremes(extremes, a0, a1, jerk0, jerk1, step):
    """Widen (smallest, largest) by u'' over a smooth step: a cubic through its ends' jerks."""
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
    # A smooth peak rises above its ends by less than the gentler jerk could lift it; a jerk read
    # off in a very short stretch of the table may be wild, and must not invent a peak.
    lift = min(abs(j0), abs(j1))
    value = min(max(value, min(a0, a1) - lift), max(a0, a1) + lift)
    extremes[0] = min(extremes[0], value)
    extremes[1] = max(extremes[1], value)


@kernel
def advance(state, step, course, pull, extremes, watch):
    """Advance the state by a step, across any jumps; if `watch`, widen the extremes of u''.

    The extremes become NaN if the step meets more jumps than it can cross.
    """
    remaining = step
    bounded = course.jumps.size > 1
    a0 = j0 = 0.0
    for _ in range(_MAX_EVENTS):
        if not math.isnan(state[HOLD]):
            remaining = _wait_in_notch(state, remaining, pull)
            if watch:
                _note_extremes(extremes, 0.0, 0.0, 0.0, 0.0, 0.0)
            if remaining <= 0.0:
                return
        if watch:
            a0, j0 = acceleration_and_jerk(state, course, pull)
        place, speed = _runge_kutta(state, remaining, course, pull)
        taken, target, arrived = remaining, place, True
        if bounded:
            stretch = int(state[STRETCH])
            low, high = course.jumps[stretch], course.jumps[stretch + 1]
            if not low <= place <= high:
                arrived = False
                target = high if place > high else low
                taken = _time_to_jump(state, remaining, target, place, course, pull)
                _, speed = _runge_kutta(state, taken, course, pull)
        state[PLACE], state[SPEED] = target, speed
        state[DRIVE] += taken * pull.speed
        remaining -= taken
        if watch:
            a1, j1 = acceleration_and_jerk(state, course, pull)
            _note_extremes(extremes, a0, a1, j0, j1, taken)
        if arrived:
            if not bounded:
                wraps = math.floor(state[PLACE] / course.jumps[0])
                state[PLACE] -= wraps * course.jumps[0]
                state[DRIVE] -= wraps * course.jumps[0]
            return
        _cross_or_rest(state, place > target, course, pull)
    extremes[0] = extremes[1] = np.nan


@kernel
def advance_period(state, steps, step, course, pull, extremes, record_out):
    """Advance by `steps` steps; fill (place - drive, speed, u'') before each, shape (steps, 3).

    With an empty `record_out` nothing is recorded, and the extremes stay.
    """
    watch = record_out.shape[0] > 0
    for i in range(steps):
        if watch:
            record_out[i, 0] = state[PLACE] - state[DRIVE]
            record_out[i, 1] = state[SPEED]
            record_out[i, 2] = 0.0
            if math.isnan(state[HOLD]):
                record_out[i, 2], _ = acceleration_and_jerk(state, course, pull)
        advance(state, step, course, pull, extremes, watch)

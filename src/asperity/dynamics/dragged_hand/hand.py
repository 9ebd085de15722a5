r"""The hand of Otaduy & Lin (2004, Eq. 7): a mass dragged over a texture by spring and damper.

    m u'' = k (v t - u) + b (v - u') - F_u(u)

`F_u` is the texture force at constant normal force (Eq. 6); positive F_u resists motion along u.

The problem: F_u jumps where the probe's contact jumps from one asperity to the next, u'' jumps with
it, and the largest u'' is often at such a jump. A fixed step across a jump has an error of the
jump's size there.

The idea: between two jumps F_u is smooth, and so is the motion. Each step of the classical
Runge-Kutta method uses only the cubics of the current segment, extended by constants. A step that
leaves the segment is shortened, by the secant method, to the time at which u reaches the jump, and
the next step starts on the other side. The motion may reverse, and a slow hand may come to rest in
the notch between two asperities, where it stays until the drive pulls hard enough to lift it out.

`asperity.dynamics.dragged_hand.periodic_motion` describes how the periodic motion is found.

A motion is *periodic* if (u - v t, u') repeats at equal phase of the drive `v t`, and *subharmonic*
if it repeats only after two to eight periods. Otherwise it is *aperiodic*, and its extremes are
those of the recorded part of the run.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from asperity._core.arrays import Array
from asperity.dynamics.dragged_hand.integrator import DragModel
from asperity.dynamics.dragged_hand.periodic_motion import (
    MAX_SUBHARMONIC,
    PeriodSearch,
    drag_a_length,
    drag_until_repeat,
)
from asperity.errors import AsperityError, require_not_negative, require_positive
from asperity.geometry.offsets.piecewise import PiecewiseCubic

_LEAST_STEPS = 64
_RECORDED_STEPS = 256
"""Smallest number of recorded samples per period: a spectrum needs more than the integration."""
_RECORDED_RATE = 5000.0
"""Smallest rate of a record [Hz]: ten times the highest frequency that people feel."""
_LONG_PERIOD = 3.0
"""Period, in time constants of the hand, from which on plain iteration converges fast enough."""
_STEPS_PER_RADIAN = 8
"""Smallest number of steps per radian of the hand's fastest free motion, at any drive speed."""
_LONGEST_RUN = 25.0
"""Time constants of the hand after which a motion that has not repeated counts as aperiodic."""


class MotionStatus(IntEnum):
    """How a run of the hand ended."""

    PERIODIC = 0
    """(u - v t, u') repeats with the surface."""
    SUBHARMONIC = 1
    """It repeats after several periods of the surface."""
    APERIODIC = 2
    """It does not repeat; its extremes are those of the record."""


@dataclass(frozen=True)
class Hand:
    """Mass, stiffness and damping of the hand that holds the probe.

    The seed paper gives no values; the defaults are the project's.
    """

    mass: float = 0.05
    """[kg], above 0."""
    stiffness: float = 300.0
    """[N/m], above 0."""
    damping: float = 3.0
    """[N s/m], above 0: without damping no motion settles."""

    def __post_init__(self) -> None:
        require_positive("mass", self.mass, "[kg]")
        require_positive("stiffness", self.stiffness, "[N/m]")
        require_positive("damping", self.damping, "[N s/m]")

    @property
    def time_constant(self) -> float:
        """Time in which a free motion of the hand decays by a factor e [s]."""
        half, square = 0.5 * self.damping / self.mass, self.stiffness / self.mass
        inside = half**2 - square
        return (half + math.sqrt(inside)) / square if inside > 0.0 else 1.0 / half

    @property
    def fastest(self) -> float:
        """Rate of the hand's fastest free motion, oscillation or decay [rad/s]."""
        return max(math.sqrt(self.stiffness / self.mass), self.damping / self.mass)


class Motion(NamedTuple):
    """The hand's motion over one repeat, or over the recorded part of a run."""

    status: MotionStatus
    periods: int
    """Periods of the surface in the record."""
    settled_after: float
    """Time from the start of the run to that of the record [s]."""
    step: float
    """Time between samples [s]."""
    place: Array
    """u [m], relative to the start of the record's first period."""
    lag: Array
    """u - v t [m]: how far the hand is ahead of its drive."""
    speed: Array
    """u' [m/s]."""
    acceleration: Array
    """u'' [m/s^2]."""
    largest: float
    """Largest u'' [m/s^2], between samples and on either side of jumps included."""
    smallest: float
    """Smallest u'' [m/s^2], likewise."""
    mismatch: float
    """Mismatch of (u - v t, u') after one repeat, relative to the period and the speed."""

    @property
    def duration(self) -> float:
        """Length of the record [s]."""
        return self.step * self.acceleration.size


def drag(
    force: PiecewiseCubic,
    hand: Hand,
    speed: float,
    *,
    start: float = 0.0,
    refine: float = 1.0,
    settle: float | None = None,
    length: float | None = None,
    extrapolate: bool = True,
) -> Motion:
    """Drag the hand over a texture at constant speed; record its motion once it repeats.

    Parameters
    ----------
    force : PiecewiseCubic
        Texture force F_u [N] along the surface; positive resists.
    hand : Hand
        Mass, spring and damper of Eq. 7.
    speed : float
        Speed of the drive [m/s], above 0.
    start : float
        Position on the surface at which the drive starts [m].
    refine : float
        Factor on the number of steps a period. 1 gives at least one step for each cubic of
        the table, at least 64, and at least eight a radian of the hand's fastest free motion.
    settle, length : float, optional
        Give both to record `length` [m] of drag after `settle` [s], whether or not the motion
        repeats: for long measured surfaces.
    extrapolate : bool
        Whether to look for the periodic motion by extrapolation (see
        `asperity.dynamics.dragged_hand.periodic_motion`). Otherwise the hand, which starts at
        rest on its spring, is dragged until its motion repeats, however long that takes.

    Returns
    -------
    Motion
        Sampled at equal phase; its `status` is APERIODIC if the motion never repeats.

    References
    ----------
    Otaduy & Lin (2004), Eq. 7; the hand after Hasser & Cutkosky (2002).
    """
    require_positive("speed", speed, "[m/s]")
    require_positive("refine", refine)
    if not math.isfinite(start):
        raise AsperityError(f"start must be a finite number [m], got {start!r}")
    if (settle is None) != (length is None):
        raise AsperityError("give both settle and length, or neither")
    if settle is not None and length is not None:
        require_not_negative("settle", settle, "[s]")
        require_positive("length", length, "[m]")
    period = force.period
    swift = _STEPS_PER_RADIAN * hand.fastest * period / speed
    steps = max(math.ceil(refine * max(_LEAST_STEPS, force.edges.size - 1, swift)), 8)
    step = period / speed / steps
    finer = math.ceil(max(_RECORDED_STEPS, period / speed * _RECORDED_RATE) / steps)
    cubics = force[:3]
    model = DragModel(*map(float, (hand.mass, hand.stiffness, hand.damping, speed)))
    status, mismatch = MotionStatus.APERIODIC, math.nan
    if length is None or settle is None:
        most = math.ceil(_LONGEST_RUN * hand.time_constant * speed / period) + 2 * MAX_SUBHARMONIC
        ahead = extrapolate and period / speed < _LONG_PERIOD * hand.time_constant
        search = PeriodSearch(steps=steps, max_periods=most, extrapolate=ahead, samples=finer)
        repeat, run, mismatch, *extremes, record = drag_until_repeat(
            cubics, model, float(start), search
        )
        if repeat:
            status = MotionStatus.PERIODIC if repeat == 1 else MotionStatus.SUBHARMONIC
        before = run * period / speed
    else:
        settled = math.ceil(settle / step)
        before = settled * step
        samples = max(round(length / speed / step * finer), 2)
        *extremes, record = drag_a_length(
            cubics, model, float(start), step, settled, finer, samples
        )
    samples, step = record.shape[0], step / finer
    if not np.all(np.isfinite(extremes)):
        raise AsperityError(
            f"the hand meets too many asperities within one step at {speed:g} m/s; raise refine"
        )
    times = np.arange(samples) * step
    # Remove whole periods, half a step early so that rounding cannot add one.
    phase = math.fmod(start, period) + math.fmod(speed * before + 0.5 * step * speed, period)
    phase -= 0.5 * step * speed
    return Motion(
        status=status,
        periods=max(round(samples * step * speed / period), 1),
        settled_after=before,
        step=step,
        place=record[:, 0] + phase + speed * times,
        lag=record[:, 0],
        speed=record[:, 1],
        acceleration=record[:, 2],
        largest=float(extremes[1]),
        smallest=float(extremes[0]),
        mismatch=mismatch,
    )


def shake(force: Array, tick: float, hand: Hand, speed: float) -> Motion:
    """Drag the hand under a force that is a time series, held constant between ticks.

    Eq. 7 is then linear and is solved exactly at each tick.

    Parameters
    ----------
    force : (n,) array
        F_u [N] at each tick; positive resists.
    tick : float
        Time between ticks [s].
    hand, speed
        As for `drag`.

    Returns
    -------
    Motion
        Status `APERIODIC`; the first five time constants of the hand are left out. u'' is sampled
        just after each tick, where it is largest.
    """
    from scipy import signal  # slow to import, and seldom needed

    require_positive("tick", tick, "[s]")
    require_positive("speed", speed, "[m/s]")
    # Displacement over force of the mass on its spring and damper, for an input held over a tick.
    inertia = np.array([hand.mass, hand.damping, hand.stiffness])
    response = (np.array([-1.0]), inertia)
    numerator, denominator, _ = signal.cont2discrete(response, tick)
    lag = signal.lfilter(numerator.ravel(), denominator, force)
    # Velocity over force: the same, times s.
    numerator, denominator, _ = signal.cont2discrete((np.array([-1.0, 0.0]), inertia), tick)
    excess = signal.lfilter(numerator.ravel(), denominator, force)
    acceleration = -(hand.stiffness * lag + hand.damping * excess + force) / hand.mass
    settled = min(math.ceil(5.0 * hand.time_constant / tick), force.size - 2)
    times = np.arange(force.size - settled) * tick
    acceleration = acceleration[settled:]
    return Motion(
        status=MotionStatus.APERIODIC,
        periods=1,
        settled_after=settled * tick,
        step=tick,
        place=lag[settled:] + speed * times,
        lag=lag[settled:],
        speed=excess[settled:] + speed,
        acceleration=acceleration,
        largest=float(np.max(acceleration)),
        smallest=float(np.min(acceleration)),
        mismatch=math.nan,
    )

"""Drive a method along a path, pressed to the same force as the others, and time every tick.

Methods differ in stiffness: at equal depth, one exerts a small force and another a large one. So
all follow one path, each raised or lowered as a whole until its mean upward force is the same.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity.dynamics.simulated_hand.hand import HandSettings, SimulatedHand
from asperity.errors import AsperityError
from asperity.studies.baselines import Renderer
from asperity.studies.stability.measure import Symptoms, symptoms_of

Array = NDArray[np.float64]
_FEWEST, _PRESSINGS = 64, 15
"""Fewest ticks of a path, and about how many heights are tried to press it."""
PUSH_SAMPLES = 12
"""Poses of a path over which the mean force is taken."""
_FIRST_STEP, _FARTHEST = 2e-5, 8e-3
"""First step and largest value of the searched height [m]."""
_OFF = 3e-3
"""Relative tolerance of the force."""
WARM_UP = slice(0, 16)
"""Poses of the ticks before those that are timed."""


class DrivenRun(NamedTuple):
    """The wrench on a tool along a path, one row a tick."""

    force: Array
    """[N], (n, 3)."""
    torque: Array
    """About the centre of mass [N m], (n, 3)."""
    depth: Array
    """[m], (n,)."""
    contacts: NDArray[np.int64]
    """(n,)."""
    seconds: Array
    """Processor time of each tick [s], (n,)."""


def raise_path(poses: Array, height: float) -> Array:
    """Return poses (n, 7) moved up [m]."""
    out = np.array(poses)
    out[:, 2] += height
    return out


def mean_push(renderer: Renderer, poses: Array) -> float:
    """Return the mean upward force [N] over `PUSH_SAMPLES` poses of a path."""
    renderer.reset()
    samples = poses[np.linspace(0, len(poses) - 1, min(PUSH_SAMPLES, len(poses))).astype(int)]
    return float(np.mean([renderer.wrench(pose).force[2] for pose in samples]))


def refuse_slow(renderer: Renderer, poses: Array, budget: float) -> None:
    """Raise `AsperityError` if pressing and the fewest ticks would take ten budgets [s]."""
    renderer.reset()
    renderer.wrench(poses[0])
    begun = time.thread_time()
    renderer.wrench(poses[len(poses) // 2])
    took = time.thread_time() - begun
    if took * (_PRESSINGS * PUSH_SAMPLES + _FEWEST) > 10.0 * budget:
        raise AsperityError(
            f"a tick takes about {took:.2g} s, too long to press and to follow a path in ten times "
            f"--budget-s {budget:g}"
        )


def find_pressing_height(renderer: Renderer, poses: Array, force: float) -> float:
    """Return how far to raise a path [m] so that its mean upward force is `force` [N].

    Raises
    ------
    AsperityError
        If no height within 8 mm gives that force.
    """

    def over(height: float) -> float:
        return mean_push(renderer, raise_path(poses, height)) - force

    low, off_low = 0.0, over(0.0)
    sign, step = (1.0 if off_low > 0.0 else -1.0), _FIRST_STEP
    high, off_high = low, off_low
    while sign * off_high > 0.0:
        low, off_low = high, off_high
        if abs(high) >= _FARTHEST:
            raise AsperityError(
                f"at no height within {1e3 * _FARTHEST:g} mm of the path is the mean upward force "
                f"{force:.3g} N"
            )
        # The last step is shortened to end at the largest height.
        high = sign * min(abs(low) + step, _FARTHEST)
        off_high = over(high)
        step *= 2.0
        if sign < 0.0 and -force < off_low < off_high < 0.0:
            # Not much deeper than needed: pressed through half its thickness, a tool may be let go.
            step = min(step, 1.5 * off_high * (high - low) / (off_high - off_low))
    # Illinois variant of false position: the force is nearly a power of the depth.
    while abs(high - low) > 1e-8:
        middle = (low * off_high - high * off_low) / (off_high - off_low)
        off = over(middle)
        if abs(off) < _OFF * force:
            return middle
        if sign * off > 0.0:
            low, off_low, off_high = middle, off, 0.5 * off_high
        else:
            high, off_high, off_low = middle, off, 0.5 * off_low
    return high


def follow_path(
    renderer: Renderer,
    poses: Array,
    *,
    budget: float | None = None,
    on_tick: Callable[[], None] = lambda: None,
) -> DrivenRun:
    """Compute and time the wrench at every pose of a path, in order.

    Parameters
    ----------
    renderer : Renderer
    poses : (n, 7) array
    budget : float, optional
        Stop after this processor time [s], but not before 64 ticks; return the ticks so far.
    on_tick : callable
        Called after each tick.
    """
    # Processor time of this thread: on a busy machine a wall clock also times other processes.
    clock = time.thread_time
    renderer.reset()
    for pose in poses[WARM_UP]:
        renderer.wrench(pose)
    renderer.reset()
    rows, seconds = [], []
    begun = clock()
    for i, pose in enumerate(poses):
        start = clock()
        wrench = renderer.wrench(pose)
        seconds.append(clock() - start)
        rows.append(wrench)
        on_tick()
        if budget is not None and i >= _FEWEST - 1 and clock() - begun > budget:
            break
    force, torque, depth, contacts = map(np.array, zip(*rows, strict=True))
    return DrivenRun(force, torque, depth, contacts, np.array(seconds))


def simulate_resting_hand(
    renderer: Renderer, pose: Array, centre: Array, force: float, *, ticks: int = 800
) -> Symptoms:
    """Return the symptoms of instability felt by a simulated hand that presses at one place.

    As in `asperity stability`, they are measured over the last half of 0.8 s at 1 kHz.
    """

    def target(_: float) -> Array:
        return pose

    hand = SimulatedHand(target, HandSettings(press_force=force), dt=1e-3, centre=centre)
    renderer.reset()
    forces, places = np.empty((ticks, 3)), np.empty((ticks, 3))
    for i in range(ticks):
        places[i] = hand.pose[:3]
        wrench: Any = renderer.wrench(np.array(hand.pose))
        forces[i] = wrench.force
        hand.advance(np.concatenate([wrench.force, wrench.torque]))
    half = ticks // 2
    return symptoms_of(forces[half:], places[half:], 1e-3)

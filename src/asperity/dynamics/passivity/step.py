"""One tick of the passivity controller, compiled; see `passivity`."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity._core.kernels import clear, inner_kernel, kernel

# Columns of `Account.numbers`.
PARTS, ENERGY, GAINED, DISSIPATED, INTERVENTIONS = 0, 2, 3, 4, 5
PUT_IN, GOT_OUT, NUMBERS = 6, 8, 10
_SLOWEST, _SLOWEST_TURN = 1e-6, 1e-5
"""Motion below this is none: [m/s], [rad/s]."""
_FASTEST = 1e6
"""Nor is this any."""


class Terms(NamedTuple):
    """Parameters of `PassivityController`."""

    most: float
    most_turning: float
    damping: float
    mass: float
    moment: float
    reserve: float


class Account(NamedTuple):
    """What is known from tick to tick."""

    numbers: NDArray[np.float64]
    held: NDArray[np.float64]
    """The wrench that was held over the last tick, (6,)."""
    added: NDArray[np.float64]
    """What of it was the controller's, (6,)."""
    last: NDArray[np.float64]
    """Twist before the last, (6,)."""
    ahead: NDArray[np.float64]
    """The twist that is reckoned with, (6,)."""


@kernel
def passive_step(wrench, twist, passed, dt, active, terms, account, out):
    """Keep the account, and fill `out` (6,) with the wrench to hold."""
    numbers, held = account.numbers, account.held
    total = 0.0
    for i in range(6):
        out[i] = wrench[i]
        total += abs(wrench[i]) + abs(twist[i])
    if not total < _FASTEST:
        # No numbers, or none of this world: they must not spoil the account for ever.
        clear(account.added)
        clear(held)
        return
    for half in range(2):
        work = -_dot(held, twist, 3 * half) * passed
        numbers[PARTS + half] += work
        numbers[(PUT_IN if work > 0.0 else GOT_OUT) + half] += abs(work)
    for i in range(6):
        numbers[DISSIPATED] -= account.added[i] * twist[i] * passed
    numbers[PARTS] += terms.damping * _dot(twist, twist, 0) * passed
    energy = numbers[ENERGY] = numbers[PARTS] + numbers[PARTS + 1]
    numbers[GAINED] = max(numbers[GAINED], -energy)
    if active:
        _damp(twist, dt, terms, account, out)
    for i in range(6):
        account.last[i] = twist[i]
        account.added[i] = out[i] - wrench[i]
        held[i] = out[i]


@inner_kernel
def _damp(twist, dt, terms, account, out):
    """Take from the wrench what the account does not cover, and let it pay a debt."""
    numbers, ahead = account.numbers, account.ahead
    energy = numbers[ENERGY]
    power, square = _ahead(twist, account.last, out, dt / terms.mass, 0, _SLOWEST, ahead)
    spin, turning = _ahead(twist, account.last, out, dt / terms.moment, 3, _SLOWEST_TURN, ahead)
    pushing = max(power, 0.0) + max(spin, 0.0)
    excess = power + spin - max(energy - terms.reserve, 0.0) / dt
    share = min(excess / pushing, 1.0) if pushing > 0.0 and excess > 0.0 else 0.0
    paid = terms.most * _moving(twist, 0, _SLOWEST)
    paid_turning = terms.most_turning * _moving(twist, 3, _SLOWEST_TURN)
    pace = 0.0
    if energy < 0.0 and paid + paid_turning > 0.0:
        pace = min(-energy / (dt * (paid + paid_turning)), 1.0)
    if share == 0.0 and pace == 0.0:
        return
    numbers[INTERVENTIONS] += 1.0
    alpha = share * max(power, 0.0) / square
    beta = share * max(spin, 0.0) / turning
    for i in range(3):
        out[i] -= alpha * ahead[i]
        out[3 + i] -= beta * ahead[3 + i]
        if paid > 0.0:
            out[i] -= pace * terms.most * twist[i]
        if paid_turning > 0.0:
            out[3 + i] -= pace * terms.most_turning * twist[3 + i]


@inner_kernel
def _ahead(twist, last, wrench, softness, first, slowest, ahead):
    """Fill how half a handle may move over the next tick: the way that costs most.

    As it did; as it did and faster by as much as it has become faster; or as the wrench pushes
    the least that can hold it. Returns power, and square of that velocity: 0 and 1 if it is none.
    """
    as_before, faster = _dot(wrench, twist, first), 2.0 * _dot(wrench, twist, first)
    faster -= _dot(wrench, last, first)
    pushed = as_before + softness * _dot(wrench, wrench, first)
    for i in range(first, first + 3):
        ahead[i] = twist[i]
        if faster > as_before and faster >= pushed:
            ahead[i] = 2.0 * twist[i] - last[i]
        elif pushed > as_before:
            ahead[i] = twist[i] + softness * wrench[i]
    square = _moving(ahead, first, slowest)
    if square == 0.0:
        return 0.0, 1.0
    return _dot(wrench, ahead, first), square


@inner_kernel
def _moving(twist, first, slowest):
    """Return the square of a velocity, 0 if it is none."""
    square = _dot(twist, twist, first)
    return square if slowest * slowest < square < _FASTEST * _FASTEST else 0.0


@inner_kernel
def _dot(a, b, first):
    return a[first] * b[first] + a[first + 1] * b[first + 1] + a[first + 2] * b[first + 2]

"""One tick of the passivity controller, compiled; see `passivity.controller`."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from asperity._core.arrays import Array
from asperity._core.kernels import clear, inner_kernel, kernel

ACCOUNT = np.dtype(
    [
        ("work", "f8", (2,)),  # net work of the hand by translations and by rotations [J]
        ("granted", "f8"),  # energy that was there without work of the hand [J]
        ("energy", "f8"),  # E, the sum of `work` and `granted` [J]
        ("deficit", "f8"),  # largest -E so far, 0 if the port has been passive [J]
        ("dissipated", "f8"),  # energy that the corrections took from the hand's motion [J]
        ("interventions", "i8"),  # ticks in which the wrench was corrected
        ("absorbed", "f8", (2,)),  # work of ticks in which the hand did work, as `work` [J]
        ("returned", "f8", (2,)),  # work of ticks in which the hand received work, as `work` [J]
        ("held", "f8", (6,)),  # wrench held over the last tick [N, N m]
        ("added", "f8", (6,)),  # the controller's part of it [N, N m]
        ("last_twist", "f8", (6,)),  # velocity over the tick before the last [m/s, rad/s]
        ("predicted", "f8", (6,)),  # velocity assumed for the coming tick [m/s, rad/s]
        ("stored", "f8"),  # potential of the contacts at the last tick [J]; NaN: not known
        ("owed", "f8"),  # the part of it that the port may give back [J]
        ("unsent", "f8", (6,)),  # the part of the last wrench that limits removed [N, N m]
        ("last_way", "f8", (6,)),  # displacement over the tick before the last [m, rad]
    ],
    align=True,
)
"""The state of a passivity controller, an array of shape (1,)."""
_REST, _ANGULAR_REST = 1e-6, 1e-5
"""Speeds below these count as rest: [m/s], [rad/s]."""
_IMPLAUSIBLE = 1e6
"""Sum of magnitudes, or speed, at and above which an input is rejected."""


class PortMotion(NamedTuple):
    """What has happened since the last call."""

    twist: Array
    """Mean velocity (6,) [m/s, rad/s]."""
    passed: float
    """Time [s]."""
    stored: float
    """Potential of the contacts now [J]; NaN: not known."""


class Terms(NamedTuple):
    """Parameters of `PassivityController`."""

    max_damping: float
    """[N s/m]"""
    max_rotational_damping: float
    """[N m s/rad]"""
    damping: float
    """[N s/m]"""
    mass: float
    """[kg]"""
    moment: float
    """[kg m^2]"""
    reserve: float
    """[J]"""


@kernel
def passive_step(wrench, motion, dt, is_active, terms, state, wrench_out):
    """Update the energy account and fill the wrench (6,) to hold over the coming tick.

    Parameters
    ----------
    wrench : (6,) array
        Wrench wanted on the hand [N, N m].
    motion : PortMotion
    dt : float
        Length of the coming tick [s].
    is_active : bool
        Whether to correct the wrench.
    terms : Terms
    state : (1,) array of ACCOUNT
    wrench_out : (6,) array
    """
    account = state[0]
    twist, passed = motion.twist, motion.passed
    total = 0.0
    for i in range(6):
        wrench_out[i] = wrench[i]
        total += abs(wrench[i]) + abs(twist[i])
    if not total < _IMPLAUSIBLE:
        # NaN or implausible: the tick is ignored, as it would corrupt the account permanently.
        clear(account.added)
        clear(account.held)
        return
    for half in range(2):
        work = -_dot(account.held, twist, 3 * half) * passed
        account.work[half] += work
        if work > 0.0:
            account.absorbed[half] += abs(work)
        else:
            account.returned[half] += abs(work)
    for i in range(6):
        account.dissipated -= account.added[i] * twist[i] * passed
    account.work[0] += terms.damping * _dot(twist, twist, 0) * passed
    account.energy = account.granted + account.work[0] + account.work[1]
    account.deficit = max(account.deficit, -account.energy)
    _follow_potential(motion, account)
    if is_active:
        _correct(twist, dt, terms, account, wrench_out)
    for i in range(6):
        account.last_twist[i] = twist[i]
        account.added[i] = wrench_out[i] - wrench[i]
        account.held[i] = wrench_out[i]


@inner_kernel
def _follow_potential(motion, account):
    """Update `owed` by the change of the potential, without the part that limits removed.

    The work of that part is integrated by the trapezoidal rule, half a tick late.
    """
    change = 0.0
    if abs(motion.stored) < _IMPLAUSIBLE and abs(account.stored) < _IMPLAUSIBLE:
        change = motion.stored - account.stored
    for i in range(6):
        displacement = motion.twist[i] * motion.passed
        change += 0.5 * account.unsent[i] * (displacement + account.last_way[i])
        account.last_way[i] = displacement
        account.unsent[i] = 0.0
    account.stored = motion.stored
    # Comparisons with NaN are false: without a potential nothing is owed.
    owed = account.owed + change
    account.owed = min(max(owed, 0.0), motion.stored) if motion.stored > 0.0 else 0.0


@inner_kernel
def _correct(twist, dt, terms, account, wrench_out):
    """Damp the wrench so that the energy stays above zero and follows the potential."""
    predicted = account.predicted
    last, energy = account.last_twist, account.energy
    power, square = _predict(twist, last, wrench_out, dt / terms.mass, 0, _REST, predicted)
    angular_power, angular_square = _predict(
        twist, last, wrench_out, dt / terms.moment, 3, _ANGULAR_REST, predicted
    )
    output = max(power, 0.0) + max(angular_power, 0.0)
    excess = power + angular_power - max(energy - terms.reserve, 0.0) / dt
    debt = account.owed - energy
    share = min(excess / output, 1.0) if output > 0.0 and excess > 0.0 else 0.0
    if share > 0.0:
        alpha = share * max(power, 0.0) / square
        beta = share * max(angular_power, 0.0) / angular_square
        for i in range(3):
            wrench_out[i] -= alpha * predicted[i]
            wrench_out[3 + i] -= beta * predicted[3 + i]
    pays = debt > 0.0 and _pay_back(debt, twist, dt, terms, wrench_out)
    if share > 0.0 or pays:
        account.interventions += 1


@inner_kernel
def _pay_back(debt, twist, dt, terms, wrench_out):
    """Pay back a debt [J] by bounded damping; return False if the hand is at rest."""
    paid = terms.max_damping * _square_speed(twist, 0, _REST)
    angular_paid = terms.max_rotational_damping * _square_speed(twist, 3, _ANGULAR_REST)
    if paid + angular_paid == 0.0:
        return False
    pace = min(debt / (dt * (paid + angular_paid)), 1.0)
    for i in range(3):
        if paid > 0.0:
            wrench_out[i] -= pace * terms.max_damping * twist[i]
        if angular_paid > 0.0:
            wrench_out[3 + i] -= pace * terms.max_rotational_damping * twist[3 + i]
    return True


@inner_kernel
def _predict(twist, last, wrench, compliance, first, rest, predicted):
    """Fill three components, from `first` on, of the velocity assumed for the coming tick.

    Of three candidates, the one for which the wrench does most work: the last velocity; the last
    velocity plus its last change; the last velocity plus what the wrench adds to it, by
    `compliance` [s/kg, s/(kg m^2)]. Return the power and the squared velocity, (0, 1) at rest.
    """
    unchanged = _dot(wrench, twist, first)
    continued = 2.0 * _dot(wrench, twist, first)
    continued -= _dot(wrench, last, first)
    pushed = unchanged + compliance * _dot(wrench, wrench, first)
    for i in range(first, first + 3):
        predicted[i] = twist[i]
        if continued > unchanged and continued >= pushed:
            predicted[i] = 2.0 * twist[i] - last[i]
        elif pushed > unchanged:
            predicted[i] = twist[i] + compliance * wrench[i]
    square = _square_speed(predicted, first, rest)
    if square == 0.0:
        return 0.0, 1.0
    return _dot(wrench, predicted, first), square


@inner_kernel
def _square_speed(twist, first, rest):
    """Return the square of three components, 0 if they count as rest or are implausible."""
    square = _dot(twist, twist, first)
    return square if rest * rest < square < _IMPLAUSIBLE * _IMPLAUSIBLE else 0.0


@inner_kernel
def _dot(a, b, first):
    return a[first] * b[first] + a[first + 1] * b[first + 1] + a[first + 2] * b[first + 2]

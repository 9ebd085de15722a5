r"""Passivity at the hand's port: an account of energy, and a controller that keeps it in credit.

The problem: a spring that is sampled and held gives back more than it got. What is held over a
tick pushes with the force of its beginning, and on the way out of a wall that is too much.

*Observer.* The wrench w of a tick is held until the next one, and the handle moves by d meanwhile:
the hand has put in `-w . d`. Summed from the beginning this is

    E = sum -w_(n-1) . v_n dt,    v_n the mean velocity of the tick that has just passed,

exact for a device that holds what it is told. Passive means E >= 0 at all times: no more comes
out than went in. The parts of translations and of rotations are counted too, but only their sum
has to stay in credit: a tool that is pressed by moving it and gives way by turning hands energy
from one to the other, and a limit on each would fight that all the time.

*Controller* (Hannaford & Ryu, *Time-domain passivity control of haptic interfaces*, 2002): dampers
`-alpha v`, one for translations and one for rotations, that vary with time are added to the wrench.
Here they look one tick ahead, at `E - w . v dt`, v the fastest that the handle may well move by
then: were that to be below zero, alpha is made just large enough for it to be zero. This takes off
the wrench, along v, what would push the hand with energy that is not there, and no more, so that
it never adds to the wrench. If the account is in
debt all the same, since the hand did not move as the last tick had told, damping pays it back, at
most `max_damping`.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from asperity.errors import require_between, require_not_negative, require_positive

_SLOWEST = (1e-6, 1e-5)
"""Motion below this is none: [m/s], [rad/s]."""
RESERVE = 5e-6
"""A hundredth of what a wall of 400 N/m stores under 0.6 N [J]; asperity's."""
_PORTS = (slice(0, 3), slice(3, 6))
"""Translations and rotations."""


class PassivityController:
    """Observer and controller for one hand.

    Parameters
    ----------
    dt : float
        Tick [s], 1e-5 to 0.1.
    max_damping, max_rotational_damping : float
        Most that pays back a debt [N s/m], [N m s/rad]; asperity's. Times the tick it should be
        well below the mass, and the moment of inertia, of what the hand holds.
    damping : float
        The device's own, physical damping [N s/m]: what it takes from the hand counts as put in,
        and the account is that of device and scene together, the one of Colgate's bound.
    mass, moment : float
        The least that holds the wrench: of the device's end effector and the hand [kg], [kg m^2].
    reserve : float
        Credit that is kept back [J]: the hand does not move quite as the last tick tells.
    active : bool
        Whether to correct; otherwise only the account is kept.

    Examples
    --------
    >>> controller = PassivityController(1e-3)
    >>> device.write(controller.correct(wrench, twist))
    """

    def __init__(
        self,
        dt: float = 1e-3,
        *,
        max_damping: float = 10.0,
        max_rotational_damping: float = 0.02,
        damping: float = 0.0,
        mass: float = 0.05,
        moment: float = 1e-4,
        reserve: float = RESERVE,
        active: bool = True,
    ) -> None:
        self.dt = require_between("dt", dt, 1e-5, 0.1, "s")
        self.active = active
        self._damping = require_not_negative("damping", damping, "[N s/m]")
        self._reserve = require_not_negative("reserve", reserve, "[J]")
        self._most = (
            require_not_negative("max_damping", max_damping, "[N s/m]"),
            require_not_negative("max_rotational_damping", max_rotational_damping, "[N m s/rad]"),
        )
        self._inertia = (
            require_positive("mass", mass, "[kg]"),
            require_positive("moment", moment, "[kg m^2]"),
        )
        self._held, self._added, self._out = np.zeros(6), np.zeros(6), np.zeros(6)
        self._last, self._next = np.zeros(6), np.zeros(6)
        self.parts = np.zeros(2)
        """What the hand has put in by translations and by rotations [J]."""
        self.reset()

    def reset(self, stored: float = 0.0) -> None:
        """Begin a new account, with the energy [J] that the scene holds already."""
        for values in (self.parts, self._held, self._added, self._last):
            values[:] = 0.0
        self.parts[0] = stored
        self.energy = stored
        """E: what the hand has put in and not got back [J]."""
        self.gained = 0.0
        """The most that the hand had got out beyond what it had put in [J]; 0 is passive."""
        self.interventions = 0
        """Ticks in which the wrench was changed."""
        self.dissipated = 0.0
        """What the changes took out of the hand's motion [J]."""

    def correct(
        self, wrench: NDArray[np.float64], twist: NDArray[np.float64], dt: float | None = None
    ) -> NDArray[np.float64]:
        """Account for the tick that has passed; return the wrench to hold over the next.

        Parameters
        ----------
        wrench : (6,) array
            What the hand is to feel: force [N], torque about a point [N m].
        twist : (6,) array
            Mean velocity of the handle since the last call, at that point: way over time [m/s],
            turn over time [rad/s]. See `HeldTool.port_twist`.
        dt : float, optional
            Time since the last call [s], where it was not a tick.

        Returns
        -------
        (6,) array
            The same array every time.
        """
        passed = self.dt if dt is None else dt
        for port, here in enumerate(_PORTS):
            self.parts[port] -= float(self._held[here] @ twist[here]) * passed
        self.parts[0] += self._damping * float(twist[:3] @ twist[:3]) * passed
        self.energy = float(self.parts[0] + self.parts[1])
        self.gained = max(self.gained, -self.energy)
        self.dissipated -= float(self._added @ twist) * passed
        self._out[:] = wrench
        if self.active:
            self._damp(twist)
        self._last[:] = twist
        self._added[:] = self._out - wrench
        self._held[:] = self._out
        return self._out

    def _damp(self, twist: NDArray[np.float64]) -> None:
        """Take from the wrench what the account does not cover, and let it pay a debt."""
        powers, squares, moving = [0.0, 0.0], [1.0, 1.0], [0.0, 0.0]
        for port, here in enumerate(_PORTS):
            ahead, v = self._ahead(port, twist), twist[here]
            square, slow = float(ahead @ ahead), _SLOWEST[port] ** 2
            if square > slow and math.isfinite(square):
                squares[port], powers[port] = square, float(self._out[here] @ ahead)
            if slow < float(v @ v) < math.inf:
                moving[port] = self._most[port] * float(v @ v)
        pushing = max(powers[0], 0.0) + max(powers[1], 0.0)
        excess = sum(powers) - max(self.energy - self._reserve, 0.0) / self.dt
        share = min(excess / pushing, 1.0) if pushing > 0.0 and excess > 0.0 else 0.0
        paying, pace = sum(moving), 0.0
        if self.energy < 0.0 and paying > 0.0:
            pace = min(-self.energy / (self.dt * paying), 1.0)
        if share == 0.0 and pace == 0.0:
            return
        self.interventions += 1
        for port, here in enumerate(_PORTS):
            alpha = share * max(powers[port], 0.0) / squares[port]
            self._out[here] -= alpha * self._next[here]
            if moving[port] > 0.0:
                self._out[here] -= pace * self._most[port] * twist[here]

    def _ahead(self, port: int, twist: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return how the handle may move over the next tick: the way that costs most.

        As it did; as it did and faster by as much as it has become faster; or as the wrench
        pushes the least that can hold it.
        """
        here = _PORTS[port]
        v, wrench = twist[here], self._out[here]
        best, most = v, float(wrench @ v)
        for other in (2.0 * v - self._last[here], v + wrench * (self.dt / self._inertia[port])):
            power = float(wrench @ other)
            if power > most:
                best, most = other, power
        self._next[here] = best
        return self._next[here]

    def sent(self, wrench: NDArray[np.float64]) -> None:
        """Tell what was really written (6,), if limits have changed what `correct` returned."""
        self._added += wrench - self._held
        self._held[:] = wrench

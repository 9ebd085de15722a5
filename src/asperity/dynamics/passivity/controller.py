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

from typing import Any

import numpy as np
from numpy.typing import NDArray

from asperity._core.kernels import Repeated
from asperity.dynamics.passivity.step import (
    DISSIPATED,
    ENERGY,
    GAINED,
    GOT_OUT,
    INTERVENTIONS,
    NUMBERS,
    PARTS,
    PUT_IN,
    Account,
    Terms,
    passive_step,
)
from asperity.errors import require_between, require_not_negative, require_positive

MOST_DAMPING = 10.0
"""Most that pays back a debt, unless the device's own limit is lower [N s/m]; asperity's."""
RESERVE = 5e-6
"""A hundredth of what a wall of 400 N/m stores under 0.6 N [J]; asperity's."""


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
        max_damping: float = MOST_DAMPING,
        max_rotational_damping: float = 0.02,
        damping: float = 0.0,
        mass: float = 0.05,
        moment: float = 1e-4,
        reserve: float = RESERVE,
        active: bool = True,
    ) -> None:
        self.dt = require_between("dt", dt, 1e-5, 0.1, "s")
        self.active = active
        self._terms = Terms(
            most=require_not_negative("max_damping", max_damping, "[N s/m]"),
            most_turning=require_not_negative(
                "max_rotational_damping", max_rotational_damping, "[N m s/rad]"
            ),
            damping=require_not_negative("damping", damping, "[N s/m]"),
            mass=require_positive("mass", mass, "[kg]"),
            moment=require_positive("moment", moment, "[kg m^2]"),
            reserve=require_not_negative("reserve", reserve, "[J]"),
        )
        six = [np.zeros(6) for _ in range(4)]
        self._account = Account(np.zeros(NUMBERS), *six)
        self._out = np.zeros(6)
        # Of its own, whatever the caller's are like: the kernel is told its types only once.
        self._wrench, self._twist = np.zeros(6), np.zeros(6)
        self._step = Repeated(passive_step)
        self.correct(self._out.copy(), np.zeros(6))  # machine code is made before any hurry
        self.reset()

    def reset(self, stored: float = 0.0) -> None:
        """Begin a new account, with the energy [J] that the scene holds already."""
        for values in self._account:
            values[:] = 0.0
        self._account.numbers[PARTS] = self._account.numbers[ENERGY] = stored

    @property
    def energy(self) -> float:
        """E: what the hand has put in and not got back [J]."""
        return float(self._account.numbers[ENERGY])

    @property
    def parts(self) -> NDArray[np.float64]:
        """What the hand has put in by translations and by rotations [J], (2,)."""
        return self._account.numbers[PARTS : PARTS + 2]

    @property
    def put_in(self) -> NDArray[np.float64]:
        """What the wrench took from the hand in ticks that took, as `parts` [J], (2,)."""
        return self._account.numbers[PUT_IN : PUT_IN + 2]

    @property
    def got_out(self) -> NDArray[np.float64]:
        """What the wrench gave the hand in ticks that gave, as `parts` [J], (2,)."""
        return self._account.numbers[GOT_OUT : GOT_OUT + 2]

    def told(self) -> dict[str, Any]:
        """Return the account for `summary.json`; of two values the first is translations."""
        return {
            "active": self.active,
            "energy_j": self.energy,
            "put_in_j": self.put_in.tolist(),
            "got_out_j": self.got_out.tolist(),
            "gained_j": self.gained,
            "interventions": self.interventions,
            "dissipated_j": self.dissipated,
        }

    @property
    def gained(self) -> float:
        """The most that the hand had got out beyond what it had put in [J]; 0 is passive."""
        return float(self._account.numbers[GAINED])

    @property
    def interventions(self) -> int:
        """Ticks in which the wrench was changed."""
        return int(self._account.numbers[INTERVENTIONS])

    @property
    def dissipated(self) -> float:
        """What the changes took out of the hand's motion [J]."""
        return float(self._account.numbers[DISSIPATED])

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
            turn over time [rad/s]. See `CoupledTool.port_twist`.
        dt : float, optional
            Time since the last call [s], where it was not a tick.

        Returns
        -------
        (6,) array
            The same array every time.
        """
        self._wrench[:], self._twist[:] = wrench, twist
        self._step(
            self._wrench, self._twist, float(self.dt if dt is None else dt), float(self.dt),
            self.active, self._terms, self._account, self._out,
        )  # fmt: skip
        return self._out

    def sent(self, wrench: NDArray[np.float64]) -> None:
        """Tell what was really written (6,), if limits have changed what `correct` returned."""
        held, added = self._account.held, self._account.added
        added += wrench - held
        held[:] = wrench

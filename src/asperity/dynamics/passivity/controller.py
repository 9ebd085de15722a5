r"""Passivity at the hand's port: an energy observer and a controller that keeps it passive.

The problem: a sampled spring generates energy. Its force is held over a tick, and on the way out of
a wall the force of the tick's beginning is larger than the spring's.

*Observer.* The wrench w of a tick is held until the next one while the handle moves by d, so the
hand does the work `-w . d`. Summed from the beginning,

    E = sum -w_(n-1) . v_n dt,    v_n the mean velocity over the tick that has just passed,

which is exact for a device that holds the wrench it was sent. The port is passive if E >= 0 at all
times. The work of translations and of rotations is recorded separately, but only the sum is kept
from becoming negative: a tool that is pressed by translation and gives way by rotation transfers
energy between the two, and separate limits would oppose it continuously.

*Controller* (Hannaford & Ryu, *Time-domain passivity control of haptic interfaces*, 2002): two
variable dampers `-alpha v`, one for translation and one for rotation, are added to the wrench. This
implementation looks one tick ahead, at `E - w . v dt`, with v the largest velocity to be expected
by then; if that is negative, alpha is the smallest value that makes it zero. So only the component
of the wrench along v is reduced, by the energy that is lacking, and nothing is ever added to the
wrench.

*Reference.* E >= 0 alone is not enough. A contact that is pressed stores the energy U, and sampling
uses up what the hand has paid for it, little by little. Once E is zero, motion out of the contact
is opposed and motion into it is not, so a tool that slides over texture sinks in. So E follows the
reference U (Ryu, Preusche, Hannaford & Hirzinger, *Time domain passivity control with reference
energy following*, 2005): whatever E is short of U is paid back by damping of at most `max_damping`,
in the next tick, while it is small. Of U only the rendered part counts: forces above a limit of the
device, and torques that it cannot show, have not been paid for either.
"""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np

from asperity._core.arrays import Array
from asperity._core.kernels import Repeated
from asperity.dynamics.passivity.step import ACCOUNT, PortMotion, Terms, passive_step
from asperity.errors import require_between, require_not_negative, require_positive

MOST_DAMPING = 10.0
"""Largest damping that pays back a debt, if the device allows it [N s/m]; a project default."""
RESERVE = 5e-6
"""A hundredth of the energy in a wall of 400 N/m under 0.6 N [J]; a project default."""
FORGIVING = 0.1
"""Time constant with which the cost of late ticks is forgiven to a coupling [s]; a project default.

With 0.05 to 0.5 s a probe on raised dots recovers, with none it does not.
"""


class PassivityController:
    """Passivity observer and controller for one hand.

    Parameters
    ----------
    dt : float
        Tick [s], 1e-5 to 0.1.
    max_damping, max_rotational_damping : float
        Largest damping that pays back a debt [N s/m], [N m s/rad]; project defaults. The damping
        times the tick should be well below the mass, or the moment of inertia, of what the hand
        holds.
    damping : float
        Physical damping of the device [N s/m]. The energy it takes from the hand counts as put in:
        the account is that of device and scene together, as in Colgate's bound.
    mass, moment : float
        Smallest mass and moment of inertia that the wrench can act on: those of the device's end
        effector and the hand [kg], [kg m^2].
    reserve : float
        Energy kept back because the hand's motion is predicted with an error [J].
    active : bool
        Whether to correct the wrench; otherwise the energy is only observed.

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
            max_damping=require_not_negative("max_damping", max_damping, "[N s/m]"),
            max_rotational_damping=require_not_negative(
                "max_rotational_damping", max_rotational_damping, "[N m s/rad]"
            ),
            damping=require_not_negative("damping", damping, "[N s/m]"),
            mass=require_positive("mass", mass, "[kg]"),
            moment=require_positive("moment", moment, "[kg m^2]"),
            reserve=require_not_negative("reserve", reserve, "[J]"),
        )
        self._state = np.zeros(1, ACCOUNT)
        self._account = self._state[0]
        self._out = np.zeros(6)
        # Arguments are copied into these arrays: `Repeated` determines types at its first call.
        self._wrench, self._twist = np.zeros(6), np.zeros(6)
        self._step = Repeated(passive_step)
        self.correct(self._out.copy(), np.zeros(6))  # compile now, not in the loop
        self.reset()

    def reset(self, stored: float = 0.0) -> None:
        """Start a new account with the energy [J] that is already stored in the scene."""
        self._state[:] = np.zeros(1, ACCOUNT)
        for name in ("granted", "energy", "owed"):
            self._account[name] = stored
        self._account["stored"] = np.nan

    @property
    def energy(self) -> float:
        """E: energy granted or put in by the hand, minus the energy it has received [J]."""
        return float(self._account["energy"])

    @property
    def parts(self) -> Array:
        """Net work of the hand by translations and by rotations [J], (2,)."""
        return np.asarray(self._account["work"])

    @property
    def put_in(self) -> Array:
        """Work of the ticks in which the hand did work, as `parts` [J], (2,)."""
        return np.asarray(self._account["absorbed"])

    @property
    def got_out(self) -> Array:
        """Work of the ticks in which the hand received work, as `parts` [J], (2,)."""
        return np.asarray(self._account["returned"])

    def summary(self) -> dict[str, Any]:
        """Return the account for `summary.json`; of two values the first is of translations."""
        return {
            "active": self.active,
            "energy_j": self.energy,
            "put_in_j": self.put_in.tolist(),
            "got_out_j": self.got_out.tolist(),
            "granted_j": float(self._account["granted"]),
            "gained_j": self.gained,
            "interventions": self.interventions,
            "dissipated_j": self.dissipated,
        }

    def told(self) -> dict[str, Any]:
        """Return `summary()`; deprecated."""
        warnings.warn(
            "PassivityController.told is deprecated: use summary", DeprecationWarning, stacklevel=2
        )
        return self.summary()

    @property
    def gained(self) -> float:
        """Largest energy that the hand had received beyond what it had put in [J]; 0: passive."""
        return float(self._account["deficit"])

    @property
    def interventions(self) -> int:
        """Number of ticks in which the wrench was corrected."""
        return int(self._account["interventions"])

    @property
    def dissipated(self) -> float:
        """Energy that the corrections took out of the hand's motion [J]."""
        return float(self._account["dissipated"])

    def correct(
        self,
        wrench: Array,
        twist: Array,
        dt: float | None = None,
        *,
        stored: float = float("nan"),
    ) -> Array:
        """Account for the tick that has passed; return the wrench to hold over the next one.

        Parameters
        ----------
        wrench : (6,) array
            Wrench wanted on the hand: force [N], torque about a reference point [N m].
        twist : (6,) array
            Mean velocity of the handle since the last call, at that point [m/s], and mean angular
            velocity [rad/s]. See `CoupledTool.port_twist`.
        dt : float, optional
            Time since the last call [s]; by default one tick.
        stored : float, optional
            Potential energy of the contacts whose negative gradient `wrench` is [J], without
            friction and damping; by default there is none, and E is only kept from becoming
            negative.

        Returns
        -------
        (6,) array
            The same array at every call.
        """
        self._wrench[:], self._twist[:] = wrench, twist
        motion = PortMotion(self._twist, float(self.dt if dt is None else dt), float(stored))
        self._step(
            self._wrench, motion, float(self.dt), self.active, self._terms, self._state, self._out
        )
        return self._out

    def grant(self, stored: float) -> None:
        """Count the potential [J] of contacts as put in, where their wrench has been faded in.

        Whoever presses on a contact while its wrench rises from zero does no work for what is
        stored in it. Without this, the account would never cover it. NaN: there is no potential.
        """
        account = self._account
        self._credit(stored - self.energy)
        if stored >= 0.0:
            account["owed"] = account["stored"] = stored
        account["unsent"][:] = 0.0

    def forgive(self, held: float, seconds: float) -> None:
        """Grant part of what E is short of the energy [J] that a passive coupling holds.

        A loop that is late sends a wrench too long, and the hand gets energy that it has not put
        in. While that is lacking, the wrench is taken away, so the hand stretches the coupling
        without doing work for it, and the account stays empty however even the loop has become.
        So what is lacking is forgiven with the time constant `FORGIVING`.
        """
        self._credit((held - self.energy) * min(seconds / FORGIVING, 1.0))

    def _credit(self, lacking: float) -> None:
        """Grant an energy [J] if it is above 0."""
        if lacking > 0.0:
            self._account["granted"] += lacking
            self._account["energy"] += lacking

    def sent(self, wrench: Array) -> None:
        """Report the wrench (6,) that was written, where limits changed what `correct` returned."""
        held, added = self._account["held"], self._account["added"]
        added += wrench - held
        self._account["unsent"][:] = held - wrench
        held[:] = wrench

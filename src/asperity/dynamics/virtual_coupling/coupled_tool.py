r"""The held tool: a body that hangs on the handle by a virtual coupling and meets the scene.

    handle's pose and velocity --> coupling --> tool's motion --> contact where the tool is
                                      \--> wrench that the hand feels

One tick takes the contact of the last one, to first order, moves the tool, and says what the hand
feels; then the contact is looked at where the tool has got to. So a hand is answered before the
contact is searched, and if the search is late, the old contact still tells how the wrench goes on.

A handle that leaps, farther from the tool than `REACH`, takes it along, and the hand feels nothing
of the leap.

In the `direct` mode tool and handle are one: the contact is looked at first, at the handle's pose,
and the hand feels it as it is.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from asperity._core.kernels import Repeated
from asperity.dynamics.linear_contact import LinearContact
from asperity.dynamics.virtual_coupling.backward_euler import implicit_step
from asperity.dynamics.virtual_coupling.loads import extrapolated, fill_port_twist, room
from asperity.dynamics.virtual_coupling.semi_implicit import semi_implicit_step
from asperity.dynamics.virtual_coupling.settings import (
    CouplingSettings,
    DeviceLimits,
    Gains,
    gains_for,
    require_stable,
)
from asperity.dynamics.virtual_coupling.static import static_step
from asperity.errors import require_between
from asperity.geometry.rigid_body import RigidBody, centre_of_mass, cross

_STEPS = {"implicit": implicit_step, "semi-implicit": semi_implicit_step, "static": static_step}
REACH = 0.1
"""A handle farther from its tool than this [m] takes it along at once; asperity's."""


class CoupledTool:
    """A tool on its coupling.

    Parameters
    ----------
    body : RigidBody
        What it weighs; see `settings.coupled_body`.
    settings : CouplingSettings
    dt : float
        Tick [s], 1e-5 to 0.1.
    limits : Limits, optional
        Of the device that renders the coupling: its stiffness and damping cap the gains.

    Examples
    --------
    >>> tool.reset(handle_pose)
    >>> contact = stage.evaluate(tool.pose)
    >>> wrench = tool.advance(handle_pose, handle_twist, contact)  # what the hand feels
    """

    def __init__(
        self,
        body: RigidBody,
        settings: CouplingSettings,
        *,
        dt: float = 1e-3,
        limits: DeviceLimits | None = None,
    ) -> None:
        self.body = body
        self.settings = settings
        self.dt = require_between("dt", dt, 1e-5, 0.1, "s")
        self.gains: Gains = gains_for(body, settings, limits=limits)
        if settings.mode == "semi-implicit":
            require_stable(body, self.gains, self.dt)
        self.is_direct = settings.mode == "direct"
        """Whether tool and handle are one; then look at the contact before `advance`."""
        self.resets = 0
        """How often the tool was put on the handle: it had leapt away, or was not finite."""
        step = _STEPS.get(settings.mode)
        self._step = None if step is None else Repeated(step)
        self._extrapolated = Repeated(extrapolated)
        self._fill_port_twist = Repeated(fill_port_twist)
        # Of its own, whatever the caller's are like: kernels are told their types only once.
        self._handle, self._handle_before, self._drive = np.zeros(7), np.zeros(7), np.zeros(6)
        self._contact = LinearContact(np.zeros(7), np.zeros(6), np.zeros((6, 6)), 0, 0)
        self._room = room()
        self._momentum, self._velocity = np.zeros(6), np.zeros(6)
        self._wrench, self._twist = np.zeros(6), np.zeros(6)
        self.pose: NDArray[np.float64] = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
        """Of the tool's frame (7,); changed in place."""
        self._compile()

    def _compile(self) -> None:
        """Take the first tick, for which machine code may have to be made, before any hurry."""
        still = LinearContact(self.pose.copy(), np.zeros(6), np.zeros((6, 6)), 0, 0)
        self.advance(self.pose.copy(), np.zeros(6), still)
        self._push()
        self.port_twist(self.pose, self.pose)
        self.reset(self.pose.copy())

    def reset(self, pose: NDArray[np.float64]) -> None:
        """Put the tool at rest at a pose (7,)."""
        self.pose[:] = pose
        self._momentum[:] = 0.0
        self._velocity[:] = 0.0

    @property
    def twist(self) -> NDArray[np.float64]:
        """Velocity (6,): linear, of the frame's origin [m/s]; angular [rad/s]; world axes."""
        out = self._velocity.copy()
        if not self.is_direct:
            reach = centre_of_mass(self.pose, self.body.centre) - self.pose[:3]
            out[:3] -= cross(out[3:], reach)
        return out

    def port_twist(
        self, last_handle: NDArray[np.float64], handle: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return the handle's mean velocity (6,) over a tick where the hand's wrench acts.

        That is what the wrench does work on: way over time of the point that the wrench is
        about, as if the handle reached as far, and turn over time.
        """
        self._handle_before[:], self._handle[:] = last_handle, handle
        self._fill_port_twist(
            self._handle_before, self._handle, self.pose, self.body.centre, self.dt,
            self._room.vector, self._twist,
        )  # fmt: skip
        return self._twist

    def _push(self) -> None:
        """Fill the wrench of the last contact where the tool is now."""
        contact = self._contact
        self._extrapolated(
            self.pose, self.body.centre, contact.pose, contact.wrench, contact.stiffness,
            self._room, self._wrench,
        )  # fmt: skip

    def advance(
        self,
        handle_pose: NDArray[np.float64],
        handle_twist: NDArray[np.float64],
        contact: LinearContact,
    ) -> NDArray[np.float64]:
        """Move the tool on by a tick; return the wrench (6,) that the hand feels.

        Parameters
        ----------
        handle_pose : (7,) array
            Where the hand wants the tool's frame: position [m], unit quaternion wxyz.
        handle_twist : (6,) array
            Its velocity: linear, of the frame's origin [m/s]; angular [rad/s]; world axes.
        contact : LinearContact
            The last that is known, of this tool; it may be some ticks old.

        Returns
        -------
        (6,) array
            Force [N] and torque about the tool's centre of mass [N m], world axes. The same
            array every time.
        """
        if self._step is None:
            self.pose[:] = handle_pose
            self._velocity[:] = handle_twist
            if np.array_equal(contact.pose, handle_pose):
                self._wrench[:] = contact.wrench
            else:
                self._keep(contact)
                self._push()
            return self._wrench
        self._keep(contact)
        self._handle[:], self._drive[:] = handle_pose, handle_twist
        kept = self._contact
        well = self._step(
            self.body, self.gains, self.dt, self.pose, self._momentum, self._velocity,
            self._handle, self._drive, kept.pose, kept.wrench, kept.stiffness,
            self._room, self._wrench,
        )  # fmt: skip
        x, y, z = self._room.pull[:3].tolist()
        if not (well and x * x + y * y + z * z <= REACH * REACH):
            self.resets += 1
            self.reset(handle_pose)
            self._wrench[:] = 0.0
        return self._wrench

    def _keep(self, contact: LinearContact) -> None:
        """Take over a contact's numbers."""
        kept = self._contact
        kept.pose[:], kept.wrench[:] = contact.pose, contact.wrench
        kept.stiffness[:] = contact.stiffness

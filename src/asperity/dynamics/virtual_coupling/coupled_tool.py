r"""The coupled tool: a rigid body held by the handle through a virtual coupling.

    handle pose and velocity --> coupling --> motion of the tool --> contact at the tool's pose
                                     \--> wrench on the hand

A tick first moves the tool under the last known contact, linearised, and returns the wrench on the
hand; then the contact is evaluated at the new pose. So the hand gets its answer before the contact
search, and if the search is late, the old contact is extrapolated.

If the handle jumps farther than `REACH`, the tool is re-attached to it and no wrench is sent.

In the `direct` mode tool and handle are one body: the contact is evaluated first, at the handle's
pose, and its wrench is the wrench on the hand.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from asperity._core.arrays import Array
from asperity._core.kernels import Repeated
from asperity.dynamics.linear_contact import LinearContact
from asperity.dynamics.virtual_coupling.loads import fill_port_twist
from asperity.dynamics.virtual_coupling.records import (
    Coupling,
    HandleMotion,
    Scheme,
    ToolMotion,
    no_wall,
    no_walls,
    workspace,
)
from asperity.dynamics.virtual_coupling.settings import (
    CouplingSettings,
    DeviceLimits,
    Gains,
    gains_for,
    require_stable,
)
from asperity.dynamics.virtual_coupling.step import coupled_step
from asperity.dynamics.virtual_coupling.walls import extrapolate_wrench, learn_wall
from asperity.errors import require_between
from asperity.geometry.rigid_body import RigidBody, centre_of_mass, cross, displacement

_SCHEMES = {
    "implicit": Scheme(has_mass=True, is_implicit=True),
    "semi-implicit": Scheme(has_mass=True, is_implicit=False),
    "static": Scheme(has_mass=False, is_implicit=True),
}
MOST_STEPS, SETTLED = 100, 1e-9
"""Largest number of steps of `settle`, and the displacement per step [m] below which it ends."""
REACH = 0.1
"""Largest distance between tool and handle [m]; beyond it the tool is re-attached.

A project default.
"""


class CoupledTool:
    """A tool on its virtual coupling.

    Parameters
    ----------
    body : RigidBody
        Mass properties; see `settings.coupled_body`.
    settings : CouplingSettings
    dt : float
        Tick [s], 1e-5 to 0.1.
    limits : Limits, optional
        Limits of the device that renders the coupling: its stiffness and damping cap the gains.

    Examples
    --------
    >>> tool.reset(handle_pose)
    >>> contact = stage.evaluate(tool.pose)
    >>> wrench = tool.advance(handle_pose, handle_twist, contact)  # on the hand
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
        """Whether tool and handle are one body; then evaluate the contact before `advance`."""
        self.resets = 0
        """Number of re-attachments: the handle jumped, or the tool's state was not finite."""
        self._step = None if self.is_direct else Repeated(coupled_step)
        self._learn_wall = Repeated(learn_wall)
        self._extrapolate_wrench = Repeated(extrapolate_wrench)
        self._fill_port_twist = Repeated(fill_port_twist)
        # Arguments are copied into these arrays: `Repeated` determines types at its first call.
        scheme = _SCHEMES.get(settings.mode, _SCHEMES["implicit"])
        self._coupling = Coupling(body, self.gains, scheme, self.dt)
        self._motion = ToolMotion(
            np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]), np.zeros(6), np.zeros(6)
        )
        self._handle = HandleMotion(np.zeros(7), np.zeros(6))
        self._last_handle = np.zeros(7)
        self._wall, self._walls = no_wall(), no_walls()
        self._last_contact: LinearContact | None = None
        self._workspace = workspace()
        self._wrench, self._twist = np.zeros(6), np.zeros(6)
        self._potential = math.nan
        self.pose: Array = self._motion.pose
        """Pose of the tool's frame (7,); changed in place."""
        self._compile()

    def _compile(self) -> None:
        """Run every kernel once, so that none is compiled within the loop."""
        rest = LinearContact(self.pose.copy(), np.zeros(6), np.zeros((6, 6)), 0, 0)
        self.advance(self.pose.copy(), np.zeros(6), rest)
        self._fill_contact_wrench()
        self.port_twist(self.pose, self.pose)
        self.reset(self.pose.copy())

    def reset(self, pose: Array) -> None:
        """Put the tool at rest at a pose (7,)."""
        self.pose[:] = pose
        self._motion.momentum[:] = 0.0
        self._motion.velocity[:] = 0.0
        self._walls.is_known[:] = False
        self._last_contact = None

    @property
    def twist(self) -> Array:
        """Velocity (6,) of the frame's origin [m/s] and angular velocity [rad/s], world axes."""
        out = self._motion.velocity.copy()
        if not self.is_direct:
            arm = centre_of_mass(self.pose, self.body.centre) - self.pose[:3]
            out[:3] -= cross(out[3:], arm)
        return out

    def port_twist(self, last_handle: Array, handle: Array) -> Array:
        """Return the handle's mean velocity (6,) over a tick at the tool's centre of mass.

        This is the velocity that the wrench on the hand does work on: the mean velocity of the
        wrench's reference point, moving rigidly with the handle [m/s], and the mean angular
        velocity [rad/s].

        Parameters
        ----------
        last_handle, handle : (7,) arrays
            Poses of the handle before and after the tick.
        """
        self._last_handle[:], self._handle.pose[:] = last_handle, handle
        self._fill_port_twist(
            self._last_handle, self._handle.pose, self.pose, self.body.centre, self.dt,
            self._workspace.vector, self._twist,
        )  # fmt: skip
        return self._twist

    def settle(
        self, handle_pose: Array, evaluate: Callable[[Array], LinearContact]
    ) -> LinearContact:
        """Put the tool at rest where coupling and contact balance; return the contact there.

        Parameters
        ----------
        handle_pose : (7,) array
        evaluate : callable
            Returns the contact at a pose (7,).
        """
        self.reset(handle_pose)
        contact = evaluate(self.pose)
        if contact.count == 0 or self._step is None:
            return contact
        free = self.gains._replace(damping=0.0, rotational_damping=np.zeros(3))
        coupling = Coupling(self.body, free, _SCHEMES["static"], self.dt)
        self._handle.pose[:], self._handle.twist[:] = handle_pose, 0.0
        for _ in range(MOST_STEPS):
            self._learn_contact(contact)
            last = self.pose.copy()
            coupled_step(
                coupling, self._motion, self._handle, self._walls, self._workspace, self._wrench
            )
            contact = evaluate(self.pose)
            if np.abs(self.pose - last).max() < SETTLED:
                break
        self._motion.velocity[:] = 0.0
        return contact

    @property
    def potential(self) -> float:
        """Potential that the wrench on the hand is minus the gradient of [J]; NaN if there is none.

        It is the contacts' in the direct mode. A coupling is passive by itself.
        """
        return self._potential

    @property
    def energy(self) -> float:
        """Energy stored in the coupling's spring at the last tick [J]."""
        if self.is_direct:
            return 0.0
        stretch = displacement(self.pose, self._handle.pose, self.body.centre)
        spring = self._workspace.spring
        return float(0.5 * stretch @ (spring * stretch))

    def advance(self, handle_pose: Array, handle_twist: Array, contact: LinearContact) -> Array:
        """Advance the tool by one tick; return the wrench (6,) on the hand.

        Parameters
        ----------
        handle_pose : (7,) array
            Pose that the handle draws the tool's frame to: position [m], unit quaternion wxyz.
        handle_twist : (6,) array
            Velocity of the handle: of the frame's origin [m/s], angular [rad/s]; world axes.
        contact : LinearContact
            The latest contact of this tool; it may be some ticks old.

        Returns
        -------
        (6,) array
            Force [N] and torque about the tool's centre of mass [N m], world axes. The same
            array at every call.
        """
        if self._step is None:
            self.pose[:] = handle_pose
            self._motion.velocity[:] = handle_twist
            energy = contact.energy
            if contact.pose.tobytes() == handle_pose.tobytes():
                self._wrench[:] = contact.wrench
            else:
                self._copy(contact)
                energy = self._fill_contact_wrench()
            self._potential = energy if contact.is_gradient else math.nan
            return self._wrench
        self._learn_contact(contact)
        self._handle.pose[:], self._handle.twist[:] = handle_pose, handle_twist
        is_sound = self._step(
            self._coupling, self._motion, self._handle, self._walls, self._workspace, self._wrench
        )
        x, y, z = self._workspace.extension[:3].tolist()
        if not (is_sound and x * x + y * y + z * z <= REACH * REACH):
            self.resets += 1
            self.reset(handle_pose)
            self._wrench[:] = 0.0
        return self._wrench

    def _fill_contact_wrench(self) -> float:
        """Fill the wrench with the last contact's at the tool's pose, to first order; return U."""
        return float(
            self._extrapolate_wrench(
                self.pose, self.body.centre, self._wall, self._workspace, self._wrench
            )
        )

    def _learn_contact(self, contact: LinearContact) -> None:
        """Make a contact the latest wall, unless it is already."""
        if contact is not self._last_contact:
            self._last_contact = contact
            self._copy(contact)
            self._learn_wall(self._wall, self.body.centre, self._walls, self._workspace)

    def _copy(self, contact: LinearContact) -> None:
        wall = self._wall
        wall.pose[:], wall.wrench[:] = contact.pose, contact.wrench
        wall.stiffness[:], wall.damping[:] = contact.stiffness, contact.damping
        wall.damped[:], wall.energy[0] = contact.damped, contact.energy

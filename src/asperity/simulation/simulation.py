"""The haptic loop in simulated time: a pose of the handle in, the wrench on the hand out.

    handle pose --> tool pose --> contacts (certified depths) --> wrench

In the `direct` mode tool and handle are one body, and the contact acts on the hand. In the other
modes a virtual coupling connects them and acts on the hand (`dynamics.virtual_coupling`).
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from asperity._core.arrays import Array, Indices
from asperity.dynamics.dragged_hand.hand import Hand
from asperity.dynamics.linear_contact import LinearContact
from asperity.dynamics.passivity.controller import PassivityController
from asperity.dynamics.simulated_hand.hand import HandSettings, SimulatedHand
from asperity.dynamics.virtual_coupling.coupled_tool import CoupledTool
from asperity.dynamics.virtual_coupling.settings import DeviceLimits, coupled_body
from asperity.errors import AsperityError, require_finite
from asperity.geometry.poses import mean_twist, require_pose
from asperity.scene.scene import Scene
from asperity.scene.trajectory import ScriptedMotion, Trajectory, at_ticks, scripted
from asperity.simulation.press import pressed_pose, touching_pose
from asperity.simulation.tool_contact import ToolContact


class ToolState(NamedTuple):
    """Time, pose and velocity of the tool."""

    time: float
    """Time since the first step [s]."""
    pose: Array
    """Pose of the tool's frame (7,)."""
    twist: Array
    """Linear [m/s] and angular [rad/s] velocity over the last tick, world axes (6,)."""


@dataclass(frozen=True, eq=False)
class Rollout:
    """The result of following a trajectory; rows are ticks.

    `time` (n,) [s]; `handle_pose`, `tool_pose` (n, 7); `contact_wrench` on the tool and
    `device_wrench` on the hand, both about the tool's centre of mass (n, 6) [N, N m];
    `contact_count`, `flags` (n,), see `FLAGS`; `tick_seconds` (n,), the computing time of each
    step [s]; `statuses` (3,), the number of contacts by status: certified, node budget spent,
    overflow. `penetration_depth` (n,) is that of the deepest contact [m], 0 without contact, or
    None if it was not recorded.
    """

    time: Array
    handle_pose: Array
    tool_pose: Array
    contact_wrench: Array
    device_wrench: Array
    contact_count: Indices
    flags: Indices
    tick_seconds: Array
    statuses: Indices
    penetration_depth: Array | None = None


class Simulation:
    """A scene in motion.

    Parameters
    ----------
    scene : Scene
    dt : float
        Tick [s], 1e-5 to 0.1.
    limits : Limits, optional
        Limits of the device that renders the coupling; they cap its gains.

    Examples
    --------
    >>> simulation = asperity.Simulation(asperity.load_scene("probe-plate"))
    >>> wrench = simulation.step(pose)  # force [N], torque [N m]
    """

    def __init__(
        self, scene: Scene, *, dt: float = 1e-3, limits: DeviceLimits | None = None
    ) -> None:
        if not isinstance(scene, Scene):
            raise AsperityError(
                f"scene must be a Scene, got {scene!r}; load_scene takes a name or a folder"
            )
        self.scene = scene
        self.stage = ToolContact(scene, dt=dt)
        self.dt = self.stage.dt
        body = coupled_body(scene.model, scene.tool, mass_scale=scene.coupling.mass_scale)
        self.tool = CoupledTool(body, scene.coupling, dt=self.dt, limits=limits)
        self.reset()

    def reset(self) -> None:
        """Discard the motion so far: contacts, friction, the anti-aliasing window, the time."""
        self.stage.reset()
        self._last: Array | None = None
        self._port = np.zeros(6)
        self._state = ToolState(-self.dt, self.scene.start.copy(), np.zeros(6))
        self.flags = 0
        """Bits of `FLAGS` for the last tick."""
        self.contact_wrench = np.zeros(6)
        """Wrench of the contact on the tool about its centre of mass (6,) [N, N m]."""

    @property
    def state(self) -> ToolState:
        """Time, pose and velocity of the tool."""
        return self._state

    @property
    def contacts(self) -> Any:
        """Contacts at the last pose, a `contact.contacts.Contacts`; valid until the next step."""
        return self.stage.contacts

    @property
    def contact_count(self) -> int:
        """Number of contacts at the last pose."""
        return self.stage.contact_count

    def step(self, handle_pose: ArrayLike, handle_twist: ArrayLike | None = None) -> Array:
        """Move the handle to a pose; return the wrench (6,) on the hand.

        Parameters
        ----------
        handle_pose : (7,)
            Position [m], unit quaternion wxyz.
        handle_twist : (6,), optional
            Velocity of the handle, linear [m/s] and angular [rad/s], world axes; by default from
            the last pose.

        Returns
        -------
        (6,) array
            Force [N] and torque about the tool's centre of mass [N m], world axes.
        """
        pose = require_pose(handle_pose)
        velocity = self._handle_velocity(pose, handle_twist)
        contact = self._acting_contact(pose)
        wrench = self.tool.advance(pose, velocity, contact).copy()
        self._finish_tick(pose, contact)
        return wrench

    def _handle_velocity(self, pose: Array, given: ArrayLike | None) -> Array:
        """Return the handle's velocity (6,): as given, or from its last pose."""
        if given is not None:
            return np.array(require_finite("handle twist", given, 6))
        return mean_twist(pose if self._last is None else self._last, pose, self.dt)

    def _acting_contact(self, pose: Array) -> LinearContact:
        """Return the contact that moves the tool in this tick.

        In the direct mode that at the handle's pose; otherwise that of the last tick.
        """
        if self.tool.is_direct:
            return self.stage.evaluate(pose)
        if self._last is None:
            return self.tool.settle(pose, lambda at: self.stage.evaluate(at, jumped=True))
        return self._contact

    def _finish_tick(self, pose: Array, contact: LinearContact) -> None:
        """Evaluate the contact at the tool's new pose, and keep the results of the tick."""
        if not self.tool.is_direct:
            contact = self.stage.evaluate(self.tool.pose)
        self._contact, self.contact_wrench = contact, contact.wrench
        self.flags = contact.flags
        self._state = ToolState(self._state.time + self.dt, contact.pose, self.tool.twist)
        self._port = self.tool.port_twist(pose if self._last is None else self._last, pose)
        self._last = pose

    @property
    def port_twist(self) -> Array:
        """Mean velocity (6,) of the handle over the last tick, at the tool's centre of mass.

        See `CoupledTool.port_twist`.
        """
        return self._port

    def rollout(
        self,
        trajectory: Trajectory | ScriptedMotion | None = None,
        *,
        hand: SimulatedHand | None = None,
        controller: PassivityController | None = None,
        on_tick: Callable[[int, Rollout], None] = lambda _, __: None,
    ) -> Rollout:
        """Follow a trajectory from its beginning; return the results of every tick.

        Parameters
        ----------
        trajectory : Trajectory or ScriptedMotion, optional
            Default: the scene's own. Between its poses the handle moves at constant velocity.
        hand : SimulatedHand, optional
            Holds the handle and yields to the wrench; see `hand`. The trajectory then determines
            only the duration. By default the handle follows the trajectory exactly.
        controller : PassivityController, optional
            Observes the energy at the hand, and corrects the wrench on it.
        on_tick : callable
            Called after each tick with its number and the results so far.
        """
        path = self.trajectory(trajectory)
        poses = np.asarray(at_ticks(path, self.dt), dtype=np.float64)
        n = len(poses)
        self.reset()
        self.step(poses[0])  # kernels are compiled or loaded: no part of a tick's time
        self.reset()
        if hand is not None:
            hand.reset()
        out = Rollout(
            time=np.asarray(np.arange(n) * self.dt, dtype=np.float64),
            handle_pose=poses,
            tool_pose=np.empty((n, 7)),
            contact_wrench=np.empty((n, 6)),
            device_wrench=np.empty((n, 6)),
            contact_count=np.zeros(n, np.int64),
            flags=np.zeros(n, np.int64),
            tick_seconds=np.empty(n),
            statuses=np.zeros(3, np.int64),
            penetration_depth=(depth := np.zeros(n)),
        )
        for i in range(n):
            if hand is not None:
                poses[i] = hand.pose
            start = time.perf_counter()
            wrench = self.step(poses[i])
            if controller is not None:
                if i == 0:
                    controller.reset(self.stage.energy + self.tool.energy)
                wrench = controller.correct(wrench, self.port_twist, stored=self.tool.potential)
            out.tick_seconds[i] = time.perf_counter() - start
            if hand is not None:
                hand.advance(wrench)
            out.tool_pose[i] = self._state.pose
            out.contact_wrench[i] = self.contact_wrench
            out.device_wrench[i] = wrench
            count = out.contact_count[i] = self.contact_count
            out.flags[i] = self.flags
            self.stage.count_statuses(out.statuses)
            if count:
                depth[i] = self.contacts.depth[:count].max()
            on_tick(i, out)
        return out

    def hand(
        self,
        motion: Trajectory | ScriptedMotion | None = None,
        settings: HandSettings | None = None,
        *,
        hand: Hand | None = None,
        damping: float = 0.0,
        press_in: float = 0.0,
    ) -> SimulatedHand:
        """Return a simulated hand that aims along a trajectory.

        Parameters
        ----------
        motion : Trajectory or ScriptedMotion, optional
            Default: the scene's own.
        settings : HandSettings, optional
            By default the hand presses with the motion's `press_force`: from the start if the
            motion starts on the surface, otherwise regulated once it has come down to it.
        hand : Hand, optional
            Mass, stiffness and damping along every axis, where `settings` is not given.
        damping : float
            Physical damping of the device [N s/m].
        press_in : float
            Time within which a hand that starts on the surface comes to press [s].
        """
        motion = self.scene.motion if motion is None else motion
        if settings is None:
            settings = HandSettings(hand=hand or Hand())
            if isinstance(motion, ScriptedMotion) and motion.press_depth is None:
                settings = replace(
                    settings, press_force=motion.press_force,
                    preload=motion.kind != "press-and-slide", press_in=press_in,
                )  # fmt: skip
        path = self.trajectory(motion)
        poses = np.asarray(at_ticks(path, self.dt), dtype=np.float64)

        def target(seconds: float) -> Array:
            return np.asarray(poses[min(round(seconds / self.dt), len(poses) - 1)])

        return SimulatedHand(
            target, settings, dt=self.dt, centre=self.tool.body.centre, damping=damping
        )

    def trajectory(self, motion: Trajectory | ScriptedMotion | None = None) -> Trajectory:
        """Return the poses of a motion in this scene, at the depth that its press force needs."""
        motion = self.scene.motion if motion is None else motion
        if isinstance(motion, Trajectory):
            return motion
        start = self.scene.start.copy()
        if motion.start is not None:
            start[:3] = motion.start
        touching = touching_pose(self.stage.engine, start)
        if motion.press_depth is not None:
            pressed = touching.copy()
            pressed[2] -= motion.press_depth
        else:
            pressed = pressed_pose(self.stage.engine, touching, motion.press_force)
            if not self.tool.is_direct:
                pressed[2] -= motion.press_force / self.tool.gains.stiffness
        self.reset()
        lift = float(touching[2] - pressed[2])
        return scripted(motion, pressed, dt=self.dt, lift=max(lift, 0.0))

"""The paper's loop: a pose of the handle in, the wrench that the hand feels out.

    handle pose --> tool pose --> contacts (certified depths) --> wrench

In the `direct` mode the tool is where the handle is, and the hand feels the contact. In the others
the tool hangs on the handle by a virtual coupling, and the hand feels that (`dynamics.held_tool`).
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from asperity.dynamics.dragged_hand.hand import Hand
from asperity.dynamics.passivity.controller import PassivityController
from asperity.dynamics.simulated_hand.hand import HandSettings, SimulatedHand
from asperity.dynamics.virtual_coupling.coupled_tool import CoupledTool
from asperity.dynamics.virtual_coupling.settings import DeviceLimits, coupled_body
from asperity.errors import AsperityError, require_finite
from asperity.geometry.poses import mean_twist, require_pose
from asperity.scene.scene import Scene
from asperity.scene.trajectory import ScriptedMotion, Trajectory, at_ticks, scripted
from asperity.simulation.press import pressed_pose, touching_pose
from asperity.simulation.tool_contact import (
    BUDGET_SPENT,
    FLAGS,
    NOT_CERTIFIED,
    OVERFLOW,
    SUB_POSES,
    TOO_FAST,
    ToolContact,
    announce_compiling,
)

__all__ = [
    "BUDGET_SPENT",
    "FLAGS",
    "NOT_CERTIFIED",
    "OVERFLOW",
    "SUB_POSES",
    "TOO_FAST",
    "Rollout",
    "Simulation",
    "ToolState",
    "announce_compiling",
]


class ToolState(NamedTuple):
    """Where the tool is."""

    time: float
    """Since the first step [s]."""
    pose: NDArray[np.float64]
    """Of the tool's frame (7,)."""
    twist: NDArray[np.float64]
    """Linear [m/s] and angular [rad/s] velocity over the last tick, world axes (6,)."""


@dataclass(frozen=True, eq=False)
class Rollout:
    """What came of a trajectory, one row a tick.

    `time` (n,) [s]; `handle_pose`, `tool_pose` (n, 7); `contact_wrench` on the tool about its
    centre of mass, and `device_wrench`, which the hand feels (n, 6) [N, N m]; `contact_count`,
    `flags` (n,), see `FLAGS`; `tick_seconds` (n,), how long each step took [s];
    `statuses` counts contacts by status: certified, node budget spent, overflow.
    `penetration_depth` (n,) is that of the deepest contact [m], 0 without any, or None where it
    is not known.
    """

    time: NDArray[np.float64]
    handle_pose: NDArray[np.float64]
    tool_pose: NDArray[np.float64]
    contact_wrench: NDArray[np.float64]
    device_wrench: NDArray[np.float64]
    contact_count: NDArray[np.int64]
    flags: NDArray[np.int64]
    tick_seconds: NDArray[np.float64]
    statuses: NDArray[np.int64]
    penetration_depth: NDArray[np.float64] | None = None


class Simulation:
    """A scene in motion.

    Parameters
    ----------
    scene : Scene
    dt : float
        Tick [s], 1e-5 to 0.1.
    limits : Limits, optional
        Of the device that renders the coupling; they cap its gains.

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
        """Forget all motion: contacts, friction, what was averaged, and the time."""
        self.stage.reset()
        self._last: NDArray[np.float64] | None = None
        self._port = np.zeros(6)
        self._state = ToolState(-self.dt, self.scene.start.copy(), np.zeros(6))
        self.flags = 0
        """What there is to say of the last tick: bits of `FLAGS`."""
        self.contact_wrench = np.zeros(6)
        """Of the contact on the tool at its pose, about its centre of mass (6,) [N, N m]."""

    @property
    def state(self) -> ToolState:
        """Time, pose and velocity of the tool."""
        return self._state

    @property
    def contacts(self) -> Any:
        """The contacts of the last pose, an `engine.memory.Contacts`. Valid until the next."""
        return self.stage.contacts

    @property
    def contact_count(self) -> int:
        """How many contacts there are at the last pose."""
        return self.stage.contact_count

    def step(
        self, handle_pose: ArrayLike, handle_twist: ArrayLike | None = None
    ) -> NDArray[np.float64]:
        """Move the handle to a pose; return the wrench (6,) that the hand feels.

        Parameters
        ----------
        handle_pose : (7,)
            Position [m], unit quaternion wxyz.
        handle_twist : (6,), optional
            Its velocity, linear [m/s] and angular [rad/s], world axes; by default from the last
            pose.

        Returns
        -------
        (6,) array
            Force [N] and torque about the tool's centre of mass [N m], world axes.
        """
        pose = require_pose(handle_pose)
        moved = self._velocity(pose, handle_twist)
        if self.tool.is_direct:
            contact = self.stage.evaluate(pose)
            wrench = self.tool.advance(pose, moved, contact).copy()
        else:
            if self._last is None:
                self.tool.reset(pose)
                self._contact = self.stage.evaluate(pose)
            wrench = self.tool.advance(pose, moved, self._contact).copy()
            contact = self.stage.evaluate(self.tool.pose)
        self._contact, self.contact_wrench = contact, contact.wrench
        self.flags = contact.flags
        self._state = ToolState(self._state.time + self.dt, contact.pose, self.tool.twist)
        self._port = self.tool.port_twist(pose if self._last is None else self._last, pose)
        self._last = pose
        return wrench

    def _velocity(self, pose: NDArray[np.float64], given: ArrayLike | None) -> NDArray[np.float64]:
        """Return the handle's velocity (6,): as given, or from its last pose."""
        if given is not None:
            return np.array(require_finite("handle twist", given, 6))
        return mean_twist(pose if self._last is None else self._last, pose, self.dt)

    @property
    def port_twist(self) -> NDArray[np.float64]:
        """The handle's mean velocity over the last tick where the hand's wrench acts (6,)."""
        return self._port

    def rollout(
        self,
        trajectory: Trajectory | ScriptedMotion | None = None,
        *,
        hand: SimulatedHand | None = None,
        controller: PassivityController | None = None,
        on_tick: Callable[[int, Rollout], None] = lambda _, __: None,
    ) -> Rollout:
        """Follow a trajectory from its beginning; return what happened, tick by tick.

        Parameters
        ----------
        trajectory : Trajectory or ScriptedMotion, optional
            Default: the scene's own. Between its poses the handle moves evenly.
        hand : SimulatedHand, optional
            Holds the handle, and yields to what it feels; see `hand`. The trajectory then says
            only how long. By default the handle is where the trajectory says.
        controller : PassivityController, optional
            Keeps the account of the hand's energy, and corrects what the hand feels.
        on_tick : callable
            Called after each tick with its number, and with what there is so far.
        """
        path = self.trajectory(trajectory)
        poses = np.asarray(at_ticks(path, self.dt), dtype=np.float64)
        n = len(poses)
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
                    controller.reset(self.stage.energy)
                wrench = controller.correct(wrench, self.port_twist)
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
        """Return a simulated hand that aims along a trajectory, by default the scene's.

        Without settings it presses with the motion's `press_force`; a motion that comes down
        from above finds that force, one that begins on the surface begins with it; and `hand`
        is its mass, stiffness and damping along every axis. `damping` is the device's own
        [N s/m]; within `press_in` a hand that begins on the surface comes to press [s].
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

        def target(seconds: float) -> NDArray[np.float64]:
            return np.asarray(poses[min(round(seconds / self.dt), len(poses) - 1)])

        return SimulatedHand(
            target, settings, dt=self.dt, centre=self.tool.body.centre, damping=damping
        )

    def trajectory(self, motion: Trajectory | ScriptedMotion | None = None) -> Trajectory:
        """Return the poses of a motion in this scene, pressed as it says."""
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
        self.reset()
        lift = float(touching[2] - pressed[2])
        return scripted(motion, pressed, dt=self.dt, lift=max(lift, 0.0))

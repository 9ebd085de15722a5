"""The paper's loop: a pose of the handle in, the wrench that the hand feels out.

    handle pose --> tool pose --> contacts (certified depths) --> wrench

In the `direct` mode the tool is where the handle is, and the hand feels the contact.
"""

from __future__ import annotations

import functools
import logging
import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from asperity.anti_alias import BUDGET, LEAP, PER_WAVE, Window, sub_poses
from asperity.compiled import is_compiled
from asperity.engine.engine import Engine
from asperity.errors import require_between
from asperity.poses import between, require_pose, turn_between, twist
from asperity.press import pressed_pose, touching_pose
from asperity.scene import Scene
from asperity.trajectory import ScriptedMotion, Trajectory, at_ticks, scripted

SUB_POSES, BUDGET_SPENT, TOO_FAST, NOT_CERTIFIED, OVERFLOW = 1, 2, 4, 8, 16
FLAGS = {
    SUB_POSES: "wrench from several poses within the tick",
    BUDGET_SPENT: "more sub-poses wanted than allowed",
    TOO_FAST: "texture faster than half the tick rate, and anti_alias is off",
    NOT_CERTIFIED: "a depth was not certified within the node budget",
    OVERFLOW: "a search or the list of contacts overflowed",
}
"""Bits of a tick's flags, and what they say."""


@functools.cache
def announce_compiling() -> None:
    """Say, once, that the first force takes a while, if no machine code of it is kept yet."""
    if not is_compiled("engine.tick", "tick"):
        logging.getLogger(__name__).warning(
            "compiling the contact engine, once after an installation: takes less than a minute"
        )


class State(NamedTuple):
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


class Simulation:
    """A scene in motion.

    Parameters
    ----------
    scene : Scene
    dt : float
        Tick [s], 1e-5 to 0.1.

    Examples
    --------
    >>> simulation = asperity.Simulation(asperity.load_scene("probe-plate"))
    >>> wrench = simulation.step(pose)  # force [N], torque [N m]
    """

    def __init__(self, scene: Scene, *, dt: float = 1e-3) -> None:
        announce_compiling()
        self.scene = scene
        self.dt = require_between("dt", dt, 1e-5, 0.1, "s")
        self._engine: Any = Engine(scene.model, scene.bodies, scene.tool, scene.force)
        self._window = Window(scene.anti_alias) if scene.anti_alias != "off" else None
        self._wavelength = scene.shortest_wavelength
        # Bristles remember: their wrench is asked for in the order of time.
        self._halve = getattr(scene.force, "friction", 0.0) == 0.0
        self._extent = max(float(scene.model.stat.extent), 1e-3)
        self.reset()

    def reset(self) -> None:
        """Forget all motion: contacts, friction, what was averaged, and the time."""
        self._engine.reset()
        if self._window is not None:
            self._window.reset()
        self._last: NDArray[np.float64] | None = None
        self._last_wrench = np.zeros(6)
        self._state = State(-self.dt, self.scene.start.copy(), np.zeros(6))
        self.flags = 0
        """What there is to say of the last tick: bits of `FLAGS`."""

    @property
    def state(self) -> State:
        """Time, pose and velocity of the tool."""
        return self._state

    @property
    def contacts(self) -> Any:
        """The contacts of the last pose, an `engine.memory.Contacts`. Valid until the next."""
        return self._engine.contacts

    @property
    def contact_count(self) -> int:
        """How many contacts there are at the last pose."""
        return int(self._engine.contacts.count[0])

    def step(self, handle_pose: ArrayLike) -> NDArray[np.float64]:
        """Move the handle to a pose; return the wrench (6,) that the hand feels.

        Parameters
        ----------
        handle_pose : (7,)
            Position [m], unit quaternion wxyz.

        Returns
        -------
        (6,) array
            Force [N] and torque about the tool's centre of mass [N m], world axes.
        """
        pose = require_pose(handle_pose)
        last = pose if self._last is None else self._last
        wrench = self._contact_wrench(last, pose)
        self._state = State(self._state.time + self.dt, pose, twist(last, pose, self.dt))
        self._last = pose
        self._flag_contacts()
        return wrench

    def _contact_wrench(
        self, last: NDArray[np.float64], pose: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return the wrench of this tick: at its pose, or averaged over the way there."""
        self.flags = 0
        waves = self._waves(last, pose)
        if self._window is None:
            if waves > 0.5:
                self.flags |= TOO_FAST
            return np.array(self._engine.wrench(pose, self.dt))
        if self._last is None:
            self._last_wrench = np.array(self._engine.wrench(pose, self.dt))
        count = max(1, math.ceil(min(PER_WAVE * waves, BUDGET + 1)))
        piece = self.dt / min(count, BUDGET)

        def evaluate(s: float) -> NDArray[np.float64]:
            return np.array(self._engine.wrench(between(last, pose, s), piece))

        nodes = sub_poses(
            evaluate,
            self._last_wrench,
            count,
            lever=self._extent,
            leap=LEAP[self.scene.anti_alias],
            halve=self._halve and waves > 0,
        )
        if nodes.s.size > 2:
            self.flags |= SUB_POSES
            if self._halve:
                # The contacts to show are those of the last pose, not of the last halving.
                self._engine.wrench(pose, 0.0)
        if nodes.spent:
            self.flags |= BUDGET_SPENT
        self._last_wrench = nodes.wrench[-1]
        return self._window.weigh(nodes)

    def _waves(self, last: NDArray[np.float64], pose: NDArray[np.float64]) -> float:
        """Return how many of the shortest waves the tool passes in this tick, at most."""
        if self._last is None or math.isinf(self._wavelength):
            return 0.0
        contacts, lever = self._engine.contacts, 0.0
        count = int(contacts.count[0])
        turn = float(np.linalg.norm(turn_between(last, pose)))
        if turn > 0.0 and count:
            lever = float(np.linalg.norm(contacts.point[:count] - last[:3], axis=1).max())
        motion = math.dist(last[:3].tolist(), pose[:3].tolist()) + turn * lever
        return motion / self._wavelength

    def _flag_contacts(self) -> None:
        contacts = self._engine.contacts
        count = int(contacts.count[0])
        if count:
            worst = int(contacts.status[:count].max())
            if worst >= 1:
                self.flags |= NOT_CERTIFIED
            if worst >= 2:
                self.flags |= OVERFLOW

    def rollout(
        self,
        trajectory: Trajectory | ScriptedMotion | None = None,
        *,
        on_tick: Callable[[int, Rollout], None] = lambda _, __: None,
    ) -> Rollout:
        """Follow a trajectory from its beginning; return what happened, tick by tick.

        Parameters
        ----------
        trajectory : Trajectory or ScriptedMotion, optional
            Default: the scene's own. Between its poses the handle moves evenly.
        on_tick : callable
            Called after each tick with its number, and with what there is so far.
        """
        path = self.trajectory(trajectory)
        poses = np.asarray(at_ticks(path, self.dt), dtype=np.float64)
        n = len(poses)
        self.reset()
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
        )
        for i in range(n):
            start = time.perf_counter()
            wrench = self.step(poses[i])
            out.tick_seconds[i] = time.perf_counter() - start
            out.tool_pose[i] = self._state.pose
            out.contact_wrench[i] = out.device_wrench[i] = wrench
            count = out.contact_count[i] = self.contact_count
            out.flags[i] = self.flags
            if count:
                out.statuses[:] += np.bincount(self.contacts.status[:count], minlength=3)[:3]
            on_tick(i, out)
        return out

    def trajectory(self, motion: Trajectory | ScriptedMotion | None = None) -> Trajectory:
        """Return the poses of a motion in this scene, pressed as it says."""
        motion = self.scene.motion if motion is None else motion
        if isinstance(motion, Trajectory):
            return motion
        start = self.scene.start.copy()
        if motion.start is not None:
            start[:3] = motion.start
        touching = touching_pose(self._engine, start)
        if motion.press_depth is not None:
            pressed = touching.copy()
            pressed[2] -= motion.press_depth
        else:
            pressed = pressed_pose(self._engine, touching, motion.press_force)
        self.reset()
        lift = float(touching[2] - pressed[2])
        return scripted(motion, pressed, dt=self.dt, lift=max(lift, 0.0))

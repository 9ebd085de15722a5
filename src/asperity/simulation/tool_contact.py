"""The contact of a tool at a pose, evaluated in every tick of a simulation or servo loop.

A tick leads from the tool's pose to sub-poses, if texture passes faster than the tick, then to
contacts, the wrench and its stiffness.
"""

from __future__ import annotations

import functools
import logging
import math
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from asperity._core.arrays import Array, Indices
from asperity._core.kernels import Repeated, is_compiled
from asperity.contact.response.settings import ForceSettings
from asperity.contact.response.stiffness import AT_REST, SlipMotion
from asperity.contact.solver import ContactSolver
from asperity.dynamics.linear_contact import LinearContact
from asperity.dynamics.virtual_coupling.settings import CouplingSettings
from asperity.errors import require_between
from asperity.geometry.poses import interpolate_pose, mean_twist
from asperity.geometry.rigid_body import centre_of_mass, cross
from asperity.scene.scene import Scene
from asperity.simulation.anti_aliasing import (
    BUDGET,
    LEAP,
    PER_WAVE,
    Window,
    make_ready,
    moved_most,
    sub_poses,
)
from asperity.simulation.soft_engine import soft_engine

SUB_POSES, BUDGET_SPENT, TOO_FAST, NOT_CERTIFIED, OVERFLOW = 1, 2, 4, 8, 16
FALLBACK, PASSIVITY, LIMITED, SILENT, LATE = 32, 64, 128, 256, 512
CUT_SHORT = 1024
FLAGS = {
    SUB_POSES: "wrench from several poses within the tick",
    BUDGET_SPENT: "more sub-poses wanted than allowed or than there was time for",
    TOO_FAST: "texture faster than half the tick rate, and anti_alias is off",
    NOT_CERTIFIED: "a depth was not certified, or a soft body is pressed beyond its model",
    OVERFLOW: "a search or list of contacts overflowed, or the tool is where no soft layer reaches",
    FALLBACK: "an older contact, taken on to the present pose",
    PASSIVITY: "wrench changed by the passivity controller",
    LIMITED: "wrench held back by soft start or a limit of force torque or slew",
    SILENT: "wrench not known or device silent, zero was sent",
    LATE: "finished after its deadline",
    CUT_SHORT: "a search was ended by its time before its depth was certified",
}
"""Bits of a tick's flags and their meanings, which recordings contain as `flag_meanings`."""


_FASTEST, _FASTEST_TURN = 10.0, 100.0
"""Speeds above which a tool has been placed elsewhere [m/s], [rad/s] (project default)."""
_MODULES = {
    "tick": "contact.geom_tick", "mesh_tick": "contact.mesh_tick", "press": "contact.soft.press",
    "press_surface": "contact.deformable.press",
}  # fmt: skip
"""Modules of the kernels that have to be compiled before the first force."""


def tick_kernel(scene: Scene) -> str:
    """Return the name of the contact kernel of a scene, as in `_MODULES`."""
    if scene.soft is not None:
        return "press" if scene.skin else "press_surface"
    return "mesh_tick" if any(body.mesh is not None for body in scene.bodies) else "tick"


@functools.cache
def announce_compiling(tick: str = "tick") -> None:
    """Log once that the first force takes a while, unless its kernel is in the cache.

    `tick` is the kernel's name; see `tick_kernel`. It is logged once for all kernels.
    """
    if not is_compiled(_MODULES[tick], tick):
        _say_compiling()


@functools.cache
def _say_compiling() -> None:
    logging.getLogger(__name__).warning(
        "compiling the contact kernels, once after an installation: takes a minute or two"
    )


class ToolContact:
    """Contacts of a scene's tool at successive poses.

    Parameters
    ----------
    scene : Scene
    dt : float
        Tick [s], 1e-5 to 0.1: the time between poses.
    now : callable
        Returns the time [s]; `evaluate` measures its time limits with it.
    """

    def __init__(
        self, scene: Scene, *, dt: float = 1e-3, now: Callable[[], float] = time.perf_counter
    ) -> None:
        announce_compiling(tick_kernel(scene))
        given = scene
        self.scene = scene = replace(
            given, force=given.acting_force, anti_alias=given.acting_anti_alias
        )
        """The scene, with the stiffness and the anti-aliasing that act with its coupling."""
        self._given = given
        self._now = now
        self._end = math.inf
        self._cost = 0.0
        """Estimated time of one contact query, rather too long than too short [s]."""
        self.dt = require_between("dt", dt, 1e-5, 0.1, "s")
        self.engine: Any = soft_engine(scene) or ContactSolver(
            scene.model, scene.bodies, scene.tool, scene.force
        )
        """The contact solver; its `wrench` has no anti-aliasing."""
        self._window: Window | None = None
        self._choose_window()
        self._wavelength = scene.shortest_wavelength
        self._moved = Repeated(moved_most)
        own = [body.largest_friction for body in scene.bodies]
        self._largest_friction = max(own) if scene.soft is None else scene.soft.friction
        """Largest coefficient of friction of a body, or that of the soft one."""
        self._extent = max(float(scene.model.stat.extent), 1e-3)
        self.reset()

    def reset(self) -> None:
        """Discard the poses so far: contacts, friction, the anti-aliasing window."""
        self.engine.reset()
        if self._window is not None:
            self._window.reset()
        self._last: Array | None = None
        self._last_wrench = np.zeros(6)
        self._before: tuple[Array, ...] = ()
        self._motion = AT_REST
        self._flags = 0

    @property
    def contacts(self) -> Any:
        """Contacts at the last pose, a `contact.contacts.Contacts`; valid until the next."""
        return self.engine.contacts

    @property
    def displacements(self) -> Array | None:
        """Of the vertices of an elastic body at the last pose [m], (v, 3); None without one."""
        return None if self.scene.elastic is None else np.asarray(self.engine.displacements)

    @property
    def contact_count(self) -> int:
        """Number of contacts at the last pose."""
        return int(self.engine.contacts.count[0])

    @property
    def energy(self) -> float:
        """U of Eq. 1: the energy stored in the contacts at the last pose [J]."""
        if self._is_gradient or self.scene.elastic is not None:
            return float(self.engine.energy)
        contacts, n = self.engine.contacts, self.contact_count
        depths = contacts.weight[:n] @ contacts.depth[:n] ** 2
        return float(0.5 * self.scene.force.stiffness * depths)

    @property
    def _is_gradient(self) -> bool:
        # An elastic body has a state: what it stores does not follow from the pose.
        is_rigid = self.scene.soft is None
        return self.scene.skin is not None or (is_rigid and self.scene.force.law == "otaduy-lin")

    def evaluate(
        self,
        pose: Array,
        *,
        jumped: bool = False,
        seconds: float = math.inf,
        search_seconds: float = math.inf,
    ) -> LinearContact:
        """Return the contact at the tool's next pose, one tick after the last one.

        With anti-aliasing the wrench is a mean over the tick; the stiffness is that of the
        contacts at the pose.

        Parameters
        ----------
        pose : (7,) array
        jumped : bool
            Whether ticks were skipped since the last pose. Then there is no motion of one tick to
            average over, and the wrench is that at the pose. The same holds if the tool has moved
            faster than 10 m/s or 100 rad/s.
        seconds : float
            Time limit for sub-poses [s]; the pose itself is evaluated in any case.
        search_seconds : float
            Time limit after which searches end with the best depth found [s]; see
            `ContactSolver.wrench`.
        """
        # A copy: it is kept, and the kernels that take it expect one memory layout.
        pose = np.array(pose, dtype=np.float64)
        last = pose if self._last is None else self._last
        self._flags, begun = 0, self._now()
        self._end = begun + search_seconds
        jumped = jumped or self._has_jumped(last, pose)
        self._motion = AT_REST
        if self._has_friction and self._is_coupled and not jumped:
            twist = mean_twist(last, pose, self.dt)
            arm = centre_of_mass(pose, self.engine.centre) - pose[:3]
            twist[:3] += cross(twist[3:], arm)
            self._motion = SlipMotion(twist, self.dt)
        if jumped or self._last is None:
            wrench = self._wrench_at_jump(pose)
        else:
            wrench = self._wrench(last, pose, begun + seconds)
        self._last = pose
        self._flag_contacts()
        stiffness, damping, damped = self.engine.derivatives(self._motion)
        if self._separates_damping:
            wrench += damped
        return LinearContact(
            pose, wrench, stiffness, self.contact_count, self._flags, damping, damped, self.energy,
            self._is_gradient,
        )  # fmt: skip

    def _has_jumped(self, last: Array, pose: Array) -> bool:
        """Return whether the tool has been placed elsewhere."""
        # As numbers: an array of three takes longer than all of this.
        x, y, z, qw, qx, qy, qz = last.tolist()
        to_x, to_y, to_z, to_w, to_qx, to_qy, to_qz = pose.tolist()
        if math.dist((x, y, z), (to_x, to_y, to_z)) > _FASTEST * self.dt:
            return True
        half = min(abs(qw * to_w + qx * to_qx + qy * to_qy + qz * to_qz), 1.0)
        return 2.0 * math.acos(half) > _FASTEST_TURN * self.dt

    def change(self, *, force: ForceSettings, dt: float, coupling: CouplingSettings) -> None:
        """Continue with another stiffness and friction, tick [s], and coupling."""
        self.dt = require_between("dt", dt, 1e-5, 0.1, "s")
        mode = replace(self._given, coupling=coupling).acting_anti_alias
        is_new = mode != self.scene.anti_alias
        self.scene = replace(self.scene, force=force, coupling=coupling, anti_alias=mode)
        if is_new:
            self._choose_window()
        self.engine.change(force)

    def _choose_window(self) -> None:
        self._window, self._before = None, ()
        if self.scene.anti_alias != "off":
            self._window = Window(self.scene.anti_alias)
            make_ready()

    def _wrench_at_jump(self, pose: Array) -> Array:
        """Return the wrench at a pose, and restart the anti-aliasing window there."""
        if self._window is not None:
            self._window.reset()
        self._last_wrench = self._query(pose, self.dt)
        self._before = ()
        return self._last_wrench.copy()

    def _query(self, pose: Array, piece: float) -> Array:
        """Return the wrench at a pose; flag the tick if a search reached its time limit."""
        left = max(self._end - self._now(), 0.0)
        wrench = np.array(self.engine.wrench(pose, piece, left))
        if self._separates_damping:
            wrench -= self.engine.derivatives(self._motion).damped
        if self.engine.was_cut:
            self._flags |= CUT_SHORT
        return wrench

    def _timed_query(self, pose: Array, piece: float) -> Array:
        """Return the wrench at a pose, and update the estimated time of a query."""
        begun = self._now()
        wrench = self._query(pose, piece)
        took = self._now() - begun
        # The estimate rises quickly and falls slowly.
        self._cost += (0.5 if took > self._cost else 0.02) * (took - self._cost)
        return wrench

    def _wrench(self, last: Array, pose: Array, until: float) -> Array:
        """Return the wrench of this tick: at its pose, or averaged over the tick."""
        waves = self._waves(last, pose)
        if self._window is None:
            if waves > 0.5:
                self._flags |= TOO_FAST
            return self._query(pose, self.dt)
        # Up to half a wave a tick is not too fast for the tick itself.
        wanted = 1 if waves <= 0.5 else math.ceil(min(PER_WAVE * waves, BUDGET + 1))
        if wanted == 1 and self._is_coupled:
            # No wave to average over, and the mean's delay would shake a tool on stiff contact.
            self._last_wrench = self._timed_query(pose, self.dt)
            return self._last_wrench.copy()
        seconds = until - self._now()
        count = min(wanted, max(1, int(min(seconds / max(self._cost, 1e-6), BUDGET + 1.0))))
        piece = self.dt / min(count, BUDGET)
        at_end: list[Any] = []  # empty until the last pose; then None, or its stored results

        def evaluate(s: float) -> Array:
            if s == 1.0:
                at_end.append(None)
                return self._timed_query(pose, piece)
            if at_end == [None]:
                at_end[0] = self.engine.keep()
            return self._timed_query(interpolate_pose(last, pose, s), piece)

        def in_time() -> bool:
            # For one more query, and that of the last pose.
            return self._now() + 2.0 * self._cost < until

        nodes = sub_poses(
            evaluate,
            self._last_wrench,
            count,
            lever=self._extent,
            leap=LEAP[self.scene.anti_alias],
            halve=self._bisects and waves > 0,
            before=self._before,
            in_time=in_time,
        )
        if nodes.s.size > 2:
            self._flags |= SUB_POSES
            if at_end != [None]:
                self.engine.restore(at_end[0])
        if nodes.spent or count < wanted:
            self._flags |= BUDGET_SPENT
        self._before = (self._last_wrench, *self._before[:1])
        self._last_wrench = nodes.wrench[-1]
        return self._window.weigh(nodes)

    @property
    def _bisects(self) -> bool:
        """Whether to bisect around jumps of the wrench.

        Friction has a state: its poses must be evaluated in the order of time. The force of a tool
        on a coupling jumps when it bounces, even without texture, and the coupling filters that.
        """
        return not self._has_friction and not self._is_coupled

    @property
    def _separates_damping(self) -> bool:
        """Whether wrenches are averaged without damping, which a coupling's step adds itself."""
        return self._is_coupled and (self.scene.force.dissipation > 0.0 or self._has_friction)

    @property
    def _has_friction(self) -> bool:
        return self.scene.force.friction > 0.0 or self._largest_friction > 0.0

    @property
    def _is_coupled(self) -> bool:
        return self.scene.coupling.mode != "direct"

    def _waves(self, last: Array, pose: Array) -> float:
        """Return an upper bound on how many of the shortest waves pass the tool in this tick."""
        if math.isinf(self._wavelength):
            return 0.0
        contacts = self.engine.contacts
        return float(self._moved(contacts.count, contacts.point, last, pose) / self._wavelength)

    def _flag_contacts(self) -> None:
        contacts = self.engine.contacts
        count, left_out = contacts.count.tolist()
        if count and max(contacts.status[:count].tolist()) >= 1:
            self._flags |= NOT_CERTIFIED
        if left_out:
            self._flags |= OVERFLOW

    def count_statuses(self, statuses: Indices) -> None:
        """Add the number of contacts by status to `statuses` (3,).

        In order: certified, budget spent, overflow. A full contact list without any contact
        counts as one overflow.
        """
        contacts = self.engine.contacts
        count, left_out = contacts.count.tolist()
        for status in contacts.status[:count].tolist():
            statuses[min(status, 2)] += 1
        if left_out and not count:
            statuses[2] += 1

"""Contact of a rigid tool with an elastic body, in the place of `ContactSolver`."""

from __future__ import annotations

import math
from functools import cached_property
from typing import Any

import mujoco
import numpy as np

from asperity._core.arrays import Array
from asperity.contact.contacts import NOT_CERTIFIED, empty_contacts
from asperity.contact.deformable.elastic_solid import ElasticSolid
from asperity.contact.deformable.seen_from_above import SeenFromAbove, TaxelGrid
from asperity.contact.response.stiffness import ContactDerivatives
from asperity.errors import AsperityError
from asperity.geometry.poses import rotation_of
from asperity.scene.scene import Scene
from asperity.simulation.layer_end import FLAT, HeldContact, LayerEnd
from asperity.simulation.summed_contact import fill_summed

_LEAP = 0.01
"""Largest way of a vertex in a step [m]: that of a tool at 10 m/s in 1 ms, beyond which it has been
placed elsewhere."""
_MOST = 60
"""Newton steps in which the body has to come to rest."""
_AT_REST, _BROUGHT_IN = 1e-9, 1e-4
"""Largest error of a displacement, over the thickness of the layer: of a body at rest, and of one
that a tool is brought into."""
_FARTHEST = 0.5
"""Largest displacement, over the smallest side of the body; a project default."""
_FASTEST = 2.0
"""Speed from which on a step that cannot be solved is one of a tool placed elsewhere [m/s]."""


class ElasticEngine:
    """Contact of a scene's tool with its elastic body, which has a state.

    It has what `ToolContact` asks of a `ContactSolver`. The first pose after `reset`, and each with
    `dt` 0, finds the body at rest under the tool; every other pose advances it by `dt`. Its
    contact, where there is one, is the sum of all taxels: at the centre of pressure, with the
    largest compression of the layer as its depth.

    A linear body would be pressed flat, and turn inside out. So where it would be displaced by more
    than half of its smallest side it stays as it is there, and the layer alone yields: the force
    goes on, and such contacts are not certified. The body moves again once the tool presses the
    layer less than it did then. Where the layer, too, would be pressed flat, see
    `LayerEnd`. A tool that is deep inside when it is placed is brought in from outside.
    """

    def __init__(self, scene: Scene, solid: ElasticSolid) -> None:
        data = mujoco.MjData(scene.model)
        mujoco.mj_kinematics(scene.model, data)
        at = data.body(solid.body.name)
        self._home, self._turn = np.array(at.xpos), rotation_of(np.array(at.xquat))
        self._both = np.kron(np.eye(2), self._turn)
        self._back = np.array(at.xquat) * [1.0, -1.0, -1.0, -1.0]
        self.centre = np.array(scene.model.body(scene.tool).ipos)
        tool = [body for body in scene.bodies if body.name == scene.tool]
        self.elastic = solid.contact(tool, centres=[self.centre], leap=_LEAP)
        self._side = float(np.ptp(self.elastic.body.mesh.vertices, axis=0).min())
        self._end = LayerEnd(scene, solid.surface.thickness)
        self.contacts = empty_contacts(1)
        self.was_cut = False
        self.reset()

    @cached_property
    def grid(self) -> TaxelGrid:
        """Where the fields are."""
        return TaxelGrid(self.elastic.surface.surface)

    @cached_property
    def skin(self) -> SeenFromAbove:
        """The fields of the last pose, seen from above."""
        return SeenFromAbove(self.elastic.surface, self.grid)

    def reset(self) -> None:
        """Put the body at rest, without contact."""
        self.elastic.reset()
        self._is_new, self._stopped, self._bent = True, math.inf, 0.0
        self.strain = 0.0
        """Largest displacement since, over the smallest side of the body."""
        self._shape = np.zeros_like(self.elastic.body.mesh.vertices)
        self._found: ContactDerivatives | None = None
        self._held: HeldContact | None = None
        self._force, self._last = np.zeros(3), np.zeros(7)
        self._end.reset()
        self.contacts.count[:] = 0

    def change(self, settings: Any) -> None:
        """Ignore new settings of the force: an elastic body has its own properties."""

    @property
    def displacements(self) -> Array:
        """Of the vertices of the surface [m], in the frame of the body, (v, 3)."""
        return self._shape

    def wrench(self, pose: Array, dt: float, seconds: float = math.inf) -> Array:
        """Return the wrench at a pose; see `ContactSolver.wrench`."""
        if dt == 0.0:
            self.reset()
        self._found = self._held = None
        self.contacts.count[1] = self.contacts.status[0] = 0
        self._move(pose, dt)
        self._is_new, self._last = dt == 0.0, np.array(pose)
        surface, contacts = self.elastic.surface, self.contacts
        wrench = (surface.wrenches[0].reshape(2, 3) @ self._turn.T).ravel()
        self._force = wrench[:3].copy()
        # The tool feels the surface's friction the other way.
        friction = -(self._turn @ surface.out.damped[:3])
        if self._held:
            wrench *= self._held.growth
            friction *= self._held.growth
        if fill_summed(contacts, surface.out.push, wrench[:3], friction):
            contacts.point[0] = self._turn @ contacts.point[0] + self._home
            if self._held:
                contacts.point[0] -= self._held.way * self._held.normal
        return np.asarray(wrench)

    def _local(self, pose: Array) -> Array:
        """Return a pose of the world in the frame of the body."""
        local = np.zeros(7)
        local[:3] = (pose[:3] - self._home) @ self._turn
        mujoco.mju_mulQuat(local[3:], self._back, pose[3:])
        return local

    def _move(self, pose: Array, dt: float) -> None:
        """Bring the body to where it is with the tool at a pose."""
        elastic = self.elastic
        if self._stopped < math.inf:
            self._press_stopped(pose)
            if self.energy >= self._stopped:
                return
            self._found = self._held = None
            self.contacts.count[1] = self.contacts.status[0] = 0
        elif not self._is_new and self._steps(pose, dt):
            return
        try:
            depth = self._end.overlap(pose).depth
            is_in = depth <= self._end.thickness and self._settles(pose)
        except AsperityError:
            elastic.reset()
            is_in = False
        if not is_in:
            for place in self._end.steps(pose):
                try:
                    if self._settles(place, _BROUGHT_IN):
                        continue
                except AsperityError:
                    pass
                self._stop(pose)
                return
        self._stopped = math.inf
        self._refuse_flat(pose)

    def _steps(self, pose: Array, dt: float) -> bool:
        """Advance the body by a step; return False where it has to be found at rest anew."""
        elastic = self.elastic
        moved = math.dist(pose[:3].tolist(), self._last[:3].tolist())
        try:
            elastic.step([self._local(pose)], dt)
            is_in = self._takes(elastic.displacements) and not self._is_lost(pose)
        except AsperityError:
            is_in = False
        is_touched = elastic.surface.out.push[0] > 0.0
        if moved > (_LEAP if is_in and is_touched else _FASTEST * dt) and (is_touched or not is_in):
            elastic.reset()
            return False
        if not is_in:
            self._stop(pose)
            return True
        if not elastic.is_accurate:
            self.contacts.status[0] = NOT_CERTIFIED
        self._refuse_flat(pose)
        return True

    def _settles(self, pose: Array, close: float = _AT_REST) -> bool:
        """Bring the body to rest under the tool; return whether it is displaced as it may be."""
        self.elastic.settle([self._local(pose)], most=_MOST, close=close)
        return self._takes(self.elastic.displacements)

    def _takes(self, found: Array) -> bool:
        """Take displacements as far as they may go; return whether that is all of them."""
        share = _FARTHEST * self._side / max(float(np.abs(found).max()), 1e-30)
        self._shape = min(share, 1.0) * found
        self.strain = max(self.strain, _FARTHEST / max(share, 1.0))
        if share < 1.0:
            self._bent = share**2 * (self.elastic.energy - self.elastic.surface.energy)
        return share >= 1.0

    def _stop(self, pose: Array) -> None:
        """Leave the body as it was last."""
        self._stopped = 0.0
        self._press_stopped(pose)
        self._stopped = self.energy
        self.strain = _FARTHEST

    def _press_stopped(self, pose: Array) -> None:
        """Press the layer alone, with the body as it was last."""
        self._press_layer(pose)
        self.contacts.status[0] = NOT_CERTIFIED
        self._refuse_flat(pose)

    def _press_layer(self, pose: Array) -> float:
        """Press the layer alone, at a pose; return its largest strain."""
        surface = self.elastic.surface
        surface.place([self._local(pose)])
        surface.press_at(self.elastic.body.mesh.vertices + self._shape, np.zeros_like(self._shape))
        return float(surface.out.push[5])

    def _refuse_flat(self, pose: Array) -> None:
        """Where the layer is pressed too far, or loses the tool, have the contact farther out."""
        if float(self.elastic.surface.out.push[5]) > FLAT or self._is_lost(pose):
            self._held = self._end.hold(pose, self._press_layer, self.contacts)
            self.contacts.status[0] = NOT_CERTIFIED

    def _is_lost(self, pose: Array) -> bool:
        """Return whether the tool is deeper than the body has been pressed in, and its layer."""
        strain = float(self.elastic.surface.out.push[5])
        return self._end.is_lost(pose, strain, float(np.abs(self._shape).max()))

    @property
    def energy(self) -> float:
        """Stored in layer and body, and in what swings [J]."""
        surface = self.elastic.surface
        force = self._turn @ surface.state.wrench[0, :3]
        beyond = self._held.energy(force) if self._held else 0.0
        if self._stopped == math.inf:
            self._bent = self.elastic.energy - surface.energy
            beyond += self.elastic.kinetic_energy
        return surface.energy + self._bent + beyond

    def derivatives(self, motion: Any = None) -> ContactDerivatives:
        """Return stiffness, damping and, in proportion to the velocity, friction in the wrench."""
        if self._found is None and (self._held or self._stopped < math.inf):
            stiffness = self._turned(self.elastic.surface.stiffness())
            found = ContactDerivatives(stiffness, np.zeros((6, 6)), np.zeros(6))
            self._found = self._held.derivatives(found, self._force) if self._held else found
        elif self._found is None:
            stiffness, damping = map(self._turned, self.elastic.derivatives())
            twist = self.elastic.surface.twists[0].reshape(2, 3) @ self._turn.T
            self._found = ContactDerivatives(stiffness, damping, -damping @ twist.ravel())
        return self._found

    def _turned(self, matrix: Array) -> Array:
        """Return a matrix (6, 6) of the body's frame in world axes."""
        return np.asarray(self._both @ matrix @ self._both.T)

    def stiffness(self) -> Array:
        """Return the stiffness (6, 6) at the last pose."""
        return self.derivatives().stiffness

"""Contact of a rigid tool with an elastic body, with the interface of `ContactSolver`."""

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
"""Largest displacement of a vertex in a step [m]: that of a tool at 10 m/s in 1 ms; a faster one
has been placed elsewhere."""
_MOST = 60
"""Maximum number of Newton steps to static equilibrium."""
_AT_REST, _BROUGHT_IN = 1e-9, 1e-4
"""Tolerances of displacements, over the thickness of the layer: in equilibrium, and while a tool is
brought in."""
_FARTHEST = 0.5
"""Largest displacement, over the smallest side of the body; a project default."""
_FASTEST = 2.0
"""Speed above which the tool of a step without solution has been placed elsewhere [m/s]."""


class ElasticEngine:
    """Contact of a scene's tool with its elastic body, which has a state.

    It has the methods that `ToolContact` needs of a `ContactSolver`. At the first pose after
    `reset`, and at each with `dt` 0, the body is in static equilibrium; every other pose advances
    it by `dt`. Its only contact is the sum of all taxels: at the centre of pressure, with the
    largest compression of the layer as its depth.

    A linear body could be pressed flat or inverted. So its displacements are limited to half of its
    smallest side: there the body is frozen, and only the layer deforms; such contacts are not
    certified. The body is released once the energy of the layer is less than at that moment. If the
    layer would be pressed flat as well, see `LayerEnd`. A tool placed deep inside is brought in
    from outside.
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
        """Grid of the fields."""
        return TaxelGrid(self.elastic.surface.surface)

    @cached_property
    def skin(self) -> SeenFromAbove:
        """The fields of the last pose, projected along z."""
        return SeenFromAbove(self.elastic.surface, self.grid)

    def reset(self) -> None:
        """Reset the body to rest, without contact."""
        self.elastic.reset()
        self._is_new, self._frozen, self._bent = True, math.inf, 0.0
        self.strain = 0.0
        """Largest displacement since `reset`, over the smallest side of the body."""
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
        # Friction on the tool is opposite to that on the surface.
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
        """Update the body for the tool at a pose."""
        elastic = self.elastic
        if self._frozen < math.inf:
            self._press_frozen(pose)
            if self.energy >= self._frozen:
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
                self._freeze(pose)
                return
        self._frozen = math.inf
        self._limit_strain(pose)

    def _steps(self, pose: Array, dt: float) -> bool:
        """Advance the body by a step; return False if static equilibrium has to be found again."""
        elastic = self.elastic
        moved = math.dist(pose[:3].tolist(), self._last[:3].tolist())
        try:
            elastic.step([self._local(pose)], dt)
            is_in = self._limit(elastic.displacements) and not self._is_lost(pose)
        except AsperityError:
            is_in = False
        is_touched = elastic.surface.out.push[0] > 0.0
        if moved > (_LEAP if is_in and is_touched else _FASTEST * dt) and (is_touched or not is_in):
            elastic.reset()
            return False
        if not is_in:
            self._freeze(pose)
            return True
        if not elastic.is_accurate:
            self.contacts.status[0] = NOT_CERTIFIED
        self._limit_strain(pose)
        return True

    def _settles(self, pose: Array, close: float = _AT_REST) -> bool:
        """Find static equilibrium under the tool; return whether displacements are in range."""
        self.elastic.settle([self._local(pose)], most=_MOST, close=close)
        return self._limit(self.elastic.displacements)

    def _limit(self, found: Array) -> bool:
        """Store displacements, scaled down to their limit; return whether they are within it."""
        share = _FARTHEST * self._side / max(float(np.abs(found).max()), 1e-30)
        self._shape = min(share, 1.0) * found
        self.strain = max(self.strain, _FARTHEST / max(share, 1.0))
        if share < 1.0:
            self._bent = share**2 * (self.elastic.energy - self.elastic.surface.energy)
        return share >= 1.0

    def _freeze(self, pose: Array) -> None:
        """Freeze the body in its last state."""
        self._frozen = 0.0
        self._press_frozen(pose)
        self._frozen = self.energy
        self.strain = _FARTHEST

    def _press_frozen(self, pose: Array) -> None:
        """Compute the contact of the layer alone, with the body frozen."""
        self._press_layer(pose)
        self.contacts.status[0] = NOT_CERTIFIED
        self._limit_strain(pose)

    def _press_layer(self, pose: Array) -> float:
        """Compute the contact of the layer alone at a pose; return its largest strain."""
        surface = self.elastic.surface
        surface.place([self._local(pose)])
        surface.press_at(self.elastic.body.mesh.vertices + self._shape, np.zeros_like(self._shape))
        return float(surface.out.push[5])

    def _limit_strain(self, pose: Array) -> None:
        """If the layer is pressed too far, or loses the tool, use a contact farther out."""
        if float(self.elastic.surface.out.push[5]) > FLAT or self._is_lost(pose):
            self._held = self._end.hold(pose, self._press_layer, self.contacts)
            self.contacts.status[0] = NOT_CERTIFIED

    def _is_lost(self, pose: Array) -> bool:
        """Return whether the tool is deeper than the displacement of the body plus its layer."""
        strain = float(self.elastic.surface.out.push[5])
        return self._end.is_lost(pose, strain, float(np.abs(self._shape).max()))

    @property
    def energy(self) -> float:
        """Energy stored in layer and body, and kinetic energy of the modes [J]."""
        surface = self.elastic.surface
        force = self._turn @ surface.state.wrench[0, :3]
        beyond = self._held.energy(force) if self._held else 0.0
        if self._frozen == math.inf:
            self._bent = self.elastic.energy - surface.energy
            beyond += self.elastic.kinetic_energy
        return surface.energy + self._bent + beyond

    def derivatives(self, motion: Any = None) -> ContactDerivatives:
        """Return stiffness, damping and, in proportion to the velocity, friction in the wrench."""
        if self._found is None and (self._held or self._frozen < math.inf):
            stiffness = self._to_world(self.elastic.surface.stiffness())
            found = ContactDerivatives(stiffness, np.zeros((6, 6)), np.zeros(6))
            self._found = self._held.derivatives(found, self._force) if self._held else found
        elif self._found is None:
            stiffness, damping = map(self._to_world, self.elastic.derivatives())
            twist = self.elastic.surface.twists[0].reshape(2, 3) @ self._turn.T
            self._found = ContactDerivatives(stiffness, damping, -damping @ twist.ravel())
        return self._found

    def _to_world(self, matrix: Array) -> Array:
        """Return a matrix (6, 6) of the body's frame, rotated to world axes."""
        return np.asarray(self._both @ matrix @ self._both.T)

    def stiffness(self) -> Array:
        """Return the stiffness (6, 6) at the last pose."""
        return self.derivatives().stiffness

"""Contact of a rigid tool with an elastic body, in the place of `ContactSolver`."""

from __future__ import annotations

import math
from functools import cached_property
from typing import Any

import mujoco
import numpy as np

from asperity._core.arrays import Array
from asperity.contact.contacts import empty_contacts
from asperity.contact.deformable.elastic_solid import ElasticSolid
from asperity.contact.deformable.seen_from_above import SeenFromAbove, TaxelGrid
from asperity.contact.response.stiffness import ContactDerivatives
from asperity.errors import AsperityError
from asperity.geometry.poses import rotation_of
from asperity.scene.scene import Scene
from asperity.simulation.summed_contact import fill_summed

_LEAP = 0.01
"""Largest way of a vertex in a step [m]: that of a tool at 10 m/s in 1 ms, beyond which it has been
placed elsewhere."""
_MOST = 60
"""Newton steps in which the body has to come to rest."""
_FARTHEST = 0.5
"""Largest displacement, over the smallest side of the body; a project default."""
_NOT_CERTIFIED = 1
"""Status of a contact whose displacements are not those of the body."""


class ElasticEngine:
    """Contact of a scene's tool with its elastic body, which has a state.

    It has what `ToolContact` asks of a `ContactSolver`. The first pose after `reset`, and each with
    `dt` 0, finds the body at rest under the tool; every other pose advances it by `dt`. Its
    contact, where there is one, is the sum of all taxels: at the centre of pressure, with the
    largest compression of the layer as its depth.

    A linear body would be pressed flat, and turn inside out. So where it would be displaced by more
    than half of its smallest side it stays as it is there, and the layer alone yields: the force
    goes on, and such contacts are not certified. The body moves again once the tool presses the
    layer less than it did then.
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
        self._is_new, self._stopped = True, math.inf
        self.strain = 0.0
        """Largest displacement since, over the smallest side of the body."""
        self._shape = np.zeros_like(self.elastic.body.mesh.vertices)
        self._found: ContactDerivatives | None = None
        self.contacts.count[:] = 0

    def change(self, settings: Any) -> None:
        """Ignore new settings of the force: an elastic body has its own properties."""

    @property
    def displacements(self) -> Array:
        """Of the vertices of the surface [m], in the frame of the body, (v, 3)."""
        return self._shape

    def wrench(self, pose: Array, dt: float, seconds: float = math.inf) -> Array:
        """Return the wrench at a pose; see `ContactSolver.wrench`."""
        local = np.zeros(7)
        local[:3] = (pose[:3] - self._home) @ self._turn
        mujoco.mju_mulQuat(local[3:], self._back, pose[3:])
        if dt == 0.0:
            self.reset()
        self._found = None
        self._move(local, dt)
        self._is_new = dt == 0.0
        surface, contacts = self.elastic.surface, self.contacts
        wrench = (surface.wrenches[0].reshape(2, 3) @ self._turn.T).ravel()
        # The tool feels the surface's friction the other way.
        friction = -(self._turn @ surface.out.damped[:3])
        if fill_summed(contacts, surface.out.push, wrench[:3], friction):
            contacts.point[0] = self._turn @ contacts.point[0] + self._home
        return np.asarray(wrench)

    def _move(self, pose: Array, dt: float) -> None:
        """Bring the body to where it is with the tool at a pose in its frame."""
        elastic = self.elastic
        if self._stopped < math.inf:
            self._press_stopped(pose)
            if elastic.surface.energy >= self._stopped:
                return
        try:
            if self._is_new or self._stopped < math.inf:
                elastic.settle([pose], most=_MOST)
            else:
                elastic.step([pose], dt)
            found = elastic.displacements
            share = _FARTHEST * self._side / max(float(np.abs(found).max()), 1e-30)
        except AsperityError:
            found, share = self._shape, 0.0
        self._shape = found if share == 0.0 else min(share, 1.0) * found
        if share >= 1.0:
            self._stopped = math.inf
            self.contacts.status[0] = 0 if elastic.is_accurate else _NOT_CERTIFIED
            self.strain = max(self.strain, _FARTHEST / share)
        else:
            self._press_stopped(pose)
            self._stopped = min(self._stopped, elastic.surface.energy)
            self.strain = _FARTHEST

    def _press_stopped(self, pose: Array) -> None:
        """Press the layer alone, with the body as it was last."""
        surface = self.elastic.surface
        surface.place([pose])
        surface.press_at(self.elastic.body.mesh.vertices + self._shape, np.zeros_like(self._shape))
        self.contacts.status[0] = _NOT_CERTIFIED

    @property
    def energy(self) -> float:
        """Stored in layer and body, and in what swings [J]."""
        if self._stopped < math.inf:
            return self.elastic.surface.energy
        return self.elastic.energy + self.elastic.kinetic_energy

    def derivatives(self, motion: Any = None) -> ContactDerivatives:
        """Return stiffness, damping and, in proportion to the velocity, friction in the wrench."""
        if self._found is None and self._stopped < math.inf:
            stiffness = self._turned(self.elastic.surface.stiffness())
            self._found = ContactDerivatives(stiffness, np.zeros((6, 6)), np.zeros(6))
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

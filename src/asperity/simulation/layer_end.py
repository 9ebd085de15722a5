"""Where a soft layer ends: a tool that is deeper in a soft body than its layer can be pressed.

Taxels know a tool up to twice the layer's thickness, and a layer that is pressed by more than it is
thick is none. Such a pose has the contact of the place, on the shortest way out of the smooth
bodies, at which the layer is just pressed flat, and from there its wrench grows by as much for each
thickness: a choice of this package, that a tool is pushed out from wherever it is.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import mujoco
import numpy as np

from asperity._core.arrays import Array
from asperity.contact.broad_phase.mujoco_pairs import touchable
from asperity.contact.contacts import Contacts
from asperity.contact.response.stiffness import ContactDerivatives
from asperity.geometry.poses import mean_twist
from asperity.scene.scene import Scene

FLAT = 0.975
"""Largest compression of a layer, over its thickness: where its law goes on along a tangent."""
_FAR = 1.0
"""Distances are searched up to this one [m]."""
_STEP = 0.5
"""Length of the steps in which a tool is brought in, over the layer's thickness."""
_NOT_FELT = 0.25
"""How deep a tool may be that no taxel feels, over the layer's thickness: convex pieces of a mesh
fill more than the mesh."""
_FOLLOWED = 0.1
"""Those in which a body follows a tool: with long ones it may find another state of rest."""
_CLOSE = 1e-5
"""Largest difference of a strain from `FLAT`."""
_HALVINGS, _TURNS = 20, 16


class Overlap(NamedTuple):
    """How deep a tool is in what it meets, both smooth."""

    depth: float
    """How far it has to move [m]; below 0: how far it is away."""
    normal: Array
    """The way out, a unit vector of the world (3,); 0 where it is outside."""


class HeldContact(NamedTuple):
    """A contact that is that of a place farther out, and grows from there."""

    way: float
    """How far out [m]."""
    normal: Array
    """The way there, (3,)."""
    thickness: float
    """Of the layer [m]: the wrench grows by that of the place for each of it."""

    @property
    def growth(self) -> float:
        """The wrench, over that of the place."""
        return 1.0 + self.way / self.thickness

    def energy(self, force: Array) -> float:
        """Return what the force (3,) of the place and its growth store along the way [J]."""
        return self.way * (1.0 + 0.5 * self.way / self.thickness) * float(force @ self.normal)

    def derivatives(self, found: ContactDerivatives, force: Array) -> ContactDerivatives:
        """Return derivatives of the contact, from those of the place and its force (3,)."""
        rise = float(self.normal @ found.stiffness[:3, :3] @ self.normal)
        slope = float(force @ self.normal) / self.thickness
        share = slope / rise if slope > 0.0 and rise > slope else 1.0
        return ContactDerivatives(
            share * found.stiffness, self.growth * found.damping, self.growth * found.damped
        )


class LayerEnd:
    """Where the soft layer of a scene ends.

    Parameters
    ----------
    scene : Scene
        With a soft body.
    thickness : float
        Of its layer [m].
    """

    def __init__(self, scene: Scene, thickness: float) -> None:
        model = scene.model
        self._model, self._data = model, mujoco.MjData(model)
        mujoco.mj_kinematics(model, self._data)
        names = {body.name for body in scene.bodies}
        found = [(i, name) for i, name in touchable(model) if name in names]
        self._pairs = [
            (i, j) for i, one in found for j, two in found if one == scene.tool != two
        ]  # fmt: skip
        joint = int(model.body_jntadr[model.body(scene.tool).id])
        first = int(model.jnt_qposadr[joint])
        self._place = self._data.qpos[first : first + 7]
        own = [i for i, name in found if name == scene.tool]
        reach = np.linalg.norm(model.geom_pos[own], axis=1) + model.geom_rbound[own]
        self._radius = float(reach.max())
        self.thickness = thickness
        tops = [np.abs(field.coefficients).max() for body in scene.bodies for field in body.fields]
        self._tops = float(sum(tops))  # so deep it may lie in pores
        self.reset()

    def reset(self) -> None:
        """Forget the last pose."""
        self._known: tuple[Array, float] | None = None
        self._guess = 0.0

    def overlap(self, pose: Array) -> Overlap:
        """Return how deep the smooth tool is in the smooth bodies at a pose (7,)."""
        self._place[:] = pose
        mujoco.mj_kinematics(self._model, self._data)
        least, ends, way = _FAR, np.zeros(6), np.zeros(3)
        for one, two in self._pairs:
            most = max(least, 0.0)
            away = mujoco.mj_geomDistance(self._model, self._data, one, two, most, ends)
            if away < least:
                least, way = away, ends[3:] - ends[:3]
        size = math.hypot(*way.tolist())
        normal = way / size if least < 0.0 and size > 0.0 else np.zeros(3)
        return Overlap(-least, normal)

    def is_lost(self, pose: Array, strain: float, aside: float = 0.0) -> bool:
        """Return whether a tool is deeper than its taxels say.

        `strain`: their largest compression, over the layer's thickness. `aside`: how far the
        surface may have been pressed away [m].
        """
        most = self._tops + aside + (self.thickness if strain > 0.0 else _NOT_FELT * self.thickness)
        if self._known is not None:
            # Not yet, if it has moved by less than is left since it was looked at.
            last, depth = self._known
            twist = mean_twist(last, pose, 1.0)
            moved = math.hypot(*twist[:3].tolist()) + self._radius * math.hypot(*twist[3:].tolist())
            if depth + moved < most:
                return False
        depth = self.overlap(pose).depth
        self._known = np.array(pose), depth
        return depth > most

    def clear(self, pose: Array) -> Overlap:
        """Return the way out of all bodies, and how long it is, a step of `thickness` more."""
        depth, normal = self.overlap(pose)
        moved, total = np.array(pose), 0.0
        for _ in range(_TURNS):
            if depth <= 0.0:
                break
            total += depth + 1e-6
            moved[:3] = pose[:3] + total * normal
            depth = self.overlap(moved).depth
        return Overlap(total + self._tops + self.thickness, normal)

    def steps(self, pose: Array) -> list[Array]:
        """Return poses (7,) that bring the tool in, from outside along the shortest way out.

        They are the same for poses along one way, so that these find the same body.
        """
        way, step = self.clear(pose), _FOLLOWED * self.thickness
        left = [*np.arange(way.depth, 0.0, -step).tolist(), 0.0]
        out = [np.array(pose) for _ in left]
        for far, place in zip(left, out, strict=True):
            place[:3] += far * way.normal
        return out

    def hold(
        self, pose: Array, press: Callable[[Array], float], contacts: Contacts
    ) -> HeldContact | None:
        """Have the contact of a pose at which the layer is pressed too far, or loses the tool.

        Parameters
        ----------
        pose : (7,)
        press : callable
            Has the contact at a pose, and returns the largest compression of the layer there, over
            its thickness; its last call is at the place whose contact counts.
        contacts : Contacts
            One is left out where there is no place at which the layer is just pressed flat.
        """
        way = self.clear(pose)
        if not way.normal.any():  # only its texture is so deep
            return HeldContact(0.0, way.normal, self.thickness)
        found, moved = self._flat_at(pose, way, press), np.array(pose)
        if found < 0.0:
            if 0.0 < press(pose) <= FLAT:  # what is felt of it is not all
                return HeldContact(0.0, way.normal, self.thickness)
            contacts.count[1] = 1
            found = way.depth
        moved[:3] += found * way.normal
        press(moved)
        return None if contacts.count[1] else HeldContact(found, way.normal, self.thickness)

    def _flat_at(self, pose: Array, way: Overlap, press: Callable[[Array], float]) -> float:
        """Return how far outside a pose the layer is just pressed flat [m]; -1 for nowhere."""
        moved, step = np.array(pose), _STEP * self.thickness

        def pressed(far: float) -> float:
            moved[:3] = pose[:3] + far * way.normal
            return press(moved)

        def is_beyond(found: float, outer: float) -> bool:
            # A small tool that is deeper than the layer is lost, and not pressed further.
            return found > FLAT or found == 0.0 < outer

        low, high = max(self._guess - step, 0.0), self._guess + step  # near the last one first
        at_low, at_high = pressed(low), pressed(high)
        if not 0.0 < at_high <= FLAT or not is_beyond(at_low, at_high):
            low, at_low, at_high = way.depth, pressed(way.depth), 0.0
            while not is_beyond(at_low, at_high):
                if low == 0.0:
                    return -1.0
                high, at_high, low = low, at_low, max(low - step, 0.0)
                at_low = pressed(low)
        for turn in range(_HALVINGS):
            if at_high > FLAT - _CLOSE:
                break
            share = 0.5
            if turn % 3 < 2 and at_low > 0.0:
                share = min((at_low - FLAT + 0.5 * _CLOSE) / (at_low - at_high), 1.0)
            middle = low + share * (high - low)
            found = pressed(middle)
            if is_beyond(found, at_high):
                low, at_low = middle, found
            else:
                high, at_high = middle, found
        self._guess = high
        return high if at_high > 0.0 else -1.0

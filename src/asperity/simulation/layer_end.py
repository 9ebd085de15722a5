"""Contact beyond the range of a soft layer: a tool deeper than the layer can be compressed.

Taxels detect a tool up to twice the layer's thickness, and the layer's law holds up to its
thickness. A deeper pose has the contact of the point on the shortest way out of the smooth bodies
at which the layer is just pressed flat; from there the wrench grows by its own magnitude for each
thickness. This is a choice of this package: a tool is pushed out from anywhere.
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
"""Largest strain of a layer, from where on its law is linear."""
_FAR = 1.0
"""Largest distance that is searched [m]."""
_STEP = 0.5
"""Step of the search for a flat layer, over the layer's thickness."""
_NOT_DETECTED = 0.25
"""Depth up to which a tool may be without a compressed taxel, over the layer's thickness: convex
pieces of a mesh are larger than the mesh."""
_FOLLOWED = 0.1
"""Steps in which a tool is brought in: with longer ones another equilibrium may be found."""
_CLOSE = 1e-5
"""Tolerance of a strain of `FLAT`."""
_HALVINGS, _TURNS = 20, 16


class Overlap(NamedTuple):
    """Penetration of the smooth tool into the other smooth bodies."""

    depth: float
    """Depth [m]; negative: minus the distance."""
    normal: Array
    """Unit vector of the way out, world axes (3,); 0 outside."""


class HeldContact(NamedTuple):
    """A contact extrapolated from a pose farther out."""

    way: float
    """Distance to that pose [m]."""
    normal: Array
    """Direction to that pose, (3,)."""
    thickness: float
    """Of the layer [m]: the wrench grows by that of the pose for each thickness."""

    @property
    def growth(self) -> float:
        """The wrench over that of the pose."""
        return 1.0 + self.way / self.thickness

    def energy(self, force: Array) -> float:
        """Return the energy of the growing force along the way, `force` (3,) at its start [J]."""
        return self.way * (1.0 + 0.5 * self.way / self.thickness) * float(force @ self.normal)

    def derivatives(self, found: ContactDerivatives, force: Array) -> ContactDerivatives:
        """Return derivatives of the contact from those of the pose and its force (3,)."""
        rise = float(self.normal @ found.stiffness[:3, :3] @ self.normal)
        slope = float(force @ self.normal) / self.thickness
        share = slope / rise if slope > 0.0 and rise > slope else 1.0
        return ContactDerivatives(
            share * found.stiffness, self.growth * found.damping, self.growth * found.damped
        )


class LayerEnd:
    """Contacts beyond the range of a scene's soft layer.

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
        self._tops = float(sum(tops))  # depth of pores
        self.reset()

    def reset(self) -> None:
        """Forget the last pose."""
        self._known: tuple[Array, float] | None = None
        self._guess = 0.0

    def overlap(self, pose: Array) -> Overlap:
        """Return the penetration of the smooth tool into the smooth bodies at a pose (7,)."""
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
        """Return whether a tool is deeper than its taxels detect.

        `strain` is their largest compression over the layer's thickness, `aside` the largest
        displacement of the surface [m].
        """
        most = (
            self._tops
            + aside
            + (self.thickness if strain > 0.0 else _NOT_DETECTED * self.thickness)
        )
        if self._known is not None:
            # Not lost if it has moved by less than the remaining depth since the last query.
            last, depth = self._known
            twist = mean_twist(last, pose, 1.0)
            moved = math.hypot(*twist[:3].tolist()) + self._radius * math.hypot(*twist[3:].tolist())
            if depth + moved < most:
                return False
        depth = self.overlap(pose).depth
        self._known = np.array(pose), depth
        return depth > most

    def clear(self, pose: Array) -> Overlap:
        """Return the way out of all bodies, lengthened by `thickness` and the textures."""
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
        """Return poses (7,) that bring the tool in from outside, along the shortest way out.

        They do not depend on the depth along that way, and neither does the equilibrium found.
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
        """Compute the contact of a pose at which the layer is pressed too far, or loses the tool.

        Parameters
        ----------
        pose : (7,)
        press : callable
            Computes the contact at a pose, and returns the largest strain of the layer there; its
            last call is at the pose whose contact is used.
        contacts : Contacts
            One is dropped if there is no pose at which the layer is just pressed flat.
        """
        way = self.clear(pose)
        if not way.normal.any():  # only its texture is so deep
            return HeldContact(0.0, way.normal, self.thickness)
        found, moved = self._flat_at(pose, way, press), np.array(pose)
        if found < 0.0:
            if 0.0 < press(pose) <= FLAT:  # the taxels detect only a part of the tool
                return HeldContact(0.0, way.normal, self.thickness)
            contacts.count[1] = 1
            found = way.depth
        moved[:3] += found * way.normal
        press(moved)
        return None if contacts.count[1] else HeldContact(found, way.normal, self.thickness)

    def _flat_at(self, pose: Array, way: Overlap, press: Callable[[Array], float]) -> float:
        """Return the distance along the way at which the layer is just pressed flat, or -1 [m]."""
        moved, step = np.array(pose), _STEP * self.thickness

        def pressed(far: float) -> float:
            moved[:3] = pose[:3] + far * way.normal
            return press(moved)

        def is_beyond(found: float, outer: float) -> bool:
            # A small tool deeper than the layer is lost, and compresses no taxel.
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

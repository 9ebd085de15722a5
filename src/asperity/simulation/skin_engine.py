"""Contact of a soft tool, or a rigid tool with a soft body; interface of `ContactSolver`."""

from __future__ import annotations

import math
from typing import Any

import mujoco
import numpy as np

from asperity._core.arrays import Array
from asperity.contact.contacts import NOT_CERTIFIED, empty_contacts
from asperity.contact.response.stiffness import ContactDerivatives
from asperity.contact.soft.skin import SoftSkin
from asperity.contact.soft.skin_contact import SkinContact
from asperity.geometry.poses import mean_twist, rotation_of
from asperity.geometry.rigid_body import centre_of_mass, cross
from asperity.scene.scene import Scene
from asperity.simulation.layer_end import FLAT, HeldContact, LayerEnd
from asperity.simulation.summed_contact import fill_summed


class SkinEngine:
    """Contact of a scene's tool with its other bodies, of which one has a soft skin.

    It has the methods that `ToolContact` needs of a `ContactSolver`. Its only contact is the sum of
    all taxels: at the centre of pressure, with the largest compression as its depth. For
    compressions beyond the thickness of the layer see `LayerEnd`.
    """

    def __init__(self, scene: Scene, skin: SoftSkin) -> None:
        data = mujoco.MjData(scene.model)
        mujoco.mj_kinematics(scene.model, data)
        self._is_tool = skin.body.name == scene.tool
        met = [body for body in scene.bodies if (body.name == scene.tool) != self._is_tool]
        places = {body.name: data.body(body.name) for body in scene.bodies}
        poses = {name: np.concatenate([at.xpos, at.xquat]) for name, at in places.items()}
        self.centre = np.array(scene.model.body(scene.tool).ipos)
        self._home = poses[skin.body.name]
        self._turn = rotation_of(self._home[3:])
        self.skin = SkinContact(
            skin, met, [poses[body.name] for body in met], centre=self.centre.tolist()
        )
        """The fields of the last pose."""
        self.grid = skin
        """Grid of the fields."""
        self.contacts = empty_contacts(1)
        self.was_cut = False
        self._end = LayerEnd(scene, skin.thickness)
        self.reset()

    def reset(self) -> None:
        """Forget the last pose."""
        self._last: Array | None = None
        self._held: HeldContact | None = None
        self._force = np.zeros(3)
        self._end.reset()
        self.contacts.count[:] = 0

    def change(self, settings: Any) -> None:
        """Ignore new settings of the force: a skin has its own properties."""

    def wrench(self, pose: Array, dt: float, seconds: float = math.inf) -> Array:
        """Return the wrench at a pose; see `ContactSolver.wrench`."""
        twist = np.zeros(6)
        if dt > 0.0 and self._last is not None:
            twist = mean_twist(self._last, pose, dt)
            arm = centre_of_mass(pose, self.centre) - pose[:3]
            twist[:3] += cross(twist[3:], arm)
        if dt > 0.0:
            self._last = np.array(pose)
        wrench, contacts = self._pressed(pose, twist), self.contacts
        self._held, contacts.count[1], contacts.status[0] = None, 0, 0
        strain = float(self.skin.out.push[5])
        if strain > FLAT or self._end.is_lost(pose, strain):

            def press(place: Array) -> float:
                wrench[:] = self._pressed(place, twist)
                return float(self.skin.out.push[5])

            self._held = self._end.hold(pose, press, contacts)
            contacts.status[0] = NOT_CERTIFIED
        self._force, friction = wrench[:3].copy(), self._damped[:3]
        if self._held:
            wrench *= self._held.growth
            friction = self._held.growth * friction
        if fill_summed(contacts, self.skin.out.push, wrench[:3], friction) and self._held:
            contacts.point[0] -= self._held.way * self._held.normal
        return wrench

    def _pressed(self, pose: Array, twist: Array) -> Array:
        """Return the wrench of the skin at a pose."""
        if self._is_tool:
            return self.skin.wrench(pose, twist)
        # The reaction on the tool: equal and opposite.
        self.skin.place([pose])
        centre = (centre_of_mass(pose, self.centre) - self._home[:3]) @ self._turn
        return np.asarray(-self.skin.wrench(self._home, -twist, about=centre))

    def keep(self) -> Array:
        """Return the last pose, for `restore`."""
        assert self._last is not None
        return self._last

    def restore(self, kept: Array) -> None:
        """Restore the results of an earlier pose."""
        self.wrench(kept, 0.0)

    @property
    def _damped(self) -> Array:
        """Friction in the last wrench, (6,)."""
        return self.skin.out.damped if self._is_tool else -self.skin.out.damped

    @property
    def energy(self) -> float:
        """U of the last pose [J]."""
        beyond = self._held.energy(self._force) if self._held else 0.0
        return self.skin.energy + beyond

    def derivatives(self, motion: Any = None) -> ContactDerivatives:
        """Return stiffness, damping and the friction in the last wrench."""
        out = self.skin.out
        found = ContactDerivatives(out.stiffness.copy(), out.damping.copy(), self._damped.copy())
        return self._held.derivatives(found, self._force) if self._held else found

    def stiffness(self) -> Array:
        """Return the stiffness (6, 6) at the last pose."""
        return self.derivatives().stiffness

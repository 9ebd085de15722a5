"""Contact of a soft tool, or of a rigid tool with a soft body, in the place of `ContactSolver`."""

from __future__ import annotations

import math
from typing import Any

import mujoco
import numpy as np

from asperity._core.arrays import Array
from asperity.contact.contacts import empty_contacts
from asperity.contact.response.stiffness import ContactDerivatives
from asperity.contact.soft.skin import SoftSkin
from asperity.contact.soft.skin_contact import SkinContact
from asperity.geometry.poses import mean_twist, rotation_of
from asperity.geometry.rigid_body import centre_of_mass, cross
from asperity.scene.scene import Scene
from asperity.simulation.summed_contact import fill_summed


class SkinEngine:
    """Contact of a scene's tool with its other bodies, where one of them bears a soft skin.

    It has what `ToolContact` asks of a `ContactSolver`. Its contact, where there is one, is the sum
    of all taxels: at the centre of pressure, with the largest compression as its depth.
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
        """Where they are."""
        self.contacts = empty_contacts(1)
        self.was_cut = False
        self.reset()

    def reset(self) -> None:
        """Forget the last pose."""
        self._last: Array | None = None
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
        if self._is_tool:
            wrench = self.skin.wrench(pose, twist)
        else:  # the same contact, seen from the tool: equal and opposite
            self.skin.place([pose])
            centre = (centre_of_mass(pose, self.centre) - self._home[:3]) @ self._turn
            wrench = -self.skin.wrench(self._home, -twist, about=centre)
        fill_summed(self.contacts, self.skin.out.push, wrench[:3], self._damped[:3])
        return wrench

    def keep(self) -> Array:
        """Return the last pose, for `restore`."""
        assert self._last is not None
        return self._last

    def restore(self, kept: Array) -> None:
        """Have an earlier pose for the last one."""
        self.wrench(kept, 0.0)

    @property
    def _damped(self) -> Array:
        """Friction in the last wrench, (6,)."""
        return self.skin.out.damped if self._is_tool else -self.skin.out.damped

    @property
    def energy(self) -> float:
        """U of the last pose [J]."""
        return self.skin.energy

    def derivatives(self, motion: Any = None) -> ContactDerivatives:
        """Return stiffness, damping and the friction in the last wrench."""
        out = self.skin.out
        return ContactDerivatives(out.stiffness.copy(), out.damping.copy(), self._damped.copy())

    def stiffness(self) -> Array:
        """Return the stiffness (6, 6) at the last pose."""
        return self.skin.stiffness()

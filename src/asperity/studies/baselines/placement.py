"""The bodies of a scene and their poses, as methods need them."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from asperity.geometry.bodies import Body, Geom
from asperity.geometry.poses import rotation_of
from asperity.scene.scene import Scene

Array = NDArray[np.float64]


class Standing(NamedTuple):
    """A stationary body of the scene."""

    body: Body
    rotation: Array
    """Rotation from its frame to the world, (3, 3)."""
    position: Array
    """Origin of its frame in the world [m], (3,)."""

    def relative(self, pose: Array) -> tuple[Array, Array]:
        """Return rotation (3, 3) and translation (3,) [m] from the frame at a pose into its own."""
        return (
            self.rotation.T @ rotation_of(pose[3:]),
            self.rotation.T @ (pose[:3] - self.position),
        )


class Placed(NamedTuple):
    """The tool and the stationary bodies."""

    tool: Body
    centre: Array
    """The tool's centre of mass in its frame [m], (3,)."""
    standing: tuple[Standing, ...]


def place_bodies(scene: Scene) -> Placed:
    """Return the bodies of a scene and their poses."""
    data = mujoco.MjData(scene.model)
    mujoco.mj_kinematics(scene.model, data)
    tool, others = tool_and_others(scene)
    standing = []
    for body in others:
        there = data.body(body.name)
        rotation = np.array(there.xmat, dtype=np.float64).reshape(3, 3)
        standing.append(Standing(body, rotation, np.array(there.xpos, dtype=np.float64)))
    centre = np.array(scene.model.body_ipos[scene.model.body(scene.tool).id], dtype=np.float64)
    return Placed(tool, centre, tuple(standing))


def tool_and_others(scene: Scene) -> tuple[Body, list[Body]]:
    """Return the tool of a scene, and its other bodies in their order."""
    tool = next(body for body in scene.bodies if body.name == scene.tool)
    return tool, [body for body in scene.bodies if body is not tool]


def only_one_target(scene: Scene) -> str | None:
    """Return why a method for one target body cannot render a scene, or None."""
    count = len(scene.bodies) - 1
    return None if count == 1 else f"made for one body beside the tool, this scene has {count}"


def is_level(body: Body) -> bool:
    """Return whether a body consists of boxes and planes whose tops are level in its frame."""
    return all(
        geom.kind in ("box", "plane") and abs(geom.quaternion[0]) >= 1.0 - 1e-9
        for geom in body.geoms
    )


def top_of(geom: Geom) -> float:
    """Return the height of the top of a level box or plane in its body's frame [m]."""
    return float(geom.position[2] + (geom.size[2] if geom.kind == "box" else 0.0))


def centre_at(pose: Array, centre: Array) -> Array:
    """Return the place of a tool's centre of mass in the world [m], (3,), at a pose (7,)."""
    return np.asarray(pose[:3] + rotation_of(pose[3:]) @ centre)


def without_textures(scene: Scene) -> Scene:
    """Return a scene with its smooth bodies alone."""
    return replace(scene, bodies=tuple(replace(body, texture=None) for body in scene.bodies))

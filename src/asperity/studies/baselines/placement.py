"""The bodies of a scene and their poses, as methods need them."""

from __future__ import annotations

from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from asperity.errors import AsperityError
from asperity.geometry.bodies import Body
from asperity.scene.scene import Scene

Array = NDArray[np.float64]


class Standing(NamedTuple):
    """A stationary body of the scene."""

    body: Body
    rotation: Array
    """Rotation from its frame to the world, (3, 3)."""
    position: Array
    """Origin of its frame in the world [m], (3,)."""


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
    standing, tool = [], None
    for body in scene.bodies:
        if body.name == scene.tool:
            tool = body
            continue
        there = data.body(body.name)
        rotation = np.array(there.xmat, dtype=np.float64).reshape(3, 3)
        standing.append(Standing(body, rotation, np.array(there.xpos, dtype=np.float64)))
    assert tool is not None
    centre = np.array(scene.model.body_ipos[scene.model.body(scene.tool).id], dtype=np.float64)
    return Placed(tool, centre, tuple(standing))


def only_one_target(scene: Scene) -> str | None:
    """Return why a method for one target body cannot render a scene, or None."""
    others = [body.name for body in scene.bodies if body.name != scene.tool]
    if len(others) == 1:
        return None
    return f"made for one body beside the tool, this scene has {len(others)}"


def require_renderable(reason: str | None, label: str, scene: Scene) -> None:
    """Raise `AsperityError` if there is a reason why a method cannot render a scene."""
    if reason is not None:
        raise AsperityError(f"{label} cannot render scene {scene.name!r}: {reason}")

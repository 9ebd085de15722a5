"""The ground of a scene: its level plane without texture, else what its bodies rest on."""

from __future__ import annotations

import mujoco
import numpy as np

from asperity.drawing.renderer.parts import Part, scene_parts
from asperity.geometry.poses import rotation_of
from asperity.scene.scene import Scene


def ground_height(scene: Scene) -> float | None:
    """Return the height of the ground [m]: a level plane without texture, else what all rest on.

    None if there is a plane that is not level, or has a texture: it is drawn as it is.
    """
    planes = [part for part in scene_parts(scene, scene.start) if is_plane(part)]
    if planes:
        at, pose = planes[0].body.geoms[0].position, planes[0].pose
        height = float(pose[2] + rotation_of(pose[3:])[2] @ np.asarray(at))
        return height if all(map(is_ground, planes)) else None
    model, data = scene.model, mujoco.MjData(scene.model)
    mujoco.mj_kinematics(model, data)
    tool = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, scene.tool)
    lowest = [
        float(data.geom_xpos[i, 2] + up @ box[:3] - np.abs(up) @ box[3:])
        for i, (up, box) in enumerate(
            zip(data.geom_xmat.reshape(-1, 3, 3)[:, 2], model.geom_aabb, strict=True)
        )
        if model.geom_bodyid[i] != tool
    ]
    return min(lowest, default=None)


def is_plane(part: Part) -> bool:
    """Return whether a part is a plane."""
    return part.body.mesh is None and any(g.kind == "plane" for g in part.body.geoms)


def is_ground(part: Part) -> bool:
    """Return whether a part is a level plane without texture."""
    if not is_plane(part) or part.is_tool or part.body.fields:
        return False
    geom = part.body.geoms[0]
    up = rotation_of(part.pose[3:]) @ rotation_of(np.asarray(geom.quaternion))[:, 2]
    return len(part.body.geoms) == 1 and bool(up[2] > 1.0 - 1e-6)

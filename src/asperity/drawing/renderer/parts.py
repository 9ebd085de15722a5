"""What a picture shows of a scene: its bodies by colour, where they are, and what is the tool."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from asperity.drawing.renderer.geom_grids import body_sheets
from asperity.drawing.renderer.mesh_patches import mesh_sheets
from asperity.drawing.renderer.view import Sheet, ViewBall
from asperity.geometry.bodies import Body
from asperity.geometry.poses import rotation_of
from asperity.scene.mjcf import touchable_geoms
from asperity.scene.scene import Scene

Array = NDArray[np.float64]
_GROUND, _TOOL = (0.80, 0.74, 0.63), (0.42, 0.55, 0.72)
_NOT_SAID = (0.5, 0.5, 0.5)
"""MuJoCo's colour of a geom that has none."""


@dataclass(frozen=True, eq=False)
class Part:
    """A body, or the triangles of its mesh that have one colour."""

    body: Body
    faces: NDArray[np.bool_] | None
    colour: tuple[float, ...]
    """Red, green, blue, 0 to 1."""
    pose: Array
    """(7,)."""
    is_tool: bool

    def sheets(self, view: ViewBall) -> Iterator[Sheet]:
        """Yield its displaced surface."""
        if self.body.mesh is not None:
            yield from mesh_sheets(self.body, self.pose, view, self.faces)
        else:
            yield from body_sheets(self.body, self.pose, view)


def scene_parts(scene: Scene, tool_pose: Array) -> list[Part]:
    """Return what there is to draw, the tool at a pose (7,)."""
    data = mujoco.MjData(scene.model)
    mujoco.mj_kinematics(scene.model, data)
    owned = touchable_geoms(scene.model)
    parts = []
    for body in scene.bodies:
        is_tool = body.name == scene.tool
        i = mujoco.mj_name2id(scene.model, mujoco.mjtObj.mjOBJ_BODY, body.name)
        pose = tool_pose if is_tool else np.concatenate([data.xpos[i], data.xquat[i]])
        colours = [_colour(scene.model, k, is_tool) for k, _ in owned[body.name]]
        if body.mesh is None:
            parts.append(Part(body, None, colours[0], pose, is_tool))
            continue
        nearest = _nearest_geom(body)
        for colour in dict.fromkeys(colours):
            faces = np.array([c == colour for c in colours])[nearest]
            parts.append(Part(body, faces, colour, pose, is_tool))
    return parts


def _colour(model: mujoco.MjModel, geom: int, is_tool: bool) -> tuple[float, ...]:
    """Return the colour of a geom, or ours where the scene names none."""
    material = int(model.geom_matid[geom])
    rgba = model.geom_rgba[geom] if material < 0 else model.mat_rgba[material]
    colour = tuple(round(float(value), 4) for value in rgba[:3])
    return colour if colour != _NOT_SAID else _TOOL if is_tool else _GROUND


def _nearest_geom(body: Body) -> NDArray[np.int64]:
    """Return in or nearest to which of a body's pieces each triangle of its mesh lies, (m,)."""
    assert body.mesh is not None
    middles = body.mesh.vertices[body.mesh.faces].mean(axis=1)
    away = [
        np.abs((middles - geom.position) @ rotation_of(geom.quaternion) / geom.size).max(axis=1)
        for geom in body.geoms
    ]
    return np.argmin(away, axis=0)

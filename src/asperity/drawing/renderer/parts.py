"""The bodies of a scene as a picture shows them: by colour, at their poses."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from asperity.contact.deformable.bent_shape import BentShape
from asperity.contact.deformable.surface import DeformableSurface
from asperity.geometry.bodies import Body
from asperity.geometry.displaced.geoms import body_sheets
from asperity.geometry.displaced.sheet import Sheet
from asperity.geometry.displaced.view import ViewBall
from asperity.geometry.poses import rotation_of
from asperity.scene.mjcf import touchable_geoms
from asperity.scene.scene import Scene

Array = NDArray[np.float64]
GROUND_COLOUR, TOOL_COLOUR = (0.80, 0.74, 0.63), (0.42, 0.55, 0.72)
"""Colours of bodies for which the scene gives none."""
_MUJOCO_DEFAULT = (0.5, 0.5, 0.5)
"""MuJoCo's colour of a geom for which the scene gives none."""


@dataclass(frozen=True, eq=False)
class Part:
    """A body, or the triangles of its mesh that have one colour."""

    body: Body
    faces: NDArray[np.bool_] | None
    """Triangles of the mesh, (m,); None: the whole body."""
    colour: tuple[float, ...]
    """Red, green, blue, 0 to 1."""
    pose: Array
    """Of the body's frame, (7,)."""
    is_tool: bool
    bent: tuple[DeformableSurface, Array] | None = None
    """Of an elastic body: its surface, and the displacements of its vertices (v, 3) [m]."""

    def sheets(self, view: ViewBall) -> Iterator[Sheet]:
        """Yield its displaced surface."""
        for sheet in body_sheets(self.body, self.pose, view, self.faces):
            if self.bent is None:
                yield sheet
                continue
            shape, (surface, displacements) = sheet.points.shape, self.bent
            flat = (part.reshape(-1, 3) for part in (sheet.points, sheet.normals))
            moved = BentShape(surface, self.pose, *flat).moved(displacements)
            points, normals = (part.reshape(shape) for part in moved)
            yield sheet._replace(points=points, normals=normals)


def scene_parts(scene: Scene, tool_pose: Array, bent: Array | None = None) -> list[Part]:
    """Return the parts of a scene with the tool at a pose (7,).

    `bent` are the displacements of the vertices of its elastic body (v, 3) [m], if there is one.
    """
    data = mujoco.MjData(scene.model)
    mujoco.mj_kinematics(scene.model, data)
    owned = touchable_geoms(scene.model)
    parts = []
    for body in scene.bodies:
        is_tool = body.name == scene.tool
        i = mujoco.mj_name2id(scene.model, mujoco.mjtObj.mjOBJ_BODY, body.name)
        pose = tool_pose if is_tool else np.concatenate([data.xpos[i], data.xquat[i]])
        colours = [_colour(scene.model, k, is_tool) for k, _ in owned[body.name]]
        solid = scene.elastic
        shape = None
        if solid is not None and bent is not None and solid.body.name == body.name:
            shape = solid.surface, bent
        if body.mesh is None:
            parts += [Part(one, None, colours[0], pose, is_tool, shape) for one in body.parts]
            continue
        nearest = _nearest_geom(body)
        for colour in dict.fromkeys(colours):
            faces = np.array([c == colour for c in colours])[nearest]
            parts.append(Part(body, faces, colour, pose, is_tool, shape))
    return parts


def _colour(model: mujoco.MjModel, geom: int, is_tool: bool) -> tuple[float, ...]:
    """Return the colour of a geom, or a default where the scene gives none."""
    colour = tuple(round(value, 4) for value in geom_rgba(model, geom)[:3])
    return colour if colour != _MUJOCO_DEFAULT else TOOL_COLOUR if is_tool else GROUND_COLOUR


def geom_rgba(model: mujoco.MjModel, geom: int) -> tuple[float, ...]:
    """Return red, green, blue and opacity of a geom, or of its material if it has one."""
    material = int(model.geom_matid[geom])
    rgba = model.geom_rgba[geom] if material < 0 else model.mat_rgba[material]
    return tuple(float(value) for value in rgba)


def _nearest_geom(body: Body) -> NDArray[np.int64]:
    """Return the convex piece that contains, or is nearest to, each triangle of the mesh, (m,)."""
    assert body.mesh is not None
    middles = body.mesh.vertices[body.mesh.faces].mean(axis=1)
    away = [
        np.abs((middles - geom.position) @ rotation_of(geom.quaternion) / geom.size).max(axis=1)
        for geom in body.geoms
    ]
    return np.argmin(away, axis=0)

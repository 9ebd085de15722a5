"""A picture of the tool on the scene at one moment: close to the contact, and as a whole.

The tool is drawn where it touches: raised by its depth. Penetration stands for force here, not
for a place where a stiff tool could be.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from asperity.contact.flat import rotation_of
from asperity.geometry.bodies import Body
from asperity.picture.render import Camera, Lamp, camera_at, halved, look, shade
from asperity.picture.sheets import body_sheets
from asperity.picture.view import Sheet, View
from asperity.scene import Scene

Array = NDArray[np.float64]
_GROUND, _TOOL = (0.80, 0.74, 0.63), (0.42, 0.55, 0.72)
_SHADOW = 900
"""Of the light's view [pixels]."""


@dataclass(frozen=True, eq=False)
class Moment:
    """The tool's pose (7,) and its contacts: `point`, `normal`, `force` (m, 3), `depth` (m,)."""

    time: float
    pose: Array
    point: Array
    normal: Array
    force: Array
    depth: Array

    @classmethod
    def of(cls, time: float, pose: Array, contacts: Any) -> Moment:
        """Return a copy of what the engine's `contacts` hold now."""
        n = int(contacts.count[0])
        return cls(
            time,
            pose.copy(),
            contacts.point[:n].copy(),
            contacts.normal[:n].copy(),
            contacts.force[:n].copy(),
            contacts.depth[:n].copy(),
        )

    @property
    def pushed(self) -> Array:
        """Force-weighted mean of the normals times the largest depth: how the tool is raised."""
        if not len(self.depth):
            return np.zeros(3)
        normal = (self.normal * np.maximum(self.depth, 1e-12)[:, None]).sum(axis=0)
        return np.asarray(normal / np.linalg.norm(normal) * self.depth.max())


@dataclass(frozen=True, eq=False)
class Picture:
    """An image (rows, columns, 4) and the camera that took it, in pixels of that image."""

    image: Array
    camera: Camera


def contact_width(scene: Scene, moment: Moment) -> float:
    """Return how wide a close picture should be [m]: some of the tool, and all contacts."""
    tool = next(body for body in scene.bodies if body.name == scene.tool)
    width = float(np.clip(6.0 * min(geom.smallest for geom in tool.geoms[:1]), 2e-3, 4e-2))
    if len(moment.point) > 1:
        width = max(width, 1.7 * float(np.linalg.norm(np.ptp(moment.point, axis=0))))
    return min(width, 0.2)


def close_picture(scene: Scene, moment: Moment, *, columns: int = 760, rows: int = 620) -> Picture:
    """Return the surroundings of the contact; the tool is drawn like tinted glass."""
    width = contact_width(scene, moment)
    vertical, along = _frame(moment, moment.force.sum(axis=0))
    middle = _middle(moment) + 0.17 * width * vertical
    return _picture(
        scene, moment, middle, vertical, along, width, 2 * columns, 2 * rows, glass=True,
        elevation=np.radians(27.0), azimuth=np.radians(-24.0),
    )  # fmt: skip


def whole_picture(scene: Scene, moment: Moment, *, columns: int = 380, rows: int = 620) -> Picture:
    """Return the whole tool on the scene."""
    vertical, along = _frame(moment, np.array([1.0, 0.0, 0.0]))
    tool = next(body for body in scene.bodies if body.name == scene.tool)
    corners = _corners(tool, moment)
    azimuth, elevation = float(np.radians(-35.0)), float(np.radians(22.0))
    middle = 0.5 * (corners.min(axis=0) + corners.max(axis=0))
    eye = camera_at(
        middle, vertical, along, azimuth=azimuth, elevation=elevation, width=1.0, columns=1, rows=1
    )
    spans = [float(np.ptp(corners @ axis)) for axis in (eye.right, eye.up)]
    width = 1.3 * max(spans[0], spans[1] * columns / rows, 0.3 * spans[1])
    return _picture(
        scene, moment, middle, vertical, along, width, 2 * columns, 2 * rows, glass=False,
        elevation=elevation, azimuth=azimuth,
    )  # fmt: skip


def _picture(
    scene: Scene, moment: Moment, middle: Array, vertical: Array, along: Array, width: float,
    columns: int, rows: int, *, glass: bool, elevation: float, azimuth: float,
) -> Picture:  # fmt: skip
    camera = camera_at(
        middle, vertical, along, azimuth=float(azimuth), elevation=float(elevation), width=width,
        columns=columns, rows=rows,
    )  # fmt: skip
    # Ground that runs out of the image has to reach down to its lower edge.
    radius = 0.5 * float(np.hypot(width, 0.8 * rows / columns * width / np.sin(elevation)))
    view = View(middle, radius, int(1.3 * radius / camera.pixel))
    ground, tool = _sheets(scene, moment, view)
    lamp = Lamp.over(ground + tool, camera, vertical, _SHADOW)
    below, above = look(ground, camera), look(tool, camera)
    image, over = (shade(seen, camera, lamp, (_GROUND, _TOOL)) for seen in (below, above))
    opacity = np.where(above.depth < below.depth, 1.0, 0.0)
    if glass:
        # Clear where it faces the eye, opaque at its outline.
        facing = np.clip(above.normal @ camera.towards, 0.0, 1.0)
        opacity *= 0.5 + 0.5 * (1.0 - facing) ** 2
    colour = np.where(image[..., 3:] > 0.0, image[..., :3], 1.0)
    colour += opacity[..., None] * (over[..., :3] - colour)
    image = np.dstack([colour, np.maximum(image[..., 3], opacity > 0.0)])
    small = Camera(
        camera.centre, camera.right, camera.up, camera.towards, width, columns // 2, rows // 2
    )
    return Picture(halved(image), small)


def _sheets(
    scene: Scene, moment: Moment, view: View
) -> tuple[list[tuple[int, Sheet]], list[tuple[int, Sheet]]]:
    """Return the sheets of the scene's bodies (numbered 0) and of the tool's (1)."""
    data = mujoco.MjData(scene.model)
    mujoco.mj_kinematics(scene.model, data)
    raised = moment.pose.copy()
    raised[:3] += moment.pushed
    ground, tool = [], []
    for body in scene.bodies:
        if body.name == scene.tool:
            # Also what is nearer to the eye than the ground in view: else one sees into it.
            wider = View(view.centre, 2.0 * view.radius, 2 * view.samples)
            tool += [(1, sheet) for sheet in body_sheets(body, raised, wider)]
        else:
            i = mujoco.mj_name2id(scene.model, mujoco.mjtObj.mjOBJ_BODY, body.name)
            pose = np.concatenate([data.xpos[i], data.xquat[i]])
            ground += [(0, sheet) for sheet in body_sheets(body, pose, view)]
    return ground, tool


def _frame(moment: Moment, along: Array) -> tuple[Array, Array]:
    """Return the vertical of the picture, and what runs to the right in it, like `along`."""
    pushed = moment.pushed
    size = float(np.linalg.norm(pushed))
    vertical = pushed / size if size > 0.0 else np.array([0.0, 0.0, 1.0])
    for wanted in (along, np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])):
        level = wanted - (wanted @ vertical) * vertical
        length = float(np.linalg.norm(level))
        if length > 1e-3 * float(np.linalg.norm(wanted)) > 0.0:
            break
    return vertical, level / length


def _middle(moment: Moment) -> Array:
    """Return the middle of the contacts, on the surface."""
    if not len(moment.depth):
        return moment.pose[:3]
    return np.asarray(moment.point.mean(axis=0) + moment.pushed)


def _corners(body: Body, moment: Moment) -> Array:
    """Return the corners (n, 3) of boxes round a body's geoms, where it is drawn."""
    rotation = rotation_of(moment.pose[3:])
    signs = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    corners = []
    for geom in body.geoms:
        half = np.asarray(geom.size)
        if geom.kind == "sphere":
            half = np.full(3, geom.size[0])
        elif geom.kind in ("capsule", "cylinder"):
            tip = geom.size[0] if geom.kind == "capsule" else 0.0
            half = np.array([geom.size[0], geom.size[0], geom.size[1] + tip])
        in_body = (signs * half) @ rotation_of(geom.quaternion).T + np.asarray(geom.position)
        corners.append(in_body @ rotation.T)
    return np.concatenate(corners) + moment.pose[:3] + moment.pushed

"""Pictures of the tool on the scene at one instant: close to the contact, and as a whole.

The tool is drawn touching the surface, raised by its penetration depth: penetration represents
force here, not a position that a stiff tool could have.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from asperity.drawing.renderer.parts import Part, scene_parts
from asperity.drawing.renderer.render import Lamp, camera_at, halved, hollows, look, shade
from asperity.geometry.bodies import Body
from asperity.geometry.displaced.sheet import Sheet
from asperity.geometry.displaced.view import Camera, ViewBall
from asperity.geometry.poses import rotation_of
from asperity.scene.scene import Scene

Array = NDArray[np.float64]
_ONE_PLACE = 1e-6
"""Contacts closer than about this are drawn as one [m]."""
_SHADOW = 900
"""Size of the lamp's image for shadows [pixels]."""
_SHADOW_COARSER = 3
"""Factor on the spacing of surfaces that only cast shadows."""
_CLOSE = (float(np.radians(-24.0)), float(np.radians(27.0)))
"""Azimuth and elevation of the close picture [rad]."""
_AZIMUTHS = tuple(float(np.radians(angle)) for angle in (-35.0, -50.0, -62.0))
_ELEVATION = float(np.radians(22.0))
"""Elevation of the whole picture [rad]."""
_CLEAREST = 0.3
"""Opacity of the tool in the close picture where it faces the eye."""


@dataclass(frozen=True, eq=False)
class ContactMoment:
    """The tool's pose (7,) and its contacts: `point`, `normal`, `force` (m, 3), `depth` (m,)."""

    time: float
    pose: Array
    point: Array
    normal: Array
    force: Array
    depth: Array
    bent: Array | None = None
    """Displacements of the vertices of an elastic body [m], (v, 3)."""

    @classmethod
    def of(
        cls, time: float, pose: Array, contacts: Any, bent: Array | None = None
    ) -> ContactMoment:
        """Return a copy of the solver's present `contacts`; those at one point are merged."""
        n = int(contacts.count[0])
        _, first, one = np.unique(
            np.round(contacts.point[:n] / _ONE_PLACE), axis=0, return_index=True,
            return_inverse=True,
        )  # fmt: skip
        force = np.zeros((len(first), 3))
        np.add.at(force, one.reshape(-1), contacts.force[:n])
        return cls(
            time,
            pose.copy(),
            contacts.point[:n][first].copy(),
            contacts.normal[:n][first].copy(),
            force,
            contacts.depth[:n][first].copy(),
            None if bent is None else bent.copy(),
        )

    @property
    def pushed(self) -> Array:
        """Displacement that raises the tool: depth-weighted mean normal times the largest depth."""
        if not len(self.depth):
            return np.zeros(3)
        normal = (self.normal * np.maximum(self.depth, 1e-12)[:, None]).sum(axis=0)
        return np.asarray(normal / np.linalg.norm(normal) * self.depth.max())


@dataclass(frozen=True, eq=False)
class Picture:
    """An image (rows, columns, 4) and its camera, in pixels of that image."""

    image: Array
    camera: Camera


def contact_width(scene: Scene, moment: ContactMoment) -> float:
    """Return the width of a close picture [m]: part of the tool, and all contacts."""
    tool = _tool(scene)
    if tool.mesh is None:
        width = float(np.clip(6.0 * min(geom.smallest for geom in tool.geoms[:1]), 2e-3, 4e-2))
    else:
        width = float(np.clip(0.3 * np.ptp(tool.mesh.vertices, axis=0).max(), 2e-3, 3.5e-2))
    if len(moment.point) > 1:
        width = max(width, 1.7 * float(np.linalg.norm(np.ptp(moment.point, axis=0))))
    return min(width, 0.2)


def _tool(scene: Scene) -> Body:
    return next(body for body in scene.bodies if body.name == scene.tool)


def close_picture(
    scene: Scene, moment: ContactMoment, *, columns: int = 760, rows: int = 620
) -> Picture:
    """Return a picture of the contact; the tool is drawn like tinted glass."""
    width = contact_width(scene, moment)
    vertical, along = _frame(moment, moment.force.sum(axis=0))
    camera = camera_at(
        _middle(moment) + 0.17 * width * vertical, vertical, along, width=width,
        azimuth=_CLOSE[0], elevation=_CLOSE[1], columns=2 * columns, rows=2 * rows,
    )  # fmt: skip
    return picture_from(scene, moment, camera, vertical, glass=True)


def whole_picture(
    scene: Scene, moment: ContactMoment, *, columns: int = 380, rows: int = 620
) -> Picture:
    """Return a picture of the whole tool on the scene, from the side where it fits best."""
    vertical, along = _frame(moment, np.array([1.0, 0.0, 0.0]))
    corners = _corners(_tool(scene), moment)
    middle = 0.5 * (corners.min(axis=0) + corners.max(axis=0))
    widths = []
    for azimuth in _AZIMUTHS:
        eye = camera_at(
            middle, vertical, along, azimuth=azimuth, elevation=_ELEVATION, width=1.0,
            columns=1, rows=1,
        )  # fmt: skip
        spans = [float(np.ptp(corners @ axis)) for axis in (eye.right, eye.up)]
        widths.append(1.3 * max(spans[0], spans[1] * columns / rows, 0.3 * spans[1]))
    best = int(np.argmin(np.array(widths) * [1.0, *[1.1] * (len(widths) - 1)]))
    # Of a small tool, wide enough for the frame round the close picture.
    width = max(widths[best], 1.5 * contact_width(scene, moment))
    camera = camera_at(
        middle, vertical, along, azimuth=_AZIMUTHS[best], elevation=_ELEVATION,
        width=width, columns=2 * columns, rows=2 * rows,
    )  # fmt: skip
    return picture_from(scene, moment, camera, vertical, glass=False)


def picture_from(
    scene: Scene, moment: ContactMoment, camera: Camera, vertical: Array, *, glass: bool
) -> Picture:
    """Render a scene at one moment as a camera sees it.

    Parameters
    ----------
    scene : Scene
    moment : ContactMoment
        Pose of the tool, and its contacts. The tool is drawn raised by its depth.
    camera : Camera
        With an even number of rows and columns; the picture has half as many.
    vertical : (3,) array
        Unit vector that points up in the picture; the light comes from above.
    glass : bool
        Whether the tool is drawn translucent.
    """
    # Level ground must fill the image.
    tall = camera.rows * camera.pixel / max(float(camera.towards @ vertical), 0.1)
    radius = 0.5 * float(np.hypot(camera.width, tall))
    view = ViewBall(camera.centre, radius, int(radius / camera.pixel), camera)
    raised = moment.pose.copy()
    raised[:3] += moment.pushed
    parts = scene_parts(scene, raised, moment.bent)
    ground, tool = (_sheets(parts, view, is_tool=which) for which in (False, True))
    colours = [part.colour for part in parts]
    below, above = look(ground, camera), look(tool, camera)
    rough = view._replace(samples=view.samples // _SHADOW_COARSER)
    lamps = _lamps(parts, rough, camera, vertical)
    hollow = hollows(below, camera)
    image = shade(below, camera, lamps[0], colours, hollow)
    over = shade(above, camera, lamps[0], colours)
    opacity = np.where(above.depth < below.depth, 1.0, 0.0)
    if glass:
        # The tool's shadow is light; the tool is clear where it faces the eye, opaque at its rim.
        image = 0.35 * image + 0.65 * shade(below, camera, lamps[1], colours, hollow)
        facing = np.clip(above.normal @ camera.towards, 0.0, 1.0)
        opacity *= _CLEAREST + (1.0 - _CLEAREST) * (1.0 - facing) ** 2
    colour = np.where(image[..., 3:] > 0.0, image[..., :3], 1.0)
    colour += opacity[..., None] * (over[..., :3] - colour)
    image = np.dstack([colour, np.maximum(image[..., 3], opacity > 0.0)])
    small = replace(camera, columns=camera.columns // 2, rows=camera.rows // 2)
    return Picture(halved(image), small)


def _sheets(parts: list[Part], view: ViewBall, *, is_tool: bool) -> list[tuple[int, Sheet]]:
    """Return the sheets of the tool or of everything else, with the indices of their parts."""
    sheets = []
    for number, part in enumerate(parts):
        if part.is_tool != is_tool:
            continue
        wide = view
        if is_tool and part.body.mesh is None:
            # Including what is nearer than the visible ground, or the eye would look into it.
            wide = view._replace(radius=2.0 * view.radius, samples=2 * view.samples)
        sheets += [(number, sheet) for sheet in part.sheets(wide)]
    return sheets


def _lamps(parts: list[Part], view: ViewBall, camera: Camera, vertical: Array) -> tuple[Lamp, Lamp]:
    """Return a lamp for which everything casts shadows, and one for which the tool does not."""
    view = view._replace(samples=max(view.samples, 60))
    ground, tool = (_sheets(parts, view, is_tool=which) for which in (False, True))
    return (
        Lamp.over(ground + tool, camera, vertical, _SHADOW),
        Lamp.over(ground, camera, vertical, _SHADOW),
    )


def _frame(moment: ContactMoment, along: Array) -> tuple[Array, Array]:
    """Return the vertical of the picture, and its horizontal direction nearest to `along`."""
    pushed = moment.pushed
    size = float(np.linalg.norm(pushed))
    vertical = pushed / size if size > 0.0 else np.array([0.0, 0.0, 1.0])
    for wanted in (along, np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])):
        level = wanted - (wanted @ vertical) * vertical
        length = float(np.linalg.norm(level))
        if length > 1e-3 * float(np.linalg.norm(wanted)) > 0.0:
            break
    return vertical, level / length


def _middle(moment: ContactMoment) -> Array:
    """Return the middle of the contacts, on the surface."""
    if not len(moment.depth):
        return moment.pose[:3]
    return np.asarray(moment.point.mean(axis=0) + moment.pushed)


def _corners(body: Body, moment: ContactMoment) -> Array:
    """Return the corners (n, 3) of a body's mesh, or of boxes around its geoms, as drawn."""
    rotation = rotation_of(moment.pose[3:])
    if body.mesh is not None:
        return body.mesh.vertices @ rotation.T + moment.pose[:3] + moment.pushed
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

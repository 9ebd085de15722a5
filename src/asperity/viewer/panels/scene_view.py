"""The 3-D scene: displaced bodies, tool and handle, contacts, forces.

Geometry is sent to the browser once; an update moves the tool and the handle and redraws a few
arrows. The view is in centimetres, because scenes are millimetres in size and the browser's camera
is made for metres.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from asperity.dynamics.virtual_coupling.settings import coupled_body
from asperity.geometry.poses import rotation_of
from asperity.realtime.servo.snapshot import Snapshot
from asperity.scene.scene import Scene
from asperity.viewer.drawables.colours import CONTACT, FORCE, HANDLE, TORQUE
from asperity.viewer.drawables.glb import glb
from asperity.viewer.drawables.shapes import TRIANGLES, Drawable, first_contact, shapes_of
from asperity.viewer.panels.panel import Frame, Panel, ViserServer
from asperity.viewer.servo_client import ServoClient

Array = NDArray[np.float64]
UNITS = 100.0
"""Units of the view per metre."""
_FORCE_LENGTH = 0.32
"""Length of the arrow of `_FULL_FORCE`, over the tool's size; project default."""
_FULL_FORCE, _FULL_TORQUE = 1.0, 0.02
"""[N], [N m]."""
_LONGEST = 2.0
"""Largest length of an arrow, over that of the full one."""
_LEAST = 0.02
"""Smallest length of an arrow that is drawn, over that of the full one."""
_GHOST_TRIANGLES = 3000
_OUTLINE = 500
"""Approximate number of points from which the tool's highest point is found."""
_VIEW = np.array([0.75, -1.0, 0.55])
"""Direction from the middle of the tool to the camera."""
_WHOLE = 16.0
"""Largest part of the tool in the initial view [units]."""
_CLOSENESS, _ASIDE = 2.3, 0.2
"""Distance of the camera, and its offset to the side, over the size of the visible part."""


class SceneView(Panel):
    """The 3-D scene, a panel without a tab.

    Parameters
    ----------
    triangles : int
        Largest number of triangles of all bodies together.
    """

    title = ""

    def __init__(self, triangles: int = TRIANGLES) -> None:
        self._triangles = triangles
        self._scene: Scene | None = None
        self._nodes: list[Any] = []
        self.shapes: list[Drawable] = []
        """The shapes that are shown."""

    def build(self, server: ViserServer, servo: ServoClient) -> None:
        """Set up light and camera, and show the scene."""
        self._server, self._servo = server, servo
        set_up_lights(server)
        self._show(servo.config.scene)

    def update(self, frame: Frame) -> None:
        """Move tool, handle and arrows to their present poses."""
        scene = self._servo.config.scene
        if scene is not self._scene:
            self._show(scene)
        snapshot = frame.snapshot
        if snapshot is None:
            return
        place(self._tool, snapshot.tool_pose)
        place(self._ghost, snapshot.handle_pose)
        self._show_stretch(snapshot)
        self._show_contacts(snapshot)
        self._show_wrench(snapshot)

    # -- what is made once ---------------------------------------------------------------------

    def _show(self, scene: Scene) -> None:
        """Show another scene."""
        for node in reversed(self._nodes):  # children before their parents
            node.remove()
        self._scene = scene
        self.shapes = shapes_of(scene, self._triangles)
        self._centre = np.array(coupled_body(scene.model, scene.tool).centre)
        tool = np.concatenate([s.vertices for s in self.shapes if s.is_tool])
        self._outline = tool[:: max(len(tool) // _OUTLINE, 1)]
        self._size = float(np.linalg.norm(np.ptp(tool, axis=0))) * UNITS
        add = self._server.scene
        self._tool = add.add_frame("/tool", show_axes=False)
        self._ghost = add.add_frame("/handle", show_axes=False)
        self._nodes = [self._tool, self._ghost]
        for shape in self.shapes:
            if len(shape.faces):
                self._add(shape, "/tool" if shape.is_tool else "/scene")
        self._add_ghost(scene)
        self._add_marks()
        self._set_camera(scene, tool)

    def _add(self, shape: Drawable, parent: str) -> None:
        self._nodes.append(add_shape(self._server, shape, parent))

    def _add_ghost(self, scene: Scene) -> None:
        """Add the handle: a smooth, translucent copy of the tool at the hand's pose."""
        for shape in shapes_of(scene.smooth(), _GHOST_TRIANGLES):
            if shape.is_tool and len(shape.faces):
                self._nodes.append(
                    self._server.scene.add_mesh_simple(
                        f"/handle/{shape.name}",
                        UNITS * shape.vertices,
                        shape.faces,
                        color=HANDLE,
                        opacity=0.22,
                        cast_shadow=False,
                        receive_shadow=False,
                    )
                )

    def _add_marks(self) -> None:
        """Add contacts, arrows and their labels, all empty."""
        add, size = self._server.scene, self._size
        none = np.zeros((0, 2, 3), np.float32)
        thick = {
            "shaft_radius": 0.008 * size, "head_radius": 0.02 * size, "head_length": 0.05 * size,
        }  # fmt: skip
        thin = {name: 0.5 * value for name, value in thick.items()}
        self._contacts = add.add_point_cloud(
            "/marks/contacts", np.zeros((0, 3), np.float32), CONTACT,
            point_size=0.014 * size, point_shape="circle", precision="float32",
        )  # fmt: skip
        self._pushes = add.add_arrows("/marks/pushes", none, CONTACT, **thin)
        self._force = add.add_arrows("/marks/force", none, FORCE, **thick)
        self._torque = add.add_arrows("/marks/torque", none, TORQUE, **thick)
        self._stretch = add.add_line_segments(
            "/marks/stretch", np.zeros((0, 2, 3), np.float32), HANDLE,
            thickness=4.0, thickness_units="screen",
        )  # fmt: skip
        self._labels = {
            name: add.add_label(f"/marks/{name}-label", "", anchor="bottom-left", visible=False)
            for name in ("force", "torque")
        }
        self._nodes += [
            self._contacts, self._pushes, self._force, self._torque, self._stretch,
            *self._labels.values(),
        ]  # fmt: skip

    def _set_camera(self, scene: Scene, tool: Array) -> None:
        """Look at the tool's initial pose from the front and above."""
        placed = tool @ rotation_of(scene.start[3:]).T + scene.start[:3]
        low, high = placed.min(axis=0), placed.max(axis=0)
        # Of a long tool, show the part that makes contact.
        lowest = first_contact(scene)
        share = min(_WHOLE / self._size, 1.0)
        middle = UNITS * (lowest + share * (0.5 * (low + high) - lowest))
        middle[2] = UNITS * low[2] + 0.4 * share * UNITS * (high[2] - low[2])
        size = share * self._size
        towards = _VIEW / np.linalg.norm(_VIEW)
        # The panels cover the right of the page.
        right = np.cross([0.0, 0.0, 1.0], towards)
        middle += _ASIDE * size * right / np.linalg.norm(right)
        eye = middle + _CLOSENESS * size * towards
        first = self._server.initial_camera
        first.position, first.look_at, first.up = tuple(eye), tuple(middle), (0.0, 0.0, 1.0)
        first.fov = np.radians(35.0)
        first.near, first.far = 0.02 * self._size, 100.0 * self._size
        for client in self._server.get_clients().values():
            client.camera.position, client.camera.look_at = tuple(eye), tuple(middle)

    # -- what moves ----------------------------------------------------------------------------

    def _show_stretch(self, snapshot: Snapshot) -> None:
        """Connect the centres of mass of the tool and of the handle."""
        ends = np.array(
            [
                UNITS * (pose[:3] + rotation_of(pose[3:]) @ self._centre)
                for pose in (snapshot.tool_pose, snapshot.handle_pose)
            ]
        )
        apart = float(np.linalg.norm(ends[1] - ends[0]))
        self._ghost.visible = apart > 1e-6 or bool(
            np.abs(snapshot.tool_pose[3:] - snapshot.handle_pose[3:]).max() > 1e-6
        )
        self._stretch.points = ends[None].astype(np.float32)

    def _show_contacts(self, snapshot: Snapshot) -> None:
        points = (UNITS * snapshot.point).astype(np.float32)
        self._contacts.points = points
        starts = points.astype(np.float64)
        pushes = self._arrows(starts, snapshot.force, _FULL_FORCE) if len(points) else points
        self._pushes.points = pushes.reshape(-1, 2, 3)

    def _show_wrench(self, snapshot: Snapshot) -> None:
        """Show the wrench on the hand above the tool, in line with its centre of mass."""
        pose, wrench = snapshot.tool_pose, snapshot.device_wrench
        rotation = rotation_of(pose[3:])
        at = pose[:3] + rotation @ self._centre
        at[2] = pose[2] + float((self._outline @ rotation[2]).max())
        at = UNITS * at[None]
        for name, vector, full, arrows, unit in (
            ("force", wrench[:3], _FULL_FORCE, self._force, "N"),
            ("torque", wrench[3:], _FULL_TORQUE, self._torque, "mN m"),
        ):
            drawn = self._arrows(at, vector[None], full)
            arrows.points = drawn
            label = self._labels[name]
            label.visible = len(drawn) > 0
            if len(drawn):
                size = float(np.linalg.norm(vector)) * (1.0 if unit == "N" else 1e3)
                label.text = f"{size:.2f} {unit}"
                label.position = tuple(drawn[0, 1].tolist())

    def _arrows(self, at: Array, vectors: Array, full: float) -> NDArray[np.float32]:
        """Return arrows (n, 2, 3) at points (n, 3), without those that are too short to see."""
        length = np.linalg.norm(vectors, axis=1) / full
        shown = length > _LEAST
        scale = _FORCE_LENGTH * self._size / full * np.minimum(_LONGEST / length[shown], 1.0)
        ends = at[shown] + vectors[shown] * scale[:, None]
        return np.stack([at[shown], ends], axis=1).astype(np.float32)


def set_up_lights(server: ViserServer) -> None:
    """Set up light and background of a view whose z axis points upwards."""
    scene = server.scene
    scene.set_up_direction("+z")
    scene.world_axes.visible = False
    scene.set_background_image(_backdrop(), format="png")
    scene.configure_default_lights(False)
    scene.configure_environment_map("studio", environment_intensity=0.2)
    scene.add_light_hemisphere(
        "/light/sky", sky_color=(255, 255, 255), ground_color=(150, 140, 130), intensity=0.55
    )
    scene.add_light_directional(
        "/light/key", intensity=1.5, cast_shadow=True, position=(-8.0, -10.0, 22.0)
    )
    scene.add_light_directional(
        "/light/rim", color=(200, 215, 255), intensity=0.3, position=(14.0, 16.0, 8.0)
    )


def add_shape(server: ViserServer, shape: Drawable, parent: str) -> Any:
    """Add a shape under the node `parent`; return its node."""
    data = glb(
        UNITS * shape.vertices, shape.normals, shape.colours, shape.faces,
        places=shape.places, image=shape.atlas.image() if shape.atlas is not None else None,
        roughness=0.45 if shape.is_tool else 0.65, metallic=0.25 if shape.is_tool else 0.0,
    )  # fmt: skip
    return server.scene.add_glb(f"{parent}/{shape.name}", data)


def place(node: Any, pose: Array) -> None:
    """Move a node to a pose (7,)."""
    node.position = tuple((UNITS * pose[:3]).tolist())
    node.wxyz = tuple(pose[3:].tolist())


def _backdrop() -> NDArray[np.uint8]:
    """Return a light background, darker towards the bottom."""
    share = np.linspace(0.0, 1.0, 256)[:, None, None]
    top, bottom = np.array([250.0, 251.0, 253.0]), np.array([206.0, 213.0, 222.0])
    return np.broadcast_to(top + share * (bottom - top), (256, 4, 3)).astype(np.uint8)

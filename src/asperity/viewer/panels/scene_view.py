"""The 3-D scene: displaced bodies, tool and handle, contacts, forces.

Geometry is sent to the browser once; an update moves tool and handle and redraws a few arrows. The
view is in units of `stage.UNITS`, as scenes are millimetres in size and the browser's
camera is made for metres.
"""

from __future__ import annotations

from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any

import numpy as np
from numpy.typing import NDArray

from asperity.dynamics.virtual_coupling.settings import coupled_body
from asperity.geometry.poses import rotation_of
from asperity.realtime.servo.snapshot import Snapshot
from asperity.scene.scene import Scene
from asperity.viewer.drawables.colours import CONTACT, FORCE, HANDLE, TORQUE
from asperity.viewer.drawables.ground import ground_height
from asperity.viewer.drawables.shapes import TRIANGLES, Drawable, first_contact, shapes_of
from asperity.viewer.drawables.stage import (
    UNITS,
    add_ground,
    add_shape,
    add_soft_shape,
    disc,
    place,
    set_up_view,
    turn_to,
)
from asperity.viewer.motions import stroke
from asperity.viewer.panels.bent import Bent
from asperity.viewer.panels.detail import Detail
from asperity.viewer.panels.panel import Frame, Panel, ViserServer
from asperity.viewer.server.pace import step_back
from asperity.viewer.servo_client import ServoClient

Array = NDArray[np.float64]
_FORCE_LENGTH = 0.17
"""Length of the arrow of `_FULL_FORCE`, over the visible size; project default."""
_FULL_FORCE, _FULL_TORQUE = 1.0, 0.02
"""[N], [N m]."""
_LONGEST = 1.6
"""Length that arrows approach as forces grow, over that of the full one."""
_LEAST = 0.02
"""Smallest length of an arrow that is drawn, over that of the full one."""
_GHOST_TRIANGLES, _OUTLINE = 3000, 500
"""Most triangles of the handle, and about how many points the tool's highest is found from."""
_VIEW = np.array([0.75, -1.0, 0.55])
"""Direction from the middle of the tool to the camera."""
_WHOLE = 0.16 * UNITS
"""Largest part of the tool in the initial view [units]."""
_VIEW_NEAR, _NEARNESS = np.array([0.6, -1.0, 0.75]), 2.6
"""The same near the contact, and its distance over the radius of what is drawn finely."""
_REACH, _BESIDE = 0.035, 0.06
"""Radius of the detail near the contact, and what is near the line of force, over the visible size.
"""
_POINT, _POINT_NEAR = 0.014, 0.15
"""Size of a contact over the visible size, and the factor on it near the contact."""
_AWAY = 0.8
"""Way of the contact, over the radius of the detail, that a near view follows."""
_SHADOW, _DISCS, _ABOVE = 0.035, 6, 1.2e-4 * UNITS
"""Radius of the shadow at the contact over the visible size, discs in it, height above [units]."""
_CLOSENESS, _ASIDE = 2.45, 0.2
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
        self._painting: list[tuple[Drawable, Future[NDArray[np.uint8]]]] = []
        self._painter = ThreadPoolExecutor(1, "asperity-paint", initializer=step_back)
        self.detail, self._bent = Detail(), Bent()
        self._looked_at: Array = np.zeros(3)
        self._thin = False
        self.shapes: list[Drawable] = []
        """The shapes that are shown."""

    def build(self, server: ViserServer, servo: ServoClient) -> None:
        """Set up light and camera, and show the scene."""
        self._server, self._servo = server, servo
        set_up_view(server)
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
        self._marks.position = self._tool.position
        self._show_stretch(snapshot)
        self._show_contacts(snapshot)
        self._show_wrench(snapshot)
        self._show_detail(snapshot)
        self._show_painted()
        self._show_bent(scene, snapshot)

    def close(self) -> None:
        """Stop what is drawn in the background."""
        self.detail.close()
        self._bent.close()
        self._painter.shutdown(wait=False, cancel_futures=True)

    # -- zoom and colours ----------------------------------------------------------------------

    def zoom(self) -> None:
        """Zoom to the contact, where the relief is drawn finely; or back."""
        detail = self.detail
        detail.zoomed = not detail.zoomed
        if detail.zoomed:
            snapshot = self._servo.latest()
            at = (
                first_contact(self._servo.config.scene)
                if snapshot is None
                else snapshot.tool_pose[:3]
            )
            if snapshot is not None and len(snapshot.point):
                at = snapshot.point.mean(axis=0)
            self._look(at)
        else:
            self.look_from_the_start()

    def colour_by_height(self, on: bool) -> None:
        """Colour what is near the contact by height, or not."""
        self.detail.heights = on

    def look_from_the_start(self) -> None:
        """Put the cameras of all tabs where they were at first."""
        self.detail.zoomed = False
        for client in self._server.get_clients().values():
            client.camera.position, client.camera.look_at = self._eye, self._middle

    def _look(self, at: Array) -> None:
        """Look at a contact (3,) [m] from near."""
        self._looked_at = at
        towards = _VIEW_NEAR / np.linalg.norm(_VIEW_NEAR)
        right = np.cross([0.0, 0.0, 1.0], towards)
        reach = UNITS * self.detail.radius
        middle = UNITS * at + 0.3 * reach * right / np.linalg.norm(right)
        eye = middle + _NEARNESS * reach * towards
        for client in self._server.get_clients().values():
            client.camera.position, client.camera.look_at = tuple(eye), tuple(middle)

    def _show_detail(self, snapshot: Snapshot) -> None:
        """Show what has been drawn finely near the contact; have it drawn again if that moved."""
        detail = self.detail
        touches = len(snapshot.point) > 0
        if touches or detail.zoomed:
            # Without a contact, where the last one was.
            at = snapshot.point.mean(axis=0) if touches else self._looked_at
            detail.follow(self._servo.config.scene, snapshot.tool_pose, at)
            away = float(np.linalg.norm(at - self._looked_at))
            if detail.zoomed and away > _AWAY * detail.radius:
                self._look(at)
        for name in detail.gone():
            self._server.scene.remove_by_name(name)
            self._lower(name, np.zeros(3))
        for shape in detail.drawn():
            node = add_shape(self._server, shape, "/tool" if shape.is_tool else "/scene")
            if not shape.is_tool:
                up = snapshot.normal[0] if touches else np.array([0.0, 0.0, 1.0])
                self._lower(node.name, (shape.highest - shape.lowest) * up)

    def _lower(self, name: str, way: Array) -> None:
        """Lower the coarse surface under a detail, which it would cut through, by `way` [m]."""
        under = name.replace("/detail-", "/")
        for node in self._nodes:
            if node.name == under:
                node.position = tuple((-UNITS * np.asarray(way)).tolist())

    # -- what is made once ---------------------------------------------------------------------

    def _show(self, scene: Scene) -> None:
        """Show another scene."""
        for node in reversed(self._nodes):  # children before their parents
            node.remove()
        for _, job in self._painting:
            job.cancel()
        self._painting = []
        self._scene = scene
        self.shapes = shapes_of(scene, self._triangles)
        self._centre = np.array(coupled_body(scene.model, scene.tool).centre)
        tool = np.concatenate([s.vertices for s in self.shapes if s.is_tool])
        self._outline = tool[:: max(len(tool) // _OUTLINE, 1)]
        self._size = float(np.linalg.norm(np.ptp(tool, axis=0))) * UNITS
        self._seen = min(self._size, _WHOLE)
        self._thin = False
        self.detail.begin(scene, self._seen / UNITS * _REACH)
        self._bent.begin(scene, self.shapes)
        add = self._server.scene
        self._tool = add.add_frame("/tool", show_axes=False)
        self._ghost = add.add_frame("/handle", show_axes=False)
        self._nodes = [self._tool, self._ghost]
        place(self._tool, self._servo.config.first_pose)  # until the first snapshot
        self._ghost.visible = False
        for shape in self.shapes:
            if len(shape.faces):
                self._add(shape, "/tool" if shape.is_tool else "/scene")
        ground = ground_height(scene)
        if ground is not None:
            self._nodes.append(add_ground(self._server, ground, self._seen / UNITS))
        self._add_ghost([s for s in shapes_of(scene.smooth(), _GHOST_TRIANGLES) if s.is_tool])
        self._add_marks()
        self._set_camera(scene, tool)

    def _add(self, shape: Drawable, parent: str) -> None:
        """Add a shape; the image of its relief, which takes a while, follows."""
        is_bent = self._bent.bends(shape)
        self._nodes.append((add_soft_shape if is_bent else add_shape)(self._server, shape, parent))
        if shape.atlas is not None and not is_bent:
            self._painting.append((shape, self._painter.submit(shape.atlas.image)))

    def _show_painted(self) -> None:
        """Show a surface again whose image has been made ready."""
        if not self._painting or not self._painting[0][1].done():
            return
        shape, job = self._painting.pop(0)
        if not job.cancelled():
            parent = "/tool" if shape.is_tool else "/scene"
            node = add_shape(self._server, shape, parent, image=job.result())
            self._nodes = [one for one in self._nodes if one.name != node.name] + [node]

    def _show_bent(self, scene: Scene, snapshot: Snapshot) -> None:
        """Show an elastic body as the tool bends it."""
        if self._server.get_clients():
            self._bent.follow(scene, snapshot.tool_pose)
        for name, vertices in self._bent.moved().items():
            (node,) = [one for one in self._nodes if one.name == f"/scene/{name}"]
            node.vertices = (UNITS * vertices).astype(np.float32)

    def _add_ghost(self, ghost: list[Drawable]) -> None:
        """Add the handle: a smooth, translucent copy of the tool at the hand's pose."""
        for shape in ghost:
            if len(shape.faces):
                self._nodes.append(
                    self._server.scene.add_mesh_simple(
                        f"/handle/{shape.name}",
                        UNITS * shape.vertices,
                        shape.faces,
                        color=HANDLE,
                        opacity=0.4,
                        # Where it coincides with the tool, the tool is in front.
                        side="back",
                        cast_shadow=False,
                        receive_shadow=False,
                    )
                )

    def _add_marks(self) -> None:
        """Add contacts, arrows and their labels, all empty."""
        # They move with the tool: browsers draw a new place of it before new points of arrows.
        add, size = self._server.scene, self._seen
        none = np.zeros((0, 2, 3), np.float32)
        thick = {
            "shaft_radius": 0.008 * size, "head_radius": 0.02 * size, "head_length": 0.05 * size,
        }  # fmt: skip
        thin = {name: 0.5 * value for name, value in thick.items()}
        self._marks = add.add_frame("/marks", show_axes=False)
        self._contacts = add.add_point_cloud(
            "/marks/contacts", np.zeros((0, 3), np.float32), CONTACT,
            point_size=_POINT * size, point_shape="circle", precision="float32",
        )  # fmt: skip
        self._pushes = add.add_arrows("/marks/pushes", none, CONTACT, **thin)
        self._force = add.add_arrows("/marks/force", none, FORCE, **thick)
        self._torque = add.add_arrows("/marks/torque", none, TORQUE, **thick)
        self._stretch = add.add_line_segments(
            "/marks/stretch", np.zeros((0, 2, 3), np.float32), HANDLE,
            thickness=4.0, thickness_units="screen",
        )  # fmt: skip
        self._shadow = add.add_frame("/marks/shadow", show_axes=False, visible=False)
        self._nodes.append(self._shadow)
        for i in range(_DISCS):
            points, faces = disc(_SHADOW * size * (i + 1) / _DISCS)
            self._nodes.append(
                add.add_mesh_simple(
                    f"/marks/shadow/{i}", points, faces, color=(20, 20, 30), opacity=0.07,
                    side="double", flat_shading=True, cast_shadow=False, receive_shadow=False,
                )
            )  # fmt: skip
        self._labels = {
            # To two sides, so that those of short arrows do not cover each other.
            name: add.add_label(f"/marks/{name}-label", "", anchor=anchor, visible=False)
            for name, anchor in (("force", "bottom-left"), ("torque", "top-right"))
        }
        self._nodes += [
            self._marks, self._contacts, self._pushes, self._force, self._torque, self._stretch,
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
        middle[2] += 0.5 * _FORCE_LENGTH * size
        way = UNITS * stroke(scene.motion)  # in which a small tool would leave the view
        if (length := float(np.linalg.norm(way))) > 0.5 * size:
            middle, size = middle + 0.5 * way, max(size, length)
        towards = _VIEW / np.linalg.norm(_VIEW)
        # The panels cover the right of the page.
        right = np.cross([0.0, 0.0, 1.0], towards)
        middle += _ASIDE * size * right / np.linalg.norm(right)
        eye = middle + _CLOSENESS * size * towards
        self._eye, self._middle = tuple(eye), tuple(middle)
        first = self._server.initial_camera
        first.position, first.look_at, first.up = tuple(eye), tuple(middle), (0.0, 0.0, 1.0)
        first.fov = np.radians(35.0)
        first.near, first.far = 0.004 * self._size, 40.0 * self._size
        for client in self._server.get_clients().values():
            client.camera.position, client.camera.look_at = tuple(eye), tuple(middle)

    # -- what moves ----------------------------------------------------------------------------

    def _show_stretch(self, snapshot: Snapshot) -> None:
        """Connect the centres of mass of the tool and of the handle."""
        poses = (snapshot.tool_pose, snapshot.handle_pose)
        ends = np.array([pose[:3] + rotation_of(pose[3:]) @ self._centre for pose in poses])
        ends = UNITS * (ends - snapshot.tool_pose[:3])
        apart = float(np.linalg.norm(ends[1] - ends[0]))
        self._ghost.visible = bool(max(apart, np.abs(poses[0][3:] - poses[1][3:]).max()) > 1e-6)
        self._stretch.points = ends[None].astype(np.float32)

    def _show_contacts(self, snapshot: Snapshot) -> None:
        points = (UNITS * (snapshot.point - snapshot.tool_pose[:3])).astype(np.float32)
        self._shadow.visible = len(points) > 0 and not self.detail.zoomed
        if len(points):
            normal = snapshot.normal[0]
            self._shadow.position = tuple((points[0] + _ABOVE * normal).tolist())
            self._shadow.wxyz = turn_to(normal)
        self._contacts.points = points
        if self._thin != (near := self.detail.zoomed):
            self._thin = near
            size = (_POINT_NEAR if near else 1.0) * self._seen
            self._contacts.point_size = _POINT * size
            self._pushes.shaft_radius, self._pushes.head_radius = 0.004 * size, 0.01 * size
            self._pushes.head_length = 0.025 * size
        starts = points.astype(np.float64)
        pushes = self._arrows(starts, snapshot.force, _FULL_FORCE) if len(points) else points
        self._pushes.points = pushes.reshape(-1, 2, 3)

    def _show_wrench(self, snapshot: Snapshot) -> None:
        """Show the wrench on the hand above the tool, in line with its centre of mass."""
        pose, wrench = snapshot.tool_pose, snapshot.device_wrench
        rotation = rotation_of(pose[3:])
        at = pose[:3] + rotation @ self._centre
        # At the top of the tool near that line, so that the arrows stay in view and are not inside.
        outline = self._outline @ rotation.T + pose[:3]
        beside = np.linalg.norm(outline[:, :2] - at[:2], axis=1)
        near = beside < float(beside.min()) + _BESIDE * self._seen / UNITS
        at[2] = float(outline[near, 2].max())
        at = UNITS * (at - pose[:3])[None]
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
        bounded = _LONGEST * np.tanh(length[shown] / _LONGEST)
        scale = _FORCE_LENGTH * self._seen / full * bounded / length[shown]
        if self.detail.zoomed:
            scale = scale * UNITS * self.detail.radius / self._seen * 2.0
        ends = at[shown] + vectors[shown] * scale[:, None]
        return np.stack([at[shown], ends], axis=1).astype(np.float32)

"""Moving the tool with the mouse: a gizmo to drag, and canned motions.

The gizmo, which stands at the tool's centre of mass, gives the hand's target; the device
(`devices.mouse`) moves the hand there smoothly. One tab controls the tool: the first that drags it,
until it has not done so for a while, is closed, or another tab takes control with the button.
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from asperity.dynamics.virtual_coupling.settings import coupled_body
from asperity.geometry.poses import rotation_of
from asperity.scene.mjcf import is_touchable
from asperity.scene.scene import Scene
from asperity.scene.trajectory import ScriptedMotion
from asperity.viewer.drawables.stage import UNITS
from asperity.viewer.loop_health import LoopHealth
from asperity.viewer.motions import FORCES, KINDS, LENGTHS, SPEEDS, CannedMotion
from asperity.viewer.notify import attempt, from_browser, notify
from asperity.viewer.panels.panel import Frame, Panel, ViserServer
from asperity.viewer.servo_client import ServoClient

CONTROL_TIMEOUT = 5.0
"""Time without a drag after which a tab loses control of the tool [s]; project default."""


class Holder:
    """Keeps which tab controls the tool."""

    def __init__(self) -> None:
        self._client: int | None = None
        self._last = -np.inf

    def may(self, client: int | None, now: float) -> bool:
        """Return whether a tab may move the tool now; if so, it gets control."""
        if client not in (self._client, None) and now - self._last < CONTROL_TIMEOUT:
            return False
        self.take(client, now)
        return True

    def take(self, client: int | None, now: float) -> None:
        """Give control to a tab."""
        self._client, self._last = client, now

    def gone(self, client: int) -> None:
        """Take control from a tab that was closed."""
        if client == self._client:
            self._last = -np.inf


class MousePanel(Panel):
    """The gizmo and the canned motions."""

    title = "Hand"

    def __init__(self) -> None:
        self.holder = Holder()
        self.is_moving = False
        """Whether a canned motion is playing."""
        self._generation = -1
        self._dragged = -np.inf
        self._health = LoopHealth()

    def build(self, server: ViserServer, servo: ServoClient) -> None:
        """Add the gizmo and the controls."""
        self._server, self._servo = server, servo
        self._gizmo = server.scene.add_transform_controls(
            "/gizmo", scale=0.02 * UNITS, line_width=3.0, depth_test=False, opacity=0.8
        )
        self._gizmo.on_update(self._drag)
        server.on_client_disconnect(lambda client: self.holder.gone(client.client_id))
        gui = server.gui
        gui.add_markdown(
            "Drag the arrows to press and rub, the arcs to rotate. "
            "The green ghost is your hand, to which the tool is coupled."
        )
        self._take = gui.add_button("Control the tool from this tab", icon="hand-grab")
        self._take.on_click(lambda event: self.holder.take(event.client_id, time.monotonic()))
        with gui.add_folder("Canned motions"):
            motion = servo.config.scene.motion
            own = motion if isinstance(motion, ScriptedMotion) else ScriptedMotion()
            self._kind = gui.add_dropdown("motion", KINDS)
            speeds, lengths = ([1e3 * value for value in b] for b in (SPEEDS, LENGTHS))
            speed = min(max(round(1e3 * own.speed), speeds[0]), speeds[1])
            length = min(max(round(1e3 * own.length), lengths[0]), lengths[1])
            self._speed = gui.add_slider("speed [mm/s]", *speeds, 1.0, speed)
            self._length = gui.add_slider("length [mm]", *lengths, 1.0, length)
            self._direction = gui.add_slider(
                "direction [deg]", -180.0, 180.0, 1.0, round(np.degrees(own.direction))
            )
            self._force = gui.add_slider(
                "force [N]", *FORCES, 0.01, min(round(own.press_force, 2), FORCES[1])
            )
            self._start = gui.add_button("Start", icon="player-play", color="green")
            self._stop = gui.add_button("Stop", icon="player-stop", disabled=True)
        self._start.on_click(self._start_clicked)
        self._stop.on_click(self._stop_clicked)
        for control in (self._speed, self._length, self._direction, self._force):
            control.on_update(self._changed)

    def update(self, frame: Frame) -> None:
        """Keep the gizmo at the hand's target while nobody drags it."""
        servo, snapshot = self._servo, frame.snapshot
        if frame.generation != self._generation:
            self._generation = frame.generation
            self._centre = _near_tool(servo.config.scene)
            self._gizmo.visible = servo.config.is_mouse
            self._put(servo.target)
        trouble = self._health.trouble(frame, servo.parameters.rate)
        if self.is_moving and snapshot is not None:
            if trouble is not None and trouble.sinks and frame.live is not None:
                self._hold(frame.live.tool_pose)
            else:
                self._put(snapshot.handle_pose)

    # -- dragging ------------------------------------------------------------------------------

    def _drag(self, event: Any) -> None:
        now = time.monotonic()
        if not self.holder.may(event.client_id, now):
            if now - self._dragged > 1.0:
                notify(event, "Another tab controls the tool", "Take control under Hand.", "orange")
            self._dragged = now
            self._put(self._servo.target)
            return
        if self.is_moving:
            self._stop_motion()
        self._servo.point(self._pose())

    def _pose(self) -> NDArray[np.float64]:
        """Return the handle's pose for the gizmo's (7,)."""
        rotation = np.asarray(self._gizmo.wxyz, dtype=np.float64)
        rotation /= np.linalg.norm(rotation)
        position = np.asarray(self._gizmo.position) / UNITS - rotation_of(rotation) @ self._centre
        return np.concatenate([position, rotation])

    def _put(self, pose: NDArray[np.float64]) -> None:
        position = pose[:3] + rotation_of(pose[3:]) @ self._centre
        self._gizmo.position = tuple((UNITS * position).tolist())
        self._gizmo.wxyz = tuple(pose[3:].tolist())

    def step(self, event: Any, way: NDArray[np.float64]) -> None:
        """Move the hand by a step (3,) [m], as a key asks."""
        if self._allowed(event):
            if self.is_moving:
                self._stop_motion()
            goal = self._servo.target.copy()
            goal[:3] += way
            self._servo.point(goal)
            self._put(goal)

    def lift_off(self, event: Any) -> None:
        """Return the hand to its initial pose, in the air."""
        if self._allowed(event):
            self._stop_motion()
            self._servo.point(self._servo.config.first_pose)
            self._put(self._servo.target)

    def _allowed(self, event: Any) -> bool:
        if self.holder.may(event.client_id, time.monotonic()):
            return True
        notify(
            event, "Another tab controls the tool", "Take control with the button above.", "orange"
        )
        return False

    # -- motions -------------------------------------------------------------------------------

    def _start_clicked(self, event: Any) -> None:
        if self._allowed(event) and attempt(event, "Motion", self._move):
            self._stop.disabled = False

    def _move(self) -> None:
        self._servo.move(
            CannedMotion(
                self._kind.value, 1e-3 * self._speed.value, 1e-3 * self._length.value,
                float(np.radians(self._direction.value)),
            ),
            press=self._force.value,
        )  # fmt: skip
        self.is_moving = True

    def _changed(self, event: Any) -> None:
        """Restart a canned motion with the new settings, from where it began."""
        if self.is_moving and from_browser(event):
            attempt(event, "Motion", self._move)

    def _stop_clicked(self, event: Any) -> None:
        if self._allowed(event):
            self._stop_motion()

    def _stop_motion(self) -> None:
        """Stop the motion and hold the hand where it is."""
        snapshot = self._servo.live()
        self.is_moving, self._stop.disabled = False, True
        if snapshot is not None:
            self._hold(snapshot.handle_pose)

    def _hold(self, pose: NDArray[np.float64]) -> None:
        """Hold the hand at a pose, without pressing: a hand that feels too little would sink."""
        self.is_moving, self._stop.disabled = False, True
        self._servo.point(pose)
        self._put(self._servo.target)


def _near_tool(scene: Scene) -> NDArray[np.float64]:
    """Return the place for the gizmo [m]: the centre of mass, or near it on what is seen.

    A ball on a handle that is not drawn has its centre of mass out of view.
    """
    model, tool = scene.model, scene.model.body(scene.tool).id
    seen = [i for i in np.flatnonzero(model.geom_bodyid == tool) if is_touchable(model, int(i))]
    centre = np.array(coupled_body(model, scene.tool).centre)
    if not seen:
        return centre
    middle, radius = model.geom_pos[seen], model.geom_rbound[seen, None]
    return np.clip(centre, (middle - radius).min(axis=0), (middle + radius).max(axis=0))

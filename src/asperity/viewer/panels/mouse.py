"""Moving the tool with the mouse: a gizmo to drag, and canned motions.

The gizmo says where the hand shall be; how it gets there smoothly is the device's
(`devices.mouse`). It stands at the tool's centre of mass. One tab holds the tool: the first that
drags it, until it has not for a while, is closed, or another takes it by the button.
"""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from asperity.dynamics.virtual_coupling.settings import coupled_body
from asperity.geometry.poses import rotation_of
from asperity.scene.trajectory import ScriptedMotion
from asperity.viewer.motions import FORCES, KINDS, LENGTHS, SPEEDS, CannedMotion
from asperity.viewer.notify import attempt, is_asked, tell
from asperity.viewer.panels.panel import Frame
from asperity.viewer.panels.scene_view import UNITS

if TYPE_CHECKING:
    import viser

    from asperity.viewer.servo_client import ServoClient

HELD = 5.0
"""A tab that has not moved the tool for so long holds it no more [s]; ours."""


class Holder:
    """Which tab holds the tool."""

    def __init__(self) -> None:
        self._client: int | None = None
        self._last = -np.inf

    def may(self, client: int | None, now: float) -> bool:
        """Return whether a tab may move the tool now; if so, it holds it."""
        if client not in (self._client, None) and now - self._last < HELD:
            return False
        self.take(client, now)
        return True

    def take(self, client: int | None, now: float) -> None:
        """Give the tool to a tab."""
        self._client, self._last = client, now

    def gone(self, client: int) -> None:
        """Take it from a tab that was closed."""
        if client == self._client:
            self._last = -np.inf


class Mouse:
    """The gizmo and the motions, as a panel."""

    title = "Hand"

    def __init__(self) -> None:
        self.holder = Holder()
        self.is_moving = False
        """Whether a canned motion is going on."""
        self._generation = -1
        self._dragged = -np.inf

    def build(self, server: viser.ViserServer, link: ServoClient) -> None:
        """Make the gizmo and the controls."""
        self._server, self._link = server, link
        self._gizmo = server.scene.add_transform_controls(
            "/gizmo", scale=2.0, line_width=3.0, depth_test=False, opacity=0.8
        )
        self._gizmo.on_update(self._drag)
        server.on_client_disconnect(lambda client: self.holder.gone(client.client_id))
        gui = server.gui
        gui.add_markdown(
            "Drag the arrows to press and rub, the arcs to turn. "
            "The green ghost is your hand; the tool hangs on it."
        )
        self._take = gui.add_button("Hold the tool in this tab", icon="hand-grab")
        self._take.on_click(self._taken)
        self._home = gui.add_button("Lift off", hint="Back to where the hand began")
        self._home.on_click(self._lift)
        with gui.add_folder("Canned motions"):
            motion = link.choice.scene.motion
            own = motion if isinstance(motion, ScriptedMotion) else ScriptedMotion()
            self._kind = gui.add_dropdown("motion", KINDS)
            self._speed = gui.add_slider(
                "speed [mm/s]", *(1e3 * s for s in SPEEDS), 1.0, _within(1e3 * own.speed, 500.0)
            )
            self._length = gui.add_slider(
                "length [mm]", *(1e3 * s for s in LENGTHS), 1.0, _within(1e3 * own.length, 200.0)
            )
            self._direction = gui.add_slider(
                "direction [deg]", -180.0, 180.0, 1.0, round(np.degrees(own.direction))
            )
            self._force = gui.add_slider(
                "force [N]", *FORCES, 0.01, min(round(own.press_force, 2), FORCES[1])
            )
            self._start = gui.add_button("Start", icon="player-play", color="green")
            self._stop = gui.add_button("Stop", icon="player-stop", disabled=True)
        self._start.on_click(self._started)
        self._stop.on_click(self._stopped)
        for control in (self._speed, self._length, self._direction, self._force):
            control.on_update(self._changed)

    def update(self, frame: Frame) -> None:
        """Have the gizmo where the hand shall be, when nobody drags it."""
        link, moment = self._link, frame.moment
        if frame.generation != self._generation:
            self._generation = frame.generation
            body = coupled_body(link.choice.scene.model, link.choice.scene.tool)
            self._centre = np.array(body.centre)
            self._gizmo.visible = link.choice.is_mouse
            self._put(link.target)
        if self.is_moving and moment is not None:
            self._put(moment.handle_pose)

    def close(self) -> None:
        """Nothing is held."""

    # -- dragging ------------------------------------------------------------------------------

    def _drag(self, event: Any) -> None:
        now = time.monotonic()
        if not self.holder.may(event.client_id, now):
            if now - self._dragged > 1.0:
                tell(event, "Another tab holds the tool", "Take it under Hand.", "orange")
            self._dragged = now
            self._put(self._link.target)
            return
        if self.is_moving:
            self._rest()
        self._link.point(self._pose())

    def _pose(self) -> NDArray[np.float64]:
        """Return the handle's pose that the gizmo stands for (7,)."""
        turn = np.asarray(self._gizmo.wxyz, dtype=np.float64)
        turn /= np.linalg.norm(turn)
        place = np.asarray(self._gizmo.position) / UNITS - rotation_of(turn) @ self._centre
        return np.concatenate([place, turn])

    def _put(self, pose: NDArray[np.float64]) -> None:
        place = pose[:3] + rotation_of(pose[3:]) @ self._centre
        self._gizmo.position = tuple((UNITS * place).tolist())
        self._gizmo.wxyz = tuple(pose[3:].tolist())

    def _taken(self, event: Any) -> None:
        self.holder.take(event.client_id, time.monotonic())

    def _lift(self, event: Any) -> None:
        if self._allowed(event):
            self._rest()
            self._link.point(self._link.choice.first_pose)
            self._put(self._link.target)

    def _allowed(self, event: Any) -> bool:
        if self.holder.may(event.client_id, time.monotonic()):
            return True
        tell(event, "Another tab holds the tool", "Take it with the button above.", "orange")
        return False

    # -- motions -------------------------------------------------------------------------------

    def _started(self, event: Any) -> None:
        if self._allowed(event) and attempt(event, "Motion", self._move):
            self._stop.disabled = False

    def _move(self) -> None:
        self._link.move(
            CannedMotion(
                self._kind.value, 1e-3 * self._speed.value, 1e-3 * self._length.value,
                float(np.radians(self._direction.value)),
            ),
            press=self._force.value,
        )  # fmt: skip
        self.is_moving = True

    def _changed(self, event: Any) -> None:
        """Take other numbers while it moves, from where the motion began."""
        if self.is_moving and is_asked(event):
            attempt(event, "Motion", self._move)

    def _stopped(self, event: Any) -> None:
        if self._allowed(event):
            self._rest()

    def _rest(self) -> None:
        """Stay where the hand is now."""
        moment = self._link.latest()
        self.is_moving, self._stop.disabled = False, True
        if moment is not None:
            self._link.point(moment.handle_pose)
            self._put(self._link.target)


def _within(value: float, most: float) -> float:
    return float(min(max(round(value), 1.0), most))

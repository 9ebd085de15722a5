"""What is always in reach, above all tabs, and the keys for it."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import numpy as np

from asperity.drawing.pages import render
from asperity.geometry.poses import rotation_of
from asperity.viewer.link import LinkRequests, linked, query_of, scene_as_felt
from asperity.viewer.notify import attempt, notify
from asperity.viewer.panels.mouse import MousePanel
from asperity.viewer.panels.panel import Panel, ViserServer
from asperity.viewer.panels.scene_view import SceneView
from asperity.viewer.server.script import KEYS, run_in_browsers
from asperity.viewer.servo_client import ServoClient
from asperity.viewer.timeline import Timeline

STEP, PRESS_STEP = 5e-4, 2.5e-4
"""Way of the hand with an arrow key, and up or down with a page key [m]; project defaults."""
_SIZE = (900, 1600)
"""Rows and columns of a picture of the scene [px]."""
_WIDE = "<style>.mantine-Modal-content{flex-basis:46rem}</style>"
"""viser has no width of a window: in its usual one, the help is higher than a small screen."""


class ActionsPanel(Panel):
    """Lift-off, reset, undo; zoom, picture, saving, link, help; and keys.

    Parameters
    ----------
    mouse : MousePanel
    view : SceneView
    timeline : Timeline, optional
        That the space bar pauses.
    links : LinkRequests, optional
    folder : Path
        Where scenes are saved.
    """

    title = ""

    def __init__(
        self, mouse: MousePanel, view: SceneView, timeline: Timeline | None = None,
        links: LinkRequests | None = None, folder: Path = Path("out/view"),
    ) -> None:  # fmt: skip
        self._mouse, self._view, self._timeline = mouse, view, timeline
        self._links, self._folder = links, folder

    def build(self, server: ViserServer, servo: ServoClient) -> None:
        """Add buttons and keys."""
        self._server, self._servo = server, servo
        gui = server.gui
        self._do = {
            "Lift off": self._mouse.lift_off, "Reset": self._reset, "Undo": self._undo,
            "Zoom": self._zoom, "Picture": self._picture, "Save": self._save,
            "Link": self._link, "Help": self._help,
        }  # fmt: skip
        for label, names, order, hint in (
            ("hand", ("Lift off", "Reset", "Undo"), -5.0,
             "Lift the tool off; its place and the settings of the scene (r); undo a change (u)"),
            ("view", ("Zoom", "Picture", "Help"), -4.0,
             "Zoom to the contact and back (z); a picture as PNG; keys and words (?)"),
            ("scene", ("Save", "Link"), -3.0,
             "Save the scene with its present settings; a link that reproduces them"),
        ):  # fmt: skip
            group = gui.add_button_group(label, names, order=order, hint=hint)
            group.on_click(self._clicked)
        keys: tuple[tuple[str, str, Any], ...] = (
            ("Reset", "R", self._reset),
            ("Zoom to the contact", "Z", self._zoom),
            ("Undo", "U", self._undo),
            ("Help", "H", self._help),
            ("Pause or go on", "space", self._pause),
            ("Left", "arrowleft", self._moves(-1.0, 0.0, 0.0)),
            ("Right", "arrowright", self._moves(1.0, 0.0, 0.0)),
            ("Away", "arrowup", self._moves(0.0, 1.0, 0.0)),
            ("Towards you", "arrowdown", self._moves(0.0, -1.0, 0.0)),
            ("Lift", "pageup", self._moves(0.0, 0.0, 1.0)),
            ("Press", "pagedown", self._moves(0.0, 0.0, -1.0)),
        )
        for label, key, do in keys:
            gui.add_command(label, hotkey=key).on_trigger(do)
        run_in_browsers(server, KEYS)
        if self._links is not None:
            server.on_client_connect(self._ask_about_link)

    def _clicked(self, event: Any) -> None:
        self._do[event.target.value](event)

    # -- the hand ------------------------------------------------------------------------------

    def _reset(self, event: Any) -> None:
        if self._timeline is not None:
            self._timeline.go_live()
        self._mouse.lift_off(event)
        attempt(event, "Reset", self._servo.reset)
        self._view.look_from_the_start()

    def _undo(self, event: Any) -> None:
        attempt(event, "Undo", self._servo.undo)

    def _moves(self, right: float, away: float, up: float) -> Any:
        def move(event: Any) -> None:
            client = event.client
            if client is None or not self._servo.config.is_mouse:
                return
            view = rotation_of(np.asarray(client.camera.wxyz))
            across = np.array([*view[:2, 0], 0.0])
            across /= max(float(np.linalg.norm(across)), 1e-9)
            ahead = np.array([-across[1], across[0], 0.0])
            way = STEP * (right * across + away * ahead)
            way[2] = PRESS_STEP * up
            self._mouse.step(event, way)

        return move

    def _pause(self, _: Any) -> None:
        time_ = self._timeline
        if time_ is not None:
            (time_.hold if time_.is_live else time_.go_live)()

    # -- the page ------------------------------------------------------------------------------

    def _zoom(self, event: Any) -> None:
        self._view.zoom()

    def _picture(self, event: Any) -> None:
        client = event.client
        if client is None:
            return

        def take() -> None:
            from io import BytesIO

            from PIL import Image

            drawn = client.get_render(*_SIZE)
            out = BytesIO()
            Image.fromarray(drawn[..., :3]).save(out, "PNG")
            name = f"{self._servo.config.scene.name}-{time.strftime('%H%M%S')}.png"
            client.send_file_download(name, out.getvalue())

        attempt(event, "Picture", take)

    def _save(self, event: Any) -> None:
        def save() -> None:
            servo = self._servo
            scene = scene_as_felt(servo.config, servo.parameters)
            stamp = time.strftime("%Y%m%d-%H%M%S")
            folder = self._folder / f"{scene.name}-scene-{stamp}"
            scene.save(folder)
            notify(event, "Saved", f"asperity view {folder}", "green")

        attempt(event, "Save", save)

    def _link(self, event: Any) -> None:
        def show() -> None:
            servo = self._servo
            query = query_of(servo.config, servo.parameters)
            host, port = self._server.get_host(), self._server.get_port()
            with event.client.gui.add_modal("A link to this scene and its settings") as modal:
                event.client.gui.add_text("link", f"http://{host}:{port}/?{query}")
                event.client.gui.add_markdown(
                    "It works while `asperity view` runs at this address. The page asks before "
                    "anything is changed."
                )
                event.client.gui.add_button("Close").on_click(lambda _: modal.close())

        if event.client is not None:
            attempt(event, "Link", show)

    def _ask_about_link(self, client: Any) -> None:
        """Ask the user of a browser that has opened a link whether to follow it."""
        query = self._links.take() if self._links is not None else ""
        if not query:
            return
        servo = self._servo

        def follow(event: Any) -> None:
            modal.close()
            attempt(event, "Link", lambda: servo.restart(linked(servo.config, query)).result())

        with client.gui.add_modal("Follow the link?") as modal:
            client.gui.add_markdown(
                "The address asks for a scene with certain settings. All tabs would show it."
            )
            client.gui.add_button("Follow it", color="green").on_click(follow)
            client.gui.add_button("Stay here").on_click(lambda _: modal.close())

    def _help(self, event: Any) -> None:
        client = event.client
        if client is None:
            return
        with client.gui.add_modal("Keys, signs and words") as modal:
            client.gui.add_html(_WIDE)
            client.gui.add_markdown(render("live_help.md"))
            client.gui.add_button("Close").on_click(lambda _: modal.close())

"""Rougher or smoother: a slider along a series of designed stimuli."""

from __future__ import annotations

from typing import Any

from asperity.viewer.changes import with_texture
from asperity.viewer.notify import attempt, from_browser
from asperity.viewer.panels.panel import Frame, Panel, ViserServer
from asperity.viewer.servo_client import ServoClient
from asperity.viewer.stimulus_series import BODY, series_of


class StimuliPanel(Panel):
    """A slider along the series that the shown scene is of; hidden if it is of none."""

    title = "Surfaces"

    def __init__(self) -> None:
        self._textures: list[dict[str, Any]] = []
        self._generation = -1

    def build(self, server: ViserServer, servo: ServoClient) -> None:
        """Add the slider."""
        self._servo = servo
        self._folder = server.gui.add_folder("Series of stimuli")
        with self._folder:
            self._slider = server.gui.add_slider(
                "smoother / rougher", min=1, max=2, step=1, initial_value=1,
                hint="The stimuli of the design are evenly spaced in its metric",
            )  # fmt: skip
        self._slider.on_update(self._moved)
        self._show()

    def update(self, frame: Frame) -> None:
        """Show the series of a new scene."""
        if frame.generation != self._generation:
            self._generation = frame.generation
            self._show()

    def _show(self) -> None:
        self._textures, place = series_of(self._servo.config.scene)
        self._folder.visible = len(self._textures) > 1
        self._slider.max = max(len(self._textures), 2)
        self._slider.value = place + 1

    def _moved(self, event: Any) -> None:
        if not from_browser(event) or len(self._textures) < 2:
            return
        texture = self._textures[int(self._slider.value) - 1]
        servo = self._servo

        def change() -> None:
            servo.restart(with_texture(servo.config, BODY, texture)).result()

        attempt(event, f"Stimulus {int(self._slider.value)}", change)

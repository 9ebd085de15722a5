"""Rougher or smoother: a slider along a series of designed stimuli.

The series is found beside a scene: what `asperity design` leaves of one.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from asperity.errors import AsperityError
from asperity.scene.document import read_toml
from asperity.scene.scene import Scene
from asperity.viewer.changes import with_texture
from asperity.viewer.notify import attempt, from_browser
from asperity.viewer.panels.panel import Frame, Panel, ViserServer
from asperity.viewer.servo_client import ServoClient

BODY = "plate"


def series_of(scene: Scene) -> tuple[list[dict[str, Any]], int]:
    """Return the textures of the series that a scene is of, and which of them it has.

    Returns
    -------
    textures : list of dict
        Tables as in `scene.toml`, with absolute paths, from the smoothest to the roughest; empty
        for a scene that is of none.
    place : int
        0 where the scene has another texture.
    """
    if scene.folder is None:
        return [], 0
    whole = scene.folder.resolve().parent
    try:
        report = json.loads((whole / "design.json").read_text("utf-8"))
        if report.get("kind") != "series":
            return [], 0
        textures = [_texture(whole / str(i + 1)) for i in range(len(report["surfaces"]))]
    except (OSError, ValueError, KeyError, AttributeError, AsperityError):
        return [], 0  # Some other file of that name, or a series of which a part was moved.
    name = scene.document.get("bodies", {}).get(BODY, {}).get("texture", {}).get("file", "")
    own = (scene.folder / name).resolve()
    places = [i for i, one in enumerate(textures) if Path(one["file"]) == own]
    return textures, places[0] if places else 0


def _texture(folder: Path) -> dict[str, Any]:
    table = dict(read_toml(folder / "scene.toml")["bodies"][BODY]["texture"])
    table["file"] = str((folder / table["file"]).resolve())
    return table


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

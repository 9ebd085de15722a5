"""A recording on the page: the same scene and instruments, with a slider through its time."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from asperity.errors import AsperityError
from asperity.realtime.servo.parameters import LiveParameters
from asperity.realtime.servo.replay import scene_of_recording
from asperity.realtime.servo.snapshot import Snapshot
from asperity.realtime.servo.tick_row import WIDTH
from asperity.runs.recording import read_attributes, recording_file
from asperity.viewer.downloads import Downloads
from asperity.viewer.panels.panel import Frame, Panel
from asperity.viewer.panels.plots import PlotsPanel
from asperity.viewer.panels.roughness import RoughnessPanel
from asperity.viewer.panels.scene_view import Stage
from asperity.viewer.panels.sound import SoundPanel
from asperity.viewer.panels.time import TimePanel
from asperity.viewer.replayed_contacts import ContactsAgain
from asperity.viewer.row_buffer import KeptRecording
from asperity.viewer.server.server import LOCAL, Page
from asperity.viewer.session_config import SessionConfig
from asperity.viewer.timeline import Timeline


class RecordedLink:
    """What a page asks of a link, of a recording: nothing runs, and nothing can be changed."""

    def __init__(self, choice: SessionConfig, timeline: Timeline) -> None:
        self.choice = choice
        self.state, self.told, self.device, self.generation = "recording", "", "recording", 1
        self.is_alive = False
        self.history = SimpleNamespace(count=0)
        self.parameters = LiveParameters.of(choice.scene, choice.rate)
        self._timeline = timeline

    def latest(self) -> Snapshot | None:
        """Return the moment that is shown."""
        return self._timeline.moment()

    def rows_since(self, number: int) -> tuple[NDArray[np.float64], int]:
        """Return none: no rows come."""
        return np.empty((0, WIDTH)), number

    def tap(self, take: Callable[[NDArray[np.float64]], None]) -> Callable[[], None]:
        """Call nobody; return what ends that."""
        return lambda: None


class _Taking:
    """Downloads of the recording, as a panel."""

    title = "Record"

    def __init__(self, path: Path) -> None:
        self._path = path

    def build(self, server: Any, link: Any) -> None:
        """Say which recording it is, and make the buttons."""
        from asperity.runs.dataset import open_recording

        server.gui.add_markdown(_told(self._path))
        Downloads(lambda: open_recording(self._path), file=lambda: self._path).build(server)

    def update(self, frame: Frame) -> None:
        """Nothing changes."""

    def close(self) -> None:
        """Nothing is held."""


class ReplayPage:
    """The page of a recording. Close it when done; a context manager.

    Parameters
    ----------
    file : Path
        `recording.h5`, or the folder it is in.
    scene : str, optional
        A scene's name or folder. Default: the one beside the recording, else what it says.
    host, port : str, int
        Port 0: any that is free.

    Raises
    ------
    AsperityError
        The file is no recording or has no ticks, or its scene is not to be found.
    """

    def __init__(
        self, file: Path, scene: str | None = None, *, host: str = LOCAL, port: int = 8080
    ) -> None:
        path = recording_file(file)
        found = scene_of_recording(read_attributes(path), scene, beside=path.parent)
        self._kept = KeptRecording(path)
        if not self._kept.count:
            self._kept.close()
            raise AsperityError(f"{path} has no ticks")
        dt = float(self._kept.attributes.get("dt", 1e-3))
        timeline = Timeline(rate=1.0 / dt)
        self._contacts = ContactsAgain(found, self._kept)
        timeline.show(self._kept, self._contacts.moment_at, f"recording {path.parent.name}")
        panels: list[Panel] = [
            Stage(),
            TimePanel(timeline, live=False),
            RoughnessPanel(timeline),
            PlotsPanel(timeline),
            _Taking(path),
            SoundPanel(timeline, live=False),
        ]
        link: Any = RecordedLink(SessionConfig(found, device="recording", rate=1.0 / dt), timeline)
        self.timeline = timeline
        self.page = Page(link, panels, host=host, port=port, label=f"asperity: {path.parent.name}")

    @property
    def url(self) -> str:
        """Where a browser finds it."""
        return self.page.url

    def wait(self, seconds: float | None = None) -> bool:
        """Wait until the page is closed, at most so long [s]; return whether it is."""
        return self.page.wait(seconds)

    def close(self) -> None:
        """Take the page down."""
        self.page.close()
        self._contacts.close()
        self._kept.close()

    def __enter__(self) -> ReplayPage:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _told(path: Path) -> str:
    """Return what a recording says of itself, as Markdown."""
    said = read_attributes(path)
    lines = [f"`{path}`", ""]
    for key in ("scene", "device", "trajectory", "coupling", "begun", "version"):
        if said.get(key):
            lines.append(f"- {key}: {said[key]}")
    return "\n".join(lines)

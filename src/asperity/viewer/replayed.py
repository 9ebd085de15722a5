"""A recording on the page: the same scene and instruments, with a slider through its time."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from asperity.errors import AsperityError
from asperity.realtime.servo.ipc import TICK, Ticks
from asperity.realtime.servo.parameters import LiveParameters
from asperity.realtime.servo.replay import scene_of_recording
from asperity.realtime.servo.snapshot import Snapshot
from asperity.runs.recording import read_attributes, recording_file
from asperity.viewer.downloads import add_downloads
from asperity.viewer.panels.light import LightPanel
from asperity.viewer.panels.panel import Panel, ViserServer
from asperity.viewer.panels.plots import PlotsPanel
from asperity.viewer.panels.roughness import RoughnessPanel
from asperity.viewer.panels.scene_view import SceneView
from asperity.viewer.panels.sound import SoundPanel
from asperity.viewer.panels.time import TimePanel
from asperity.viewer.replayed_contacts import RecomputedContacts
from asperity.viewer.server.server import LOCAL, Page
from asperity.viewer.session_config import SessionConfig
from asperity.viewer.tick_buffer import RecordedTicks
from asperity.viewer.timeline import Timeline


class RecordingClient:
    """A recording in place of a `ServoClient`: nothing runs, and nothing can be changed."""

    def __init__(self, config: SessionConfig, timeline: Timeline) -> None:
        self.config = config
        self.state, self.message, self.device, self.generation = "recording", "", "recording", 1
        self.is_alive = False
        self.history = SimpleNamespace(count=0)
        self.parameters = LiveParameters.of(config.scene, config.rate)
        self._timeline = timeline

    def latest(self) -> Snapshot | None:
        """Return the snapshot at the instant shown."""
        return self._timeline.snapshot()

    def live(self) -> Snapshot | None:
        """Return None: no loop runs."""
        return None

    def ticks_since(self, number: int) -> tuple[Ticks, int]:
        """Return no ticks: none arrive."""
        return np.empty(0, TICK), number

    def subscribe(self, take: Callable[[Ticks], None]) -> Callable[[], None]:
        """Do nothing, as no ticks arrive; return a function that does nothing either."""
        return lambda: None


class _DownloadPanel(Panel):
    """Downloads of the recording."""

    title = "Record"

    def __init__(self, path: Path) -> None:
        self._path = path

    def build(self, server: ViserServer, servo: Any) -> None:
        """Show which recording it is, and add the buttons."""
        from asperity.runs.dataset import open_recording

        server.gui.add_markdown(_description(self._path))
        add_downloads(server.gui, lambda: open_recording(self._path), file=lambda: self._path)


@contextmanager
def recording_page(
    file: Path, scene: str | None = None, *, host: str = LOCAL, port: int = 8080
) -> Iterator[Page]:
    """Serve the page of a recording until the block ends.

    Parameters
    ----------
    file : Path
        `recording.h5`, or its folder.
    scene : str, optional
        Name or folder of a scene. Default: the scene beside the recording, else the one it names.
    host, port : str, int
        Port 0: any that is free.

    Raises
    ------
    AsperityError
        The file is not a recording or has no ticks, or its scene is not found.
    """
    path = recording_file(file)
    attributes = read_attributes(path)
    found = scene_of_recording(attributes, scene, beside=path.parent)
    ticks = RecordedTicks(path)
    with closing(RecomputedContacts(found, ticks)) as contacts:
        if not ticks.count:
            raise AsperityError(f"{path} has no ticks")
        rate = 1.0 / float(attributes.get("dt", 1e-3))
        timeline = Timeline(rate=rate)
        timeline.show(ticks, contacts.snapshot_at, f"recording {path.parent.name}")
        panels: list[Panel] = [
            SceneView(), LightPanel(), TimePanel(timeline, live=False), RoughnessPanel(timeline),
            PlotsPanel(timeline), _DownloadPanel(path), SoundPanel(timeline, live=False),
        ]  # fmt: skip
        config = SessionConfig(found, device="recording", rate=rate)
        servo: Any = RecordingClient(config, timeline)
        title = f"asperity: {path.parent.name}"
        with Page(servo, panels, host=host, port=port, label=title) as page:
            yield page


def _description(path: Path) -> str:
    """Return the attributes of a recording as Markdown."""
    attributes = read_attributes(path)
    lines = [f"`{path}`", ""]
    for key in ("scene", "device", "trajectory", "coupling", "begun", "version"):
        if attributes.get(key):
            lines.append(f"- {key}: {attributes[key]}")
    return "\n".join(lines)

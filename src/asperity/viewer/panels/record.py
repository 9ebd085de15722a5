"""Recording and replaying, and downloads as recording.h5, CSV, WAV and PNG."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from asperity._core.output import growing_folder
from asperity.errors import AsperityError
from asperity.realtime.servo.ipc import TICK, Ticks
from asperity.realtime.servo.parameters import LiveParameters, attributes_of
from asperity.realtime.servo.recorder import RecorderOnRequest
from asperity.realtime.servo.replay import SCENE_BESIDE
from asperity.runs.recording import add_attribute
from asperity.viewer.downloads import add_downloads
from asperity.viewer.panels.panel import Frame, Panel, ViserServer
from asperity.viewer.replayed_contacts import RecomputedContacts
from asperity.viewer.servo_client import ServoClient
from asperity.viewer.tick_buffer import RecordedTicks
from asperity.viewer.timeline import Timeline

_EVERY = 10
_READY = "Every tick is written to a `recording.h5` by a separate process."


class RecordPanel(Panel):
    """Records while the loop runs, and replays the recording.

    Parameters
    ----------
    timeline : Timeline
    folder : Path
        Where recordings go, each into its own folder.
    """

    title = "Record"

    def __init__(self, timeline: Timeline, folder: Path) -> None:
        self._timeline, self._folder = timeline, folder
        self._lock = threading.Lock()
        self._recorder: RecorderOnRequest | None = None
        self._unsubscribe: Callable[[], None] = lambda: None
        self._generation = 0
        self._parameters: LiveParameters | None = None
        self._changes: list[dict[str, Any]] = []
        self._replayed: RecomputedContacts | None = None
        self.path: Path | None = None
        """The last finished recording."""

    def build(self, server: ViserServer, servo: ServoClient) -> None:
        """Add the buttons."""
        self._servo = servo
        gui = server.gui
        self._record = gui.add_button("Record", icon="player-record", color="red")
        self._stop = gui.add_button("Stop", icon="player-stop", visible=False)
        self._message = gui.add_markdown(_READY)
        self._replay = gui.add_button("Replay", icon="player-play", visible=False)
        self._record.on_click(lambda _: self.start())
        self._stop.on_click(lambda _: self.stop())
        self._replay.on_click(lambda _: self.replay())
        with gui.add_folder("Download the recording", visible=False) as self._take:
            add_downloads(gui, self._of_recording, file=lambda: self.path)
        with gui.add_folder("Download what is shown", expand_by_default=False):
            add_downloads(gui, self._of_shown)

    def update(self, frame: Frame) -> None:
        """Show the length of a recording under way; end it if the servo process is replaced."""
        recorder = self._recorder
        if recorder is None:
            return
        self._note(recorder)
        if frame.number % _EVERY:
            return
        if frame.generation != self._generation:
            self.stop("the loop was restarted with another scene, texture or device")
        elif not recorder.is_alive:
            self.stop("the recorder ended")
        else:
            self._message.content = (
                f"Recording: **{recorder.seconds:.1f} s**, {recorder.ticks} ticks"
            )

    def _note(self, recorder: RecorderOnRequest) -> None:
        """Note changed parameters, and when, to within an update of the page."""
        now = self._servo.parameters
        if self._servo.generation == self._generation and now != self._parameters:
            self._parameters = now
            self._changes.append({"after": round(recorder.seconds, 3), **now.plain()})

    def close(self) -> None:
        """Finish a recording under way."""
        if self._recorder is not None:
            self.stop("the page was closed")
        self._let_go()

    def start(self) -> None:
        """Start a recording."""
        with self._lock:
            if self._recorder is not None:
                return
            servo, config = self._servo, self._servo.config
            try:
                if not servo.is_alive:
                    raise AsperityError("no servo loop is running; restart it")
                stamp = time.strftime("%Y%m%d-%H%M%S")
                folder = growing_folder(_free(self._folder / f"{config.scene.name}-{stamp}"))
                # The scene is saved beside the recording, as it may differ from the one that it
                # names.
                config.scene.save(folder / SCENE_BESIDE)
                recorder = RecorderOnRequest(
                    folder / "recording.h5", self._attributes(), config.rate
                )
            except AsperityError as error:
                self._message.content = f"**Not recording:** {error}"
                return
            self._recorder, self._generation = recorder, servo.generation
            self._parameters, self._changes = servo.parameters, []

            def take(ticks: Ticks) -> None:
                if servo.generation == self._generation:
                    recorder.add(ticks)

            self._unsubscribe = servo.subscribe(take)
            self._record.visible, self._stop.visible = False, True
            self._message.content = "Recording"

    def stop(self, why: str = "") -> None:
        """Finish the recording, for the reason `why` if it was not the user's wish."""
        with self._lock:
            recorder, self._recorder = self._recorder, None
            if recorder is None:
                return
            self._unsubscribe()
            self._message.content = "Finishing the recording"
            result = recorder.finish()
            self.path = recorder.path if result["ticks"] else None
            if self.path is not None and self._changes:
                add_attribute(self.path, "parameter_changes", json.dumps(self._changes))
            lost = f", **{result['ticks_lost']} lost**" if result["ticks_lost"] else ""
            wrong = "".join(f"\n\n**{text}**" for text in (result["error"], why) if text)
            self._message.content = (
                f"`{recorder.path}`: {recorder.seconds:.2f} s, {result['ticks']} ticks{lost}{wrong}"
            )
            self._record.visible, self._stop.visible = True, False
            self._replay.visible = self._take.visible = self.path is not None

    def replay(self) -> None:
        """Show the last recording on this page."""
        if self.path is None:
            return
        if self._servo.generation != self._generation:
            self._message.content = (
                "The scene has been changed since. To view the recording: "
                f"`asperity replay {self.path.parent}`"
            )
            return
        self._let_go()
        ticks = RecordedTicks(self.path)
        self._replayed = contacts = RecomputedContacts(self._servo.config.scene, ticks)
        self._timeline.show(ticks, contacts.snapshot_at, f"recording {self.path.parent.name}")
        self._timeline.play()

    def _let_go(self) -> None:
        replayed, self._replayed = self._replayed, None
        if replayed is not None:
            self._timeline.go_live()
            replayed.close()

    def _of_recording(self) -> Any:
        from asperity.runs.dataset import open_recording

        if self.path is None:
            raise AsperityError("nothing has been recorded yet")
        return open_recording(self.path)

    def _of_shown(self) -> Any:
        from asperity.runs.dataset import dataset_of
        from asperity.runs.tool_motion import last_run

        ticks = self._timeline.everything()
        ticks = ticks[last_run(ticks["time"]) :]
        columns = {name: ticks[name].copy() for name in TICK.names or ()}
        return dataset_of(columns, self._attributes())

    def _attributes(self) -> dict[str, Any]:
        servo, config = self._servo, self._servo.config
        return attributes_of(
            config.scene, servo.parameters, source=config.source, device=servo.device
        )


def _free(folder: Path) -> Path:
    """Return the folder, or one with a number appended, that does not exist."""
    tries = [folder, *(folder.with_name(f"{folder.name}-{n}") for n in range(2, 100))]
    return next(path for path in tries if not path.exists())

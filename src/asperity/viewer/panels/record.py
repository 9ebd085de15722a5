"""Record, replay, and what can be taken away: recording.h5, CSV, WAV and PNG."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from asperity._core.output import growing_folder
from asperity.errors import AsperityError
from asperity.realtime.servo.recording_on_request import RecorderOnRequest, attributes_of
from asperity.realtime.servo.replay import SCENE_BESIDE
from asperity.runs.recording import add_attribute
from asperity.viewer.downloads import Downloads
from asperity.viewer.panels.panel import Frame
from asperity.viewer.replayed_contacts import ContactsAgain
from asperity.viewer.row_buffer import KeptRecording
from asperity.viewer.timeline import Timeline

if TYPE_CHECKING:
    import viser

    from asperity.realtime.servo.parameters import LiveParameters
    from asperity.viewer.servo_client import ServoClient

_EVERY = 10
_READY = "Every tick goes into a `recording.h5`, written by a process of its own."


class RecordPanel:
    """Records while the loop runs, and shows what was recorded.

    Parameters
    ----------
    timeline : Timeline
    folder : Path
        Where recordings go, each into a folder of its own.
    """

    title = "Record"

    def __init__(self, timeline: Timeline, folder: Path) -> None:
        self._timeline, self._folder = timeline, folder
        self._lock = threading.Lock()
        self._recorder: RecorderOnRequest | None = None
        self._untap: Callable[[], None] = lambda: None
        self._generation = 0
        self._parameters: LiveParameters | None = None
        self._changes: list[dict[str, Any]] = []
        self._replayed: tuple[KeptRecording, ContactsAgain] | None = None
        self.path: Path | None = None
        """The last recording that was finished."""

    def build(self, server: viser.ViserServer, link: ServoClient) -> None:
        """Make the buttons."""
        import viser

        self._link = link
        gui = server.gui
        self._record = gui.add_button("Record", icon=viser.Icon.PLAYER_RECORD, color="red")
        self._stop = gui.add_button("Stop", icon=viser.Icon.PLAYER_STOP, visible=False)
        self._told = gui.add_markdown(_READY)
        self._replay = gui.add_button("Replay", icon=viser.Icon.PLAYER_PLAY, visible=False)
        self._record.on_click(lambda _: self.start())
        self._stop.on_click(lambda _: self.stop())
        self._replay.on_click(lambda _: self.replay())
        with gui.add_folder("Take the recording", visible=False) as self._take:
            Downloads(self._of_recording, file=lambda: self.path).build(server)
        with gui.add_folder("Take what is shown", expand_by_default=False):
            Downloads(self._of_shown).build(server)

    def update(self, frame: Frame) -> None:
        """Show how long it has been recording; end it with the scene that it is of."""
        recorder = self._recorder
        if recorder is None:
            return
        self._note(recorder)
        if frame.number % _EVERY:
            return
        if frame.generation != self._generation:
            self.stop("the loop was begun anew, with another scene, texture or device")
        elif not recorder.is_alive:
            self.stop("the recorder ended")
        else:
            self._told.content = f"Recording: **{recorder.seconds:.1f} s**, {recorder.ticks} ticks"

    def _note(self, recorder: RecorderOnRequest) -> None:
        """Remember parameters that were changed, and when, to within an update of the page."""
        now = self._link.parameters
        if self._link.generation == self._generation and now != self._parameters:
            self._parameters = now
            self._changes.append({"after": round(recorder.seconds, 3), **now.plain()})

    def close(self) -> None:
        """Finish a recording that goes on."""
        if self._recorder is not None:
            self.stop("the page was closed")
        self._let_go()

    def start(self) -> None:
        """Begin to record."""
        with self._lock:
            if self._recorder is not None:
                return
            link, choice = self._link, self._link.choice
            try:
                if not link.is_alive:
                    raise AsperityError("no servo loop is running; restart it")
                stamp = time.strftime("%Y%m%d-%H%M%S")
                folder = growing_folder(_free(self._folder / f"{choice.scene.name}-{stamp}"))
                # With the scene beside it the recording stands for itself, whatever was changed.
                choice.scene.save(folder / SCENE_BESIDE)
                attributes = attributes_of(
                    choice.scene, link.parameters, source=choice.source, device=link.device
                )
                recorder = RecorderOnRequest(folder / "recording.h5", attributes, choice.rate)
            except AsperityError as error:
                self._told.content = f"**Not recording:** {error}"
                return
            self._recorder, self._generation = recorder, link.generation
            self._parameters, self._changes = link.parameters, []

            def take(rows: Any) -> None:
                if link.generation == self._generation:
                    recorder.add(rows)

            self._untap = link.tap(take)
            self._record.visible, self._stop.visible = False, True
            self._told.content = "Recording"

    def stop(self, why: str = "") -> None:
        """Finish the recording."""
        with self._lock:
            recorder, self._recorder = self._recorder, None
            if recorder is None:
                return
            self._untap()
            self._told.content = "Finishing the recording"
            told = recorder.finish()
            self.path = recorder.path if told["ticks"] else None
            if self.path is not None and self._changes:
                add_attribute(self.path, "parameter_changes", json.dumps(self._changes))
            lost = f", **{told['ticks_lost']} lost**" if told["ticks_lost"] else ""
            wrong = "".join(f"\n\n**{text}**" for text in (told["error"], why) if text)
            self._told.content = (
                f"`{recorder.path}`: {recorder.seconds:.2f} s, {told['ticks']} ticks{lost}{wrong}"
            )
            self._record.visible, self._stop.visible = True, False
            self._replay.visible = self._take.visible = self.path is not None

    def replay(self) -> None:
        """Show the last recording on this page."""
        if self.path is None:
            return
        if self._link.generation != self._generation:
            self._told.content = (
                "The scene is another one by now. To look at the recording: "
                f"`asperity replay {self.path.parent}`"
            )
            return
        self._let_go()
        kept = KeptRecording(self.path)
        contacts = ContactsAgain(self._link.choice.scene, kept)
        self._replayed = kept, contacts
        self._timeline.show(kept, contacts.moment_at, f"recording {self.path.parent.name}")
        self._timeline.play()

    def _let_go(self) -> None:
        replayed, self._replayed = self._replayed, None
        if replayed is not None:
            self._timeline.go_live()
            replayed[1].close()
            replayed[0].close()

    def _of_recording(self) -> Any:
        from asperity.runs.dataset import open_recording

        if self.path is None:
            raise AsperityError("nothing has been recorded yet")
        return open_recording(self.path)

    def _of_shown(self) -> Any:
        from asperity.realtime.servo.tick_row import columns
        from asperity.runs.dataset import dataset_of
        from asperity.runs.tool_motion import last_run

        rows = self._timeline.everything()
        rows = rows[last_run(rows[:, 0]) :]
        choice = self._link.choice
        attributes = attributes_of(
            choice.scene, self._link.parameters, source=choice.source, device=self._link.device
        )
        return dataset_of({k: np.array(v) for k, v in columns(rows).items()}, attributes)


def _free(folder: Path) -> Path:
    """Return a folder that is not there yet."""
    tries = [folder, *(folder.with_name(f"{folder.name}-{n}") for n in range(2, 100))]
    return next(path for path in tries if not path.exists())

"""An experiment in the browser page: what the participant sees, and what is hidden.

The page shows the tool at the pose of the hand in a scene without textures. The relief of a
stimulus, forces and contacts are hidden unless the design sets `show`. The experimenter watches the
terminal in which the command runs.
"""

from __future__ import annotations

import math
import queue
import time
from collections.abc import Callable
from dataclasses import replace
from html import escape
from typing import TYPE_CHECKING, Any

from asperity.errors import AsperityError
from asperity.psychophysics.design import ExperimentDesign
from asperity.psychophysics.interfaces.protocol import (
    ParticipantInterface,
    Paused,
    Progress,
    Reply,
    TakenBack,
)
from asperity.psychophysics.session.trials import PresentedInterval, Trial
from asperity.realtime.servo.process import ServoSpec
from asperity.realtime.servo.running import Servo
from asperity.scene.scene import Scene
from asperity.viewer.drawables.stage import UNITS
from asperity.viewer.panels.mouse import MousePanel
from asperity.viewer.panels.panel import Frame, Panel
from asperity.viewer.panels.scene_view import SceneView
from asperity.viewer.server.script import hide_settings_menu
from asperity.viewer.servo_client import ServoClient
from asperity.viewer.session_config import SessionConfig

if TYPE_CHECKING:
    import viser

_LOOKED = 0.2
"""Longest wait between two checks for Ctrl-C [s]."""
_WORDS = {
    "yes-no": {1: "yes", 0: "no"},
    "adjust": {2: "much_more", 1: "more", 0: "equal", -1: "less", -2: "much_less"},
}
"""Texts of the buttons of kinds of trials, by their answers."""
_QUIET, _LIT = "#e8ecf0", "#0072B2"
_LAMP = (
    '<div style="flex:1;text-align:center;font-size:2em;font-weight:700;padding:0.3em;'
    'border-radius:0.3em;background:{back};color:{front}">{text}</div>'
)


class TrialClient(ServoClient):
    """The page's client of the servo loop of the current interval; of none between intervals.

    Parameters
    ----------
    config : SessionConfig
        Device and rate; its scene is shown first.
    show : bool
        Whether the scene of each interval is shown.
    """

    def __init__(self, config: SessionConfig, *, show: bool = False) -> None:
        super().__init__(config)
        self.state = "ended"
        self._show = show

    def start(self) -> None:
        """Do nothing: each interval starts its own loop."""

    def __enter__(self) -> TrialClient:
        return self

    def spec(self, scene: Scene, seconds: float) -> ServoSpec:
        """Return the specification of the servo process of an interval."""
        config = replace(self.config, scene=scene, seconds=seconds)
        return config.spec(self._folder / "pointed")

    def feel(self, servo: Servo | None) -> None:
        """Follow another loop, or none."""
        with self._lock:
            self._servo = servo
            self.state = "ended" if servo is None else "running"
            if servo is not None:
                self.generation += 1
                if self._show:
                    self.config = replace(self.config, scene=servo.spec.scene)

    def change(self, **changes: Any) -> None:
        """Refuse: settings are fixed by the experiment."""
        raise AsperityError("settings cannot be changed during an experiment")

    def restart(self, config: SessionConfig | None = None) -> Any:
        """Refuse, as `change`."""
        self.change()


class SmoothSceneView(SceneView):
    """The scene without textures, with the tool at the hand's pose, so that nothing is revealed."""

    def update(self, frame: Frame) -> None:
        """Move the tool to the hand."""
        snapshot = frame.snapshot
        pose = self._servo.target if snapshot is None else snapshot.handle_pose
        self._tool.position = tuple((UNITS * pose[:3]).tolist())
        self._tool.wxyz = tuple(pose[3:].tolist())
        self._ghost.visible = False


class ParticipantPanel:
    """The participant's panel. Its buttons put actions into a queue.

    Parameters
    ----------
    design : Design
    """

    title = "Experiment"

    def __init__(self, design: ExperimentDesign) -> None:
        self.design = design
        self.done: queue.SimpleQueue[tuple[str, Any]] = queue.SimpleQueue()
        self.stage = ""
        """"welcome", "ready", "feel", "ask", "rest", "last", "over"."""

    def build(self, server: viser.ViserServer, servo: ServoClient) -> None:
        """Make all controls; `show` makes those of a stage visible."""
        gui: Any = server.gui
        hide_settings_menu(server)
        self._title = gui.add_markdown(f"## {self.design.name}")
        self._text = gui.add_markdown(self.design.instructions)
        self._bar = gui.add_progress_bar(0.0)
        self._lamps = gui.add_html("")
        self._message = gui.add_markdown("")
        texts = self.design.texts
        self._next = gui.add_button(texts("begin"), icon="player-play", color="green")
        self._enough = gui.add_button(texts("enough"), icon="player-skip-forward")
        self._choices = [gui.add_button(str(i)) for i in range(1, 1 + self.design.choices)]
        self._words = {
            kind: {answer: gui.add_button(texts(key)) for answer, key in words.items()}
            for kind, words in _WORDS.items()
            if kind == self.design.kind
        }
        self._entry = gui.add_text("answer", "")
        self._ok = gui.add_button(texts("ok"), icon="check", color="green")
        self._back = gui.add_button(texts("take_back"), icon="arrow-back-up", color="gray")
        self._pause = gui.add_button(texts("pause"), icon="player-pause", color="gray")
        self._back.on_click(lambda _: self.done.put(("back", None)))
        self._next.on_click(lambda _: self.done.put(("next", None)))
        self._enough.on_click(lambda _: self.done.put(("enough", None)))
        self._ok.on_click(lambda _: self.done.put(("answer", self._entry.value)))
        self._pause.on_click(lambda _: self.done.put(("pause", None)))
        for i, button in enumerate(self._choices, 1):
            button.on_click(lambda _, i=i: self.done.put(("answer", i)))
        for words in self._words.values():
            for answer, button in words.items():
                button.on_click(lambda _, i=answer: self.done.put(("answer", i)))
        self.show("starting", texts("wait"))

    def show(
        self, stage: str, message: str = "", *, kind: str = "", enough: bool = False,
        go: str = "", back: bool = False,
    ) -> None:  # fmt: skip
        """Show the controls of a stage of the session.

        Parameters
        ----------
        stage : str
        message : str
            A question or a notice.
        kind : str
            Kind of the trial in question.
        enough : bool
            Whether the participant may end the interval.
        go : str
            Text of the button that continues, by its key; empty: there is no such button.
        back : bool
            Whether the participant may take back the last answer.
        """
        texts = self.design.texts
        self.stage = stage
        asking = stage == "ask"
        self._text.visible = stage == "welcome"
        self._message.content = message
        if go:
            self._next.label = texts(go)
        self._next.visible = bool(go)
        self._back.visible = back
        self._enough.visible = stage == "feel" and enough
        for button in self._choices:
            button.visible = asking and kind == "choice"
        for name, words in self._words.items():
            for button in words.values():
                button.visible = asking and kind == name
        self._entry.visible = self._ok.visible = asking and kind in ("number", "order")
        if asking:
            self._entry.value = ""
            self._entry.label = texts("number_label" if kind == "number" else "order_label")
        self._pause.visible = stage in ("welcome", "ready", "ask", "rest")

    def light(self, interval: int, count: int) -> None:
        """Highlight the marker of an interval, counted from 1; 0: none."""
        lamps = "".join(
            _LAMP.format(
                back=_LIT if i == interval else _QUIET,
                front="white" if i == interval else "#8a949e",
                text=escape(str(i)),
            )
            for i in range(1, count + 1)
        )
        self._lamps.content = (
            f'<div style="display:flex;gap:0.5em;padding:0.3em 1em">{lamps}</div>' if count else ""
        )

    def progress(self, progress: Progress) -> None:
        """Show the progress of the session."""
        self._bar.value = 100.0 * progress.done / max(progress.most, 1)

    def update(self, frame: Frame) -> None:
        """Do nothing: the panel changes with the session only."""

    def close(self) -> None:
        """Pause the session, so that no wait blocks."""
        self.done.put(("pause", None))


class PageInterface(ParticipantInterface):
    """Questions and answers in the page.

    Parameters
    ----------
    desk : ParticipantPanel
        Built.
    say : callable
        Prints a line for the experimenter.
    clock : callable
        Time now [s].
    """

    kind = "page"

    def __init__(
        self, desk: ParticipantPanel, say: Callable[[str], None] = lambda _: None, *,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:  # fmt: skip
        self._desk, self._say, self._clock = desk, say, clock
        self._count = 0
        self._notice = ""
        self._texts = desk.design.texts

    def welcome(self, design: ExperimentDesign, progress: Progress) -> None:
        """Show the instructions."""
        again = self._texts("resumed", done=progress.done) if progress.resumed else ""
        self._desk.progress(progress)
        self._desk.show("welcome", again, go="begin")
        self._wait("next")

    def ready(self, trial: Trial, progress: Progress) -> None:
        """Wait for the button."""
        self._count = len(trial.stimuli)
        self._desk.progress(progress)
        self._desk.light(0, self._count)
        kind = "practice" if trial.practice else "short_trial"
        number = trial.number if trial.track is None or trial.step is None else trial.track
        message = f"{self._notice}\n\n" if self._notice else ""
        self._desk.show(
            "ready", f"{message}**{self._texts(kind, number=number)}**", go="start",
            back=progress.can_take_back,
        )  # fmt: skip
        self._notice = ""
        self._wait("next", back=progress.can_take_back)
        self._desk.show("wait", self._texts("wait"))

    def begun(self, interval: int) -> None:
        """Highlight the interval's marker."""
        self._empty()
        self._desk.light(interval, self._count)
        paced = self._desk.design.presentation.self_paced
        self._desk.show("feel", self._texts("feel"), enough=paced)

    def done(self) -> bool:
        """Return whether the participant wants to end the interval."""
        try:
            what, _ = self._desk.done.get_nowait()
        except queue.Empty:
            return False
        return what == "enough"

    def ended(self, interval: int) -> None:
        """Clear the interval's marker."""
        self._desk.light(0, self._count)
        self._desk.show("wait", "")

    def ask(self, trial: Trial, felt: list[PresentedInterval]) -> Reply:
        """Show the question and the controls for its answer."""
        self._empty()
        question = self._desk.design.question
        notice, self._notice = self._notice, ""
        self._desk.show("ask", f"{question}\n\n{notice}", kind=trial.kind)
        begun = self._clock()
        answer = self._wait("answer")
        seconds = self._clock() - begun
        missed = sum(int(interval.loop_report.get("misses", 0)) for interval in felt)
        level = "" if trial.level is None else f", level {trial.level:.4g}"
        right = {None: "", True: ", right", False: ", wrong"}
        self._say(
            f"trial {trial.number}{level}: {answer}{right[trial.is_right(answer)]}, "
            f"{seconds:.1f} s; {missed} ticks missed"
        )
        return Reply(answer, seconds)

    def refuse(self, why: str) -> None:
        """Show the reason with the question, which is asked again."""
        self._notice = why

    def feedback(self, right: bool) -> None:
        """Show the feedback before the next trial."""
        self._notice = self._texts("right" if right else "wrong")

    def rest(self, seconds: float, progress: Progress) -> None:
        """Show a break with its seconds, and the button when they are over."""
        texts, end = self._texts, self._clock() + seconds
        self._desk.progress(progress)
        self._desk.light(0, 0)
        self._say(f"break after {progress.done} trials, {seconds:.0f} s or longer")
        shown = 0
        while (left := math.ceil(end - self._clock())) > 0:
            if left != shown:
                shown = left
                self._desk.show("rest", f"{texts('break')} {texts('break_left', seconds=left)}")
            self._empty()
            time.sleep(_LOOKED)
        self._desk.show("rest", f"{texts('break')} {texts('break_over')}", go="go_on")
        self._wait("next")

    def taken_back(self) -> None:
        """Show it before the trial that comes again."""
        self._notice = self._texts("taken_back")
        self._say("the last answer was taken back")

    def last(self, progress: Progress) -> None:
        """Wait for the button that finishes, or the one that takes back the last answer."""
        self._desk.progress(progress)
        self._desk.show("last", self._texts("last"), go="finish", back=progress.can_take_back)
        self._wait("next", back=progress.can_take_back)

    def over(self, message: str) -> None:
        """Show the last message."""
        self._desk.light(0, 0)
        self._desk.show("over", message)

    def _wait(self, wanted: str, *, back: bool = False) -> Any:
        while True:
            try:
                what, value = self._desk.done.get(timeout=_LOOKED)
            except queue.Empty:
                continue
            if what == "pause":
                self._desk.show("over", self._texts("kept"))
                raise Paused
            if what == "back" and back:
                raise TakenBack
            if what == wanted:
                return value

    def _empty(self) -> None:
        """Discard actions made before the present stage."""
        while True:
            try:
                what, _ = self._desk.done.get_nowait()
            except queue.Empty:
                return
            if what == "pause":
                self._desk.show("over", self._texts("kept"))
                raise Paused


def panels(desk: ParticipantPanel, config: SessionConfig, *, show: bool) -> list[Panel]:
    """Return the panels of the page: the scene, the participant's panel, and mouse control."""
    stage = SceneView() if show else SmoothSceneView()
    return [stage, desk, *([MousePanel()] if config.is_mouse else [])]

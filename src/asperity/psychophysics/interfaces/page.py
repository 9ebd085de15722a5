"""An experiment in the live page: what the participant sees there, and what may not be seen.

The page shows the tool's outline where the hand has it, and a smooth scene: neither the relief of a
stimulus nor what contact makes of it, forces and contacts, unless the design says `show`. The
experimenter looks at the terminal that the command was given in.
"""

from __future__ import annotations

import queue
import time
from collections.abc import Callable
from dataclasses import replace
from html import escape
from typing import TYPE_CHECKING, Any

from asperity.errors import AsperityError
from asperity.psychophysics.design import ExperimentDesign
from asperity.psychophysics.interfaces.front import Paused, Progress, Reply
from asperity.psychophysics.session.trials import PresentedInterval, Trial
from asperity.realtime.servo.process import ServoSpec
from asperity.realtime.servo.running import Servo
from asperity.scene.scene import Scene
from asperity.viewer.panels.mouse import MousePanel
from asperity.viewer.panels.panel import Frame, Panel
from asperity.viewer.panels.scene_view import UNITS, SceneView
from asperity.viewer.servo_client import ServoClient
from asperity.viewer.session_config import SessionConfig

if TYPE_CHECKING:
    import viser

_LOOKED = 0.2
"""How often a wait looks for Ctrl-C [s]."""
_QUIET, _LIT = "#e8ecf0", "#0072B2"
_LAMP = (
    '<div style="flex:1;text-align:center;font-size:2em;font-weight:700;padding:0.3em;'
    'border-radius:0.3em;background:{back};color:{front}">{text}</div>'
)


def smooth(scene: Scene) -> Scene:
    """Return a scene without any texture, to be looked at."""
    return scene.changed(
        bodies={name: {"texture": None} for name in scene.document.get("bodies", {})}
    )


class TrialLink(ServoClient):
    """A page's link to the loop of whichever interval is being felt, and to none in between.

    Parameters
    ----------
    choice : Choice
        Device and rate; its scene is what is seen at first.
    show : bool
        Whether the scene of an interval is what is seen.
    """

    def __init__(self, choice: SessionConfig, *, show: bool = False) -> None:
        super().__init__(choice)
        self.state = "ended"
        self._show = show

    def start(self) -> None:
        """Start nothing: intervals do."""

    def __enter__(self) -> TrialLink:
        return self

    def spec(self, scene: Scene, seconds: float) -> ServoSpec:
        """Return what the servo process of an interval needs to know."""
        choice = replace(self.config, scene=scene, seconds=seconds)
        return choice.spec(self._folder / "pointed")

    def feel(self, servo: Servo | None) -> None:
        """Look at another loop, or at none."""
        with self._lock:
            self._servo = servo
            self.state = "ended" if servo is None else "running"
            if servo is not None:
                self.generation += 1
                if self._show:
                    self.config = replace(self.config, scene=servo.spec.scene)

    def change(self, **changes: Any) -> None:
        """Refuse: what is felt is the experiment's."""
        raise AsperityError("an experiment is going on; nothing can be changed")

    def restart(self, config: SessionConfig | None = None) -> Any:
        """Refuse, as `change`."""
        self.change()


class BlindStage(SceneView):
    """The smooth scene, with the tool where the hand has it: nothing tells of the texture."""

    def update(self, frame: Frame) -> None:
        """Move the tool to the hand."""
        snapshot = frame.snapshot
        pose = self._servo.target if snapshot is None else snapshot.handle_pose
        self._tool.position = tuple((UNITS * pose[:3]).tolist())
        self._tool.wxyz = tuple(pose[3:].tolist())
        self._ghost.visible = False


class Desk:
    """The participant's panel. Buttons put what was done into a queue.

    Parameters
    ----------
    design : Design
    """

    title = "Experiment"

    def __init__(self, design: ExperimentDesign) -> None:
        self.design = design
        self.done: queue.SimpleQueue[tuple[str, Any]] = queue.SimpleQueue()
        self.stage = ""
        """"welcome", "ready", "feel", "ask", "over"."""

    def build(self, server: viser.ViserServer, servo: ServoClient) -> None:
        """Make all controls; which of them are there depends on the moment."""
        gui: Any = server.gui
        self._title = gui.add_markdown(f"## {self.design.name}")
        self._text = gui.add_markdown(self.design.instructions)
        self._bar = gui.add_progress_bar(0.0)
        self._lamps = gui.add_html("")
        self._told = gui.add_markdown("")
        self._next = gui.add_button("Begin", icon="player-play", color="green")
        self._enough = gui.add_button("I have felt enough", icon="player-skip-forward")
        self._choices = [gui.add_button(str(i)) for i in range(1, 3)]
        self._entry = gui.add_text("answer", "")
        self._ok = gui.add_button("OK", icon="check", color="green")
        self._pause = gui.add_button("Go on another time", icon="player-pause", color="gray")
        self._next.on_click(lambda _: self.done.put(("next", None)))
        self._enough.on_click(lambda _: self.done.put(("enough", None)))
        self._ok.on_click(lambda _: self.done.put(("answer", self._entry.value)))
        self._pause.on_click(lambda _: self.done.put(("pause", None)))
        for i, button in enumerate(self._choices, 1):
            button.on_click(lambda _, i=i: self.done.put(("answer", i)))
        self.show("starting", "Please wait.")

    def show(
        self, stage: str, told: str = "", *, kind: str = "", enough: bool = False, go: str = "Begin"
    ) -> None:
        """Show what belongs to a moment of the session.

        Parameters
        ----------
        stage : str
        told : str
            A question or a notice.
        kind : str
            Of the trial that is asked about.
        enough : bool
            Whether an interval may be ended.
        go : str
            What the button says that goes on.
        """
        self.stage = stage
        asking = stage == "ask"
        self._text.visible = stage == "welcome"
        self._told.content = told
        self._next.label = go
        self._next.visible = stage in ("welcome", "ready")
        self._enough.visible = stage == "feel" and enough
        for button in self._choices:
            button.visible = asking and kind == "choice"
        self._entry.visible = self._ok.visible = asking and kind in ("number", "order")
        if asking:
            self._entry.value = ""
            self._entry.label = "number" if kind == "number" else "order, such as 2 1 3"
        self._pause.visible = stage in ("welcome", "ready", "ask")

    def light(self, interval: int, count: int) -> None:
        """Light the lamp of an interval, from 1; 0: none."""
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
        """Show how far the session is."""
        self._bar.value = 100.0 * progress.done / max(progress.most, 1)

    def update(self, frame: Frame) -> None:
        """Nothing moves by itself."""

    def close(self) -> None:
        """Whoever waits shall wait no more."""
        self.done.put(("pause", None))


class PageFront:
    """Asks in the page.

    Parameters
    ----------
    desk : Desk
        Built.
    say : callable
        What the experimenter is told, a line at a time.
    clock : callable
        Time now [s].
    """

    kind = "page"

    def __init__(
        self, desk: Desk, say: Callable[[str], None] = lambda _: None, *,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:  # fmt: skip
        self._desk, self._say, self._clock = desk, say, clock
        self._count = 0
        self._trial: Trial | None = None
        self._notice = ""

    def welcome(self, design: ExperimentDesign, progress: Progress) -> None:
        """Show the instructions."""
        again = f"The session goes on after {progress.done} answers." if progress.resumed else ""
        self._desk.progress(progress)
        self._desk.show("welcome", again)
        self._wait("next")

    def ready(self, trial: Trial, progress: Progress) -> None:
        """Wait for the button."""
        self._count = len(trial.stimuli)
        self._desk.progress(progress)
        self._desk.light(0, self._count)
        kind = "Practice" if trial.practice else "Trial"
        told = f"{self._notice}\n\n" if self._notice else ""
        self._desk.show("ready", f"{told}**{kind} {trial.number}**", go="Start")
        self._notice, self._trial = "", trial
        self._wait("next")
        self._desk.show("wait", "Please wait.")

    def begun(self, interval: int) -> None:
        """Light its lamp."""
        self._empty()
        self._desk.light(interval, self._count)
        paced = self._desk.design.presentation.self_paced
        self._desk.show("feel", "Feel it now.", enough=paced)

    def done(self) -> bool:
        """Return whether the participant has felt enough."""
        try:
            what, _ = self._desk.done.get_nowait()
        except queue.Empty:
            return False
        return what == "enough"

    def ended(self, interval: int) -> None:
        """Put its lamp out."""
        self._desk.light(0, self._count)
        self._desk.show("wait", "")

    def ask(self, trial: Trial, felt: list[PresentedInterval]) -> Reply:
        """Show the question and what it is answered with."""
        self._empty()
        question = self._desk.design.question
        notice, self._notice = self._notice, ""
        self._desk.show("ask", f"{question}\n\n{notice}", kind=trial.kind)
        begun = self._clock()
        answer = self._wait("answer")
        seconds = self._clock() - begun
        missed = sum(int(interval.told.get("misses", 0)) for interval in felt)
        level = "" if trial.level is None else f", level {trial.level:.4g}"
        right = {None: "", True: ", right", False: ", wrong"}
        self._say(
            f"trial {trial.number}{level}: {answer}{right[trial.is_right(answer)]}, "
            f"{seconds:.1f} s; {missed} ticks missed"
        )
        return Reply(answer, seconds)

    def refuse(self, why: str) -> None:
        """Say why, with the question."""
        self._notice = why

    def feedback(self, right: bool) -> None:
        """Say so before the next trial."""
        self._notice = "That was right." if right else "That was wrong."

    def over(self, told: str) -> None:
        """Say so."""
        self._desk.light(0, 0)
        self._desk.show("over", told)

    def _wait(self, wanted: str) -> Any:
        while True:
            try:
                what, value = self._desk.done.get(timeout=_LOOKED)
            except queue.Empty:
                continue
            if what == "pause":
                self._desk.show("over", "All answers are kept. You may close this page.")
                raise Paused
            if what == wanted:
                return value

    def _empty(self) -> None:
        """Forget what was pressed before it was asked for."""
        while True:
            try:
                what, _ = self._desk.done.get_nowait()
            except queue.Empty:
                return
            if what == "pause":
                raise Paused


def panels(desk: Desk, choice: SessionConfig, *, show: bool) -> list[Panel]:
    """Return what the participant has: the scene, the desk, and for a mouse its hand."""
    stage = SceneView() if show else BlindStage()
    return [stage, desk, *([MousePanel()] if choice.is_mouse else [])]

"""Pause, and a slider through the last seconds or a recording, which the whole page follows."""

from __future__ import annotations

from typing import Any

from asperity.viewer.panels.panel import Frame, Panel, ViserServer
from asperity.viewer.servo_client import ServoClient
from asperity.viewer.timeline import Timeline

_SPEEDS = {"1 x": 1.0, "1/4 x": 0.25, "1/10 x": 0.1, "1/50 x": 0.02}
_EVERY = 3
_STEP = 1e-3
_NOW = "Showing **now**. *Pause* keeps the last seconds for viewing; the loop goes on."


class TimePanel(Panel):
    """The time that is shown: buttons to pause, play and return to the present, and a slider.

    Parameters
    ----------
    timeline : Timeline
    live : bool
        Whether there is a present to return to.
    """

    title = "Plots"

    def __init__(self, timeline: Timeline, *, live: bool = True) -> None:
        self._timeline, self._has_now = timeline, live
        self._shown: tuple[Any, ...] = ()
        self._followed = 0.0

    def build(self, server: ViserServer, servo: ServoClient) -> None:
        """Add the controls."""
        gui = server.gui
        self._pause = gui.add_button("Pause", icon="player-pause")
        self._play = gui.add_button("Play", icon="player-play", visible=False)
        self._now = gui.add_button("Back to now", visible=False)
        self._slider = gui.add_slider("Time [s]", 0.0, 1.0, _STEP, 0.0, visible=False)
        self._speed = gui.add_dropdown("Speed", tuple(_SPEEDS), initial_value="1 x", visible=False)
        self._message = gui.add_markdown(_NOW)
        self._pause.on_click(lambda _: self._timeline.hold())
        self._play.on_click(lambda _: self._play_or_stop())
        self._now.on_click(lambda _: self._timeline.go_live())
        self._slider.on_update(self._moved)
        self._speed.on_update(self._sped)

    def update(self, frame: Frame) -> None:
        """Advance the timeline, and show its position."""
        timeline = self._timeline
        timeline.advance(frame)
        if frame.number % _EVERY:
            return
        longest = max(timeline.length, _STEP)
        if self._slider.max != longest:
            self._slider.value, self._followed = 0.0, 0.0
            self._slider.max = longest
        # Send only movements of the timeline itself: a movement of the slider by the user arrives
        # here before the timeline knows of it, and would be undone.
        if timeline.at != self._followed:
            self._followed = timeline.at
            if abs(self._slider.value - timeline.at) > _STEP:
                self._slider.value = timeline.at
        shown = (timeline.what, timeline.is_live, timeline.playing, round(timeline.at, 3))
        if shown == self._shown:
            return
        self._shown = shown
        self._pause.visible = timeline.is_live
        self._play.visible = self._slider.visible = self._speed.visible = not timeline.is_live
        self._now.visible = self._has_now and not timeline.is_live
        self._play.label = "Stop" if timeline.playing else "Play"
        self._message.content = _NOW if timeline.is_live else (
            f"Showing **{timeline.what}**: {timeline.at:.3f} of {timeline.length:.2f} s."
        )  # fmt: skip

    def _play_or_stop(self) -> None:
        if self._timeline.playing:
            self._timeline.playing = False
        else:
            self._timeline.play()

    def _moved(self, event: Any) -> None:
        # An event without a client comes from the page itself.
        if event.client is not None:
            self._timeline.playing = False
            self._timeline.move_to(self._slider.value)

    def _sped(self, _: object) -> None:
        self._timeline.speed = _SPEEDS[self._speed.value]

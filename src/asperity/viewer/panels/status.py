"""The state of the loop: numbers that change colour when something is wrong."""

from __future__ import annotations

from html import escape
from typing import Any

import numpy as np

from asperity.drawing.pages import render
from asperity.viewer.drawables.colours import DOUBTFUL, HELD, WELL, WRONG
from asperity.viewer.loop_health import LoopHealth, Trouble
from asperity.viewer.notify import attempt
from asperity.viewer.panels.panel import Frame, Panel, ViserServer
from asperity.viewer.servo_client import ServoClient
from asperity.viewer.timeline import Timeline

_USUAL = 12.0
"""Updates of the numbers in which 63 % of the progress bar fill while a loop is made ready."""
EVERY = 8
"""Page updates between two updates of the numbers."""
_MISSES, _FALLBACKS = 0.02, 0.10
"""Shares of a second's ticks shown as wrong; smaller ones are doubtful; project defaults."""


_BANNER = (
    '<div role="alert" style="margin:0.2em 1em;padding:0.4em 0.6em;font-size:0.85em;'
    'border-left:4px solid #c62828;background:#fdecea;color:#611a15"><b>{}</b> {}</div>'
)
_LINE = (
    '<div role="status" style="padding:0.3em 1em;font-size:0.9em;font-weight:600;color:{colour}">'
    '<span style="display:inline-block;width:0.6em;height:0.6em;border-radius:50%;'
    'margin-right:0.4em;background:{colour}"></span>{text}</div>'
)


def mode_of(timeline: Timeline) -> str:
    """Return whether a page that is not live is paused or replays, and where."""
    place = f"{timeline.at:.2f} of {timeline.length:.2f} s"
    if timeline.playing:
        return f"Replaying {timeline.what}: {place}"
    return f"Paused in {timeline.what}: {place}"


def judged(value: float, doubtful: float, wrong: float) -> str:
    """Return the colour of a number that should be small."""
    return WRONG if value > wrong else DOUBTFUL if value > doubtful else WELL


def rows_of(frame: Frame, wanted: float) -> list[tuple[str, str, str, str]]:
    """Return the table of a frame: name, value, unit and colour of each row.

    Parameters
    ----------
    frame : Frame
    wanted : float
        Nominal ticks per second [Hz].
    """
    snapshot = frame.live
    if snapshot is None:
        return [("loop", "starting", "", DOUBTFUL)]
    tick_us, contact_us = 1e6 * snapshot.tick_p99, 1e6 * snapshot.contact_p99
    period = 1e6 / wanted
    lag = 1.0 - frame.rate / wanted
    return [
        ("rate", f"{frame.rate:.0f}", f"of {wanted:.0f} Hz", judged(lag, 0.02, 0.1)),
        ("tick, p99", f"{tick_us:.0f}", "us", judged(tick_us, 0.5 * period, period)),
        ("contact, p99", f"{contact_us:.0f}", "us", judged(contact_us, period, 10.0 * period)),
        ("misses", f"{frame.misses}", "in 1 s", judged(frame.misses, 0, _MISSES * wanted)),
        ("fallbacks", f"{frame.fallbacks}", "in 1 s",
         judged(frame.fallbacks, 0, _FALLBACKS * wanted)),
        ("passivity", f"{frame.interventions}", "in 1 s",
         judged(frame.interventions, 0, 0.05 * wanted)),
        ("clamped", f"{frame.clamps}", "in 1 s", judged(frame.clamps, 0, 0.05 * wanted)),
        ("silences", f"{snapshot.silences}", "in all", judged(snapshot.silences, 0, 10)),
        ("misses", f"{snapshot.misses}", "in all",
         judged(snapshot.misses / max(snapshot.ticks, 1), 0.001, _MISSES)),
    ]  # fmt: skip


def table(rows: list[tuple[str, str, str, str]]) -> str:
    """Return the rows as an HTML table."""
    return render("live_status.html", rows=rows)


class StatusPanel(Panel):
    """The state of the page and of the loop, above all tabs.

    Parameters
    ----------
    timeline : Timeline, optional
        Where the page is paused or replays.
    """

    title = ""

    def __init__(self, timeline: Timeline | None = None) -> None:
        self._timeline = timeline
        self._health = LoopHealth()
        self._scene, self._busy = "", 0
        self.trouble: Trouble | None = None
        """What is wrong with the loop."""

    def build(self, server: ViserServer, servo: ServoClient) -> None:
        """Add the table, and a button to restart a loop that has ended."""
        self._servo = servo
        gui = server.gui
        self._server = server
        self._line = gui.add_html("", order=-9.0)
        self._banner = gui.add_html("", order=-7.0, visible=False)
        self._progress = gui.add_progress_bar(0.0, order=-8.0, visible=False)
        self._now = gui.add_button(
            "Back to live", icon="player-skip-forward", visible=False, order=-7.5,
            hint="The loop has gone on; show it again",
        )  # fmt: skip
        self._now.on_click(self._back)
        self._restart = gui.add_button(
            "Restart the loop", color="red", icon="refresh", visible=False, order=-6.0
        )
        self._restart.on_click(self._restarted)
        with gui.add_folder("Loop", order=1e6, expand_by_default=True):
            self._numbers = gui.add_html("")

    def update(self, frame: Frame) -> None:
        """Update the numbers, every `EVERY` updates of the page."""
        servo = self._servo
        self.trouble = self._health.trouble(frame, servo.parameters.rate)
        if frame.number % EVERY:
            return
        if self._scene != servo.config.scene.name:
            self._scene = servo.config.scene.name
            self._server.gui.set_panel_label(f"asperity: {self._scene}")
        self._show_time()
        self._show_trouble()
        line, colour = self._state(frame)
        _set(
            self._line,
            "content",
            _LINE.format(colour=colour, text=escape(line)),
        )
        _set(self._restart, "visible", servo.state == "ended")
        _set(self._numbers, "content", table(rows_of(frame, servo.parameters.rate)))

    def _state(self, frame: Frame) -> tuple[str, str]:
        servo = self._servo
        scene = servo.config.scene.name
        if servo.state == "ended":
            return f"The loop has ended: {servo.message}", WRONG
        if servo.state == "starting":
            return f"{scene}: starting ...", DOUBTFUL
        doing = " · making ready ..." if servo.state == "changing" else ""
        force = 0.0
        if frame.snapshot is not None:
            fx, fy, fz = frame.snapshot.device_wrench[:3].tolist()
            force = (fx * fx + fy * fy + fz * fz) ** 0.5
        time = self._timeline
        if time is not None and not time.is_live:
            doing = f" · {force:.2f} N then; the loop goes on{doing}"
            return f"{mode_of(time)}{doing}", HELD
        return f"{scene} · {servo.device} · {force:.2f} N{doing}", DOUBTFUL if doing else WELL

    def _show_time(self) -> None:
        """Show that the page is paused or replays, how far it is, and the way back."""
        time = self._timeline
        held = time is not None and not time.is_live
        busy = self._servo.state in ("starting", "changing")
        _set(self._now, "visible", held)
        _set(self._progress, "visible", held or busy)
        if busy:
            # How long it takes is not known; it approaches the end.
            self._busy += 1
            share = 100.0 * (1.0 - np.exp(-self._busy / _USUAL))
            _set(self._progress, "value", round(float(share), 1))
            return
        self._busy = 0
        if held and time is not None:
            share = 100.0 * time.at / max(time.length, 1e-9)
            _set(self._progress, "value", round(share, 1))

    def _show_trouble(self) -> None:
        trouble = self.trouble
        _set(self._banner, "visible", trouble is not None)
        if trouble is not None:
            _set(self._banner, "content", _BANNER.format(*map(escape, trouble[:2])))

    def _back(self, _: Any) -> None:
        if self._timeline is not None:
            self._timeline.go_live()

    def _restarted(self, event: Any) -> None:
        attempt(event, "Restart", lambda: self._servo.restart().result())


def _set(handle: Any, name: str, value: Any) -> None:
    """Set a property if it changes, as each setting sends a message to all tabs."""
    if getattr(handle, name) != value:
        setattr(handle, name, value)

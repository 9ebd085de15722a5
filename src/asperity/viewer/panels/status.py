"""The state of the loop: numbers that change colour when something is wrong."""

from __future__ import annotations

from html import escape
from typing import Any

from asperity.drawing.pages import render
from asperity.viewer.drawables.colours import DOUBTFUL, WELL, WRONG
from asperity.viewer.notify import attempt
from asperity.viewer.panels.panel import Frame, Panel, ViserServer
from asperity.viewer.servo_client import ServoClient

EVERY = 8
"""Page updates between two updates of the numbers."""
_MISSES, _FALLBACKS = 0.02, 0.10
"""Shares of a second's ticks shown as wrong; smaller ones are doubtful; project defaults."""


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
    snapshot = frame.snapshot
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
    """The state of the loop, above all tabs."""

    title = ""

    def build(self, server: ViserServer, servo: ServoClient) -> None:
        """Add the table, and a button to restart a loop that has ended."""
        self._servo = servo
        gui = server.gui
        self._line = gui.add_html("", order=-3.0)
        self._restart = gui.add_button(
            "Restart the loop", color="red", icon="refresh", visible=False, order=-2.0
        )
        self._restart.on_click(self._restarted)
        with gui.add_folder("Loop", order=1e6, expand_by_default=True):
            self._numbers = gui.add_html("")

    def update(self, frame: Frame) -> None:
        """Update the numbers, every `EVERY` updates of the page."""
        if frame.number % EVERY:
            return
        servo = self._servo
        line, colour = self._state(frame)
        _set(
            self._line,
            "content",
            f'<div style="padding:0.3em 1em;font-size:0.9em;color:{colour};font-weight:600">'
            f"{escape(line)}</div>",
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
        doing = "; preparing another loop ..." if servo.state == "changing" else ""
        force = 0.0
        if frame.snapshot is not None:
            fx, fy, fz = frame.snapshot.device_wrench[:3].tolist()
            force = (fx * fx + fy * fy + fz * fz) ** 0.5
        return f"{scene} · {servo.device} · {force:.2f} N{doing}", DOUBTFUL if doing else WELL

    def _restarted(self, event: Any) -> None:
        attempt(event, "Restart", lambda: self._servo.restart().result())


def _set(handle: Any, name: str, value: Any) -> None:
    """Set a property if it changes, as each setting sends a message to all tabs."""
    if getattr(handle, name) != value:
        setattr(handle, name, value)

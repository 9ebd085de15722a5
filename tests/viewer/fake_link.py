"""A link without a servo process: rows as of a loop, at the wall clock's pace or when asked."""

import threading
import time

import numpy as np

from asperity.realtime.servo.parameters import LiveParameters
from asperity.realtime.servo.tick_row import WIDTH, slices
from asperity.scene.builtin import load_scene
from asperity.viewer.history import History
from asperity.viewer.replayed_contacts import empty_moment
from asperity.viewer.session_config import SessionConfig

PLACES = slices()
RATE = 1000.0
SPEED, SHAKE, FREQUENCY = 0.08, 2e-6, 100.0
"""A slide along x at 80 mm/s that shakes at 100 Hz: 0.79 m/s^2."""


def rows_at(first, count, rate=RATE):
    """Return rows of a slide that shakes, from a tick on."""
    time_ = (first + np.arange(count)) / rate
    rows = np.zeros((count, WIDTH))
    rows[:, PLACES["time"].start] = time_
    wave = np.cos(2.0 * np.pi * FREQUENCY * time_)
    for name in ("handle_pose", "tool_pose"):
        place = PLACES[name].start
        rows[:, place] = SPEED * time_ + SHAKE * wave
        rows[:, place + 3] = 1.0
    for name in ("contact_wrench", "device_wrench"):
        place = PLACES[name].start
        rows[:, place], rows[:, place + 2] = 0.2 * wave, 0.6
        rows[:, place + 4] = 5e-3 * wave
    rows[:, PLACES["contact_count"].start] = 1
    rows[:, PLACES["penetration_depth"].start] = 1e-4 * (1.0 + 0.5 * wave)
    return rows


class FakeLink:
    """What the page asks of a link. `give` adds rows; `run` does so as time goes by."""

    def __init__(self):
        self.choice = SessionConfig(load_scene("probe-plate"), "probe-plate")
        self.history = History()
        self.generation, self.is_alive = 1, True
        self.state, self.told, self.device = "running", "", "a slide that shakes"
        self.parameters = LiveParameters.of(self.choice.scene, RATE)
        self.ticks = 0
        self._taps = []
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def give(self, seconds):
        rows = rows_at(self.ticks, max(round(seconds * RATE), 0))
        self.ticks += len(rows)
        self.history.add(rows)
        for take in tuple(self._taps):
            take(rows.copy())
        return rows

    def latest(self):
        rows, _ = self.history.since(self.history.count - 1)
        if not len(rows):
            return None
        row = rows[-1]
        return empty_moment()._replace(
            time=float(row[0]), ticks=self.ticks, tool_pose=row[PLACES["tool_pose"]].copy(),
            handle_pose=row[PLACES["handle_pose"]].copy(),
        )  # fmt: skip

    def rows_since(self, number):
        return self.history.since(number)

    def tap(self, take):
        self._taps.append(take)
        return lambda: self._taps.remove(take)

    def _run(self):
        begun = time.perf_counter() - self.ticks / RATE
        while not self._over.wait(1 / 60):
            self.give(time.perf_counter() - begun - self.ticks / RATE)

    def __enter__(self):
        self._thread.start()
        return self

    def __exit__(self, *_):
        self._over.set()
        self._thread.join()

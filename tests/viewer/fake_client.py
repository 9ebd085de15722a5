"""A servo client without a servo process: ticks at the wall clock's pace or on request."""

import threading
import time

import numpy as np

from asperity.realtime.servo.ipc import TICK
from asperity.realtime.servo.parameters import LiveParameters
from asperity.scene.builtin import load_scene
from asperity.viewer.replayed_contacts import empty_snapshot
from asperity.viewer.session_config import SessionConfig
from asperity.viewer.tick_buffer import TickBuffer

RATE = 1000.0
SPEED, SHAKE, FREQUENCY = 0.08, 2e-6, 100.0
"""A slide along x at 80 mm/s that shakes at 100 Hz: 0.79 m/s^2."""


def ticks_at(first, count, rate=RATE):
    """Return ticks of a slide that shakes, from a tick on."""
    time_ = (first + np.arange(count)) / rate
    ticks = np.zeros(count, TICK)
    ticks["time"] = time_
    wave = np.cos(2.0 * np.pi * FREQUENCY * time_)
    for name in ("handle_pose", "tool_pose"):
        ticks[name][:, 0] = SPEED * time_ + SHAKE * wave
        ticks[name][:, 3] = 1.0
    for name in ("contact_wrench", "device_wrench"):
        ticks[name][:, 0], ticks[name][:, 2] = 0.2 * wave, 0.6
        ticks[name][:, 4] = 5e-3 * wave
    ticks["contact_count"] = 1
    ticks["penetration_depth"] = 1e-4 * (1.0 + 0.5 * wave)
    return ticks


class FakeServoClient:
    """What the page needs of a servo client. `give` adds ticks; in a `with`, time does."""

    def __init__(self):
        self.config = SessionConfig(load_scene("probe-plate"), "probe-plate")
        self.history = TickBuffer()
        self.generation, self.is_alive = 1, True
        self.state, self.message, self.device = "running", "", "a slide that shakes"
        self.parameters = LiveParameters.of(self.config.scene, RATE)
        self.ticks = 0
        self._subscribers = []
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def give(self, seconds):
        ticks = ticks_at(self.ticks, max(round(seconds * RATE), 0))
        self.ticks += len(ticks)
        self.history.add(ticks)
        for take in tuple(self._subscribers):
            take(ticks.copy())
        return ticks

    def latest(self):
        return self.live()

    def live(self):
        ticks, _ = self.history.since(self.history.count - 1)
        if not len(ticks):
            return None
        tick = ticks[-1]
        return empty_snapshot()._replace(
            time=float(tick["time"]), ticks=self.ticks, tool_pose=tick["tool_pose"].copy(),
            handle_pose=tick["handle_pose"].copy(),
        )  # fmt: skip

    def ticks_since(self, number):
        return self.history.since(number)

    def subscribe(self, take):
        self._subscribers.append(take)
        return lambda: self._subscribers.remove(take)

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

"""A loop whose time, device and contacts are turned by hand: its timing without any time."""

from __future__ import annotations

import math

import numpy as np

from asperity.dynamics.linear_contact import LinearContact
from asperity.dynamics.passivity.controller import PassivityController
from asperity.dynamics.virtual_coupling.coupled_tool import CoupledTool
from asperity.dynamics.virtual_coupling.settings import CouplingSettings
from asperity.geometry.rigid_body import RigidBody
from asperity.realtime.devices.mapping import Mapping
from asperity.realtime.devices.protocol import Limits, Reading
from asperity.realtime.servo.contact_worker import ContactResult
from asperity.realtime.servo.loop import ServoLoop
from asperity.realtime.servo.safety import SafeDevice, SafetySettings

DT = 1e-3
LIMITS = Limits(
    max_force=3.0, max_torque=0.1, max_stiffness=2000.0, max_damping=20.0,
    max_rotational_stiffness=5.0, radius=0.05, torque_dof=3,
)  # fmt: skip
QUICK = SafetySettings(slew=0.0, soft_start=0.0)
WALL = 500.0
"""Stiffness of the scene's one wall, whose surface is z = 0 [N/m]."""


class HandClock:
    """Time stands still but while somebody sleeps, or is said to work."""

    def __init__(self) -> None:
        self.time = 100.0
        self.slept: list[float] = []
        self.given_way = 0

    def now(self) -> float:
        # Looking takes a little, so that waiting by looking ends.
        self.time += 1e-7
        return self.time

    def sleep(self, seconds: float) -> None:
        assert seconds > 0.0
        self.slept.append(seconds)
        self.time += seconds

    def give_way(self) -> None:
        self.given_way += 1
        self.time += 1e-6

    def work(self, seconds: float) -> None:
        self.time += seconds


class ScriptedDevice:
    """At `pose(t)`; `hold_up(t)` says how long a reading takes. Keeps what it is sent."""

    name = "scripted"
    limits = LIMITS

    def __init__(self, clock: HandClock) -> None:
        self.clock = clock
        self.begin = clock.time
        self.pose = lambda t: np.array([0.0, 0.0, -1e-3, 1.0, 0.0, 0.0, 0.0])
        self.twist = lambda t: np.zeros(6)
        self.hold_up = lambda t: 0.0
        self.fresh = lambda t: True
        self.age = lambda t: 0.0
        self.written: list[tuple[float, np.ndarray]] = []
        self.closed = 0

    def open(self) -> None:
        pass

    def read(self, out: Reading) -> bool:
        t = self.clock.time - self.begin
        self.clock.work(self.hold_up(t))
        fresh = self.fresh(t)
        if isinstance(fresh, Exception):
            raise fresh
        if fresh:
            out.pose[:], out.twist[:], out.age = self.pose(t), self.twist(t), self.age(t)
        return fresh

    def write(self, wrench: np.ndarray) -> None:
        self.written.append((self.clock.time, wrench.copy()))

    def close(self) -> None:
        self.closed += 1

    @property
    def forces(self) -> np.ndarray:
        return np.array([wrench[2] for _, wrench in self.written])


class WallContacts:
    """Contacts with a plane at z = 0; the n-th takes `takes(n)` seconds, beside the loop."""

    def __init__(self, clock: HandClock, takes=lambda n: 1e-4) -> None:
        self.clock, self.takes = clock, takes
        self.latest, self._next = ContactResult(), ContactResult()
        self.busy = False
        self.submitted: list[tuple[float, bool]] = []
        self.rests = 0

    def submit(self, pose: np.ndarray, now: float, *, jumped: bool = False) -> None:
        assert not self.busy
        self.busy = True
        self._ready = self.clock.time + self.takes(len(self.submitted))
        self.submitted.append((now, jumped))
        self._next.submitted = now
        self._next.seconds = self._ready - now
        wrench, stiffness = np.zeros(6), np.zeros((6, 6))
        if pose[2] < 0.0:
            wrench[2], stiffness[2, 2] = -WALL * pose[2], WALL
        self._next.linear = LinearContact(pose.copy(), wrench, stiffness, int(pose[2] < 0.0), 0)

    def take(self) -> bool:
        if not self.busy or self.clock.time < self._ready:
            return False
        self.busy = False
        self.latest, self._next = self._next, self.latest
        return True

    def wait(self, seconds: float) -> bool:
        self.rest(seconds)
        return self.take()

    def rest(self, seconds: float) -> None:
        self.rests += 1
        if self.busy:
            self.clock.time = min(
                self.clock.time + max(seconds, 0.0), max(self._ready, self.clock.time)
            )


def body() -> RigidBody:
    return RigidBody(0.05, np.zeros(3), np.full(3, 2e-5), np.eye(3))


class Bench:
    """A loop with everything by hand."""

    def __init__(
        self,
        *,
        mode: str = "direct",
        takes=lambda n: 1e-4,
        settings=QUICK,
        **options,
    ) -> None:
        self.clock = HandClock()
        self.device = ScriptedDevice(self.clock)
        self.safe = SafeDevice(self.device, dt=DT, settings=settings)
        self.contacts = WallContacts(self.clock, takes)
        self.tool = CoupledTool(body(), CouplingSettings(mode=mode), dt=DT, limits=LIMITS)
        self.loop = ServoLoop(
            self.safe, Mapping(LIMITS), self.tool, self.contacts,
            PassivityController(DT, active=False),
            dt=DT, clock=self.clock, **options,
        )  # fmt: skip

    def run(self, ticks: int, **options) -> None:
        self.loop.begin(None)
        # Of those in which the tool was put at rest, the last one is there for the first tick.
        del self.contacts.submitted[:-1]
        self.contacts.rests = 0
        self.device.begin = self.clock.time
        self.loop.run(ticks=ticks, **options)

    @property
    def stats(self):
        return self.loop.stats


def wave(t: float) -> np.ndarray:
    """Down into the wall and out of it, twice a second."""
    return np.array([0.0, 0.0, -1e-3 * math.sin(4.0 * math.pi * t), 1.0, 0.0, 0.0, 0.0])

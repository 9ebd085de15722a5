"""A device with faults on request, which records every wrench that it is sent."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from asperity.realtime.devices.protocol import Limits, Reading
from asperity.realtime.shared_file import SharedFile

LIMITS = Limits(
    max_force=3.0, max_torque=0.1, max_stiffness=2000.0, max_damping=20.0,
    max_rotational_stiffness=5.0, radius=0.05, torque_dof=3,
)  # fmt: skip
ROOM = 60_000


@dataclass(frozen=True)
class Fault:
    """`kind` happens from `begin` on for `length` [s]."""

    kind: str
    begin: float
    length: float


class FakeDevice:
    """A hand that strokes to and fro and presses, behind a device with faults.

    Everything that is written is kept in a shared file: time, force and torque.
    """

    name = "fake"
    limits = LIMITS

    def __init__(self, log: Path, faults: tuple[Fault, ...] = (), depth: float = 3.2e-3) -> None:
        self._log, self._faults, self._depth = Path(log), faults, depth
        self._stalled = False
        self._begin = 0.0

    def open(self) -> None:
        file = SharedFile(self._log, 8 * (2 + 7 * ROOM))
        self._count = file.array(np.int64, (2,))
        self._rows = file.array(np.float64, (ROOM, 7), 16)

    def read(self, out: Reading) -> bool:
        if self._begin == 0.0:
            self._begin = time.perf_counter()
        t = time.perf_counter() - self._begin
        kind = self.fault(t)
        if kind == "raise":
            raise RuntimeError("cable out")
        if kind == "disconnect":
            out.error = "no device"
            return False
        if kind == "stall" and not self._stalled:
            self._stalled = True
            time.sleep(0.3)
        z = -0.5 * self._depth * (1.0 - math.cos(min(2.0 * math.pi * t, math.pi)))
        out.pose[:] = (5e-3 * math.sin(4.0 * t), 0.0, z, 1.0, 0.0, 0.0, 0.0)
        out.twist[:] = (20e-3 * math.cos(4.0 * t), 0.0, 0.0, 0.0, 0.0, 0.0)
        out.age = 0.0
        if kind == "stale":
            out.age = 0.5
        elif kind == "nan":
            out.pose[int(t * 1000) % 7] = math.nan
        elif kind == "nan-twist":
            out.twist[2] = math.inf
        elif kind == "huge":
            out.pose[:3] = (1e9, -1e30, 1e200)
            out.twist[:] = 1e12
        elif kind == "far":
            out.pose[:3] = (0.02, 0.0, -0.06)
        return True

    def fault(self, t: float) -> str:
        for fault in self._faults:
            if fault.begin <= t < fault.begin + fault.length:
                return fault.kind
        return ""

    def write(self, wrench: np.ndarray) -> None:
        at = int(self._count[0])
        if at < ROOM:
            self._rows[at, 0] = time.perf_counter() - self._begin
            self._rows[at, 1:] = wrench
            self._count[0] = at + 1

    def close(self) -> None:
        self._count[1] = 1


@dataclass
class Written:
    """What a `FakeDevice` was sent."""

    time: np.ndarray
    wrench: np.ndarray
    closed: bool

    @staticmethod
    def read(log: Path) -> Written:
        file = SharedFile(log)
        count = file.array(np.int64, (2,))
        rows = file.array(np.float64, (ROOM, 7), 16)[: int(count[0])]
        return Written(rows[:, 0].copy(), rows[:, 1:].copy(), bool(count[1]))

    @property
    def force(self) -> np.ndarray:
        return np.linalg.norm(self.wrench[:, :3], axis=1)

    @property
    def torque(self) -> np.ndarray:
        return np.linalg.norm(self.wrench[:, 3:], axis=1)

    def assert_safe(self) -> None:
        assert len(self.time) > 0
        assert np.isfinite(self.wrench).all()
        assert self.force.max() <= LIMITS.max_force * (1 + 1e-9)
        assert self.torque.max() <= LIMITS.max_torque * (1 + 1e-9)


def make(log: Path, faults: tuple[Fault, ...] = (), **options: float) -> FakeDevice:
    return FakeDevice(log, faults, **options)

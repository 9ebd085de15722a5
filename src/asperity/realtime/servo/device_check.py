"""The check of a device behind `asperity devices check NAME`.

    listen      how many poses it sends, and how noisy they are
    axes        the user pushes right, away, up: finds the axes and whether they are right-handed
    home        the user chooses the middle of the workspace
    force       along each axis a force rises to 0.5 N and falls again; the end effector has to
                move in its direction and must not run away

The force is cut at once, and the check fails, if the end effector leaves 30 mm or moves faster than
0.3 m/s, if the device reports an error, or if anything raises; zero is sent before anything else.
Everything goes through a `SafeDevice` as in a session, which limits the force to 0.5 N whatever is
requested here. If readings only become stale, which happens on a busy computer, the force is cut
and the test of that axis begins again when they return, at most `_MAX_STALLS` times. Time, waiting
and the user are injected.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from asperity.errors import AsperityError
from asperity.realtime.devices.calibration import Calibration
from asperity.realtime.devices.protocol import Device, Reading
from asperity.realtime.servo.safety import SafeDevice, SafetySettings

TOP_FORCE = 0.5
"""Largest force of the check [N]."""
RUN_AWAY_DISTANCE, RUN_AWAY_SPEED = 0.03, 0.3
"""Largest distance from where the force began [m], and largest speed [m/s]."""
_LISTEN = 1.0
_RISE, _STAY, _FALL = 1.0, 0.3, 0.3
_TICK = 1e-3
_LONGEST_AGE = 0.05
_MAX_STALLS = 10
_RECOVERY = 1.0
_SAFETY = SafetySettings(
    max_force=TOP_FORCE, max_torque=0.0, soft_start=0.0, silent_after=_LONGEST_AGE
)
"""No soft start, as the force rises slowly anyway; more patience, as the computer may be busy."""
_LEAST_PUSH = 0.015
_SEEN = 2e-4
_DIRECTIONS = ("to the RIGHT", "AWAY from you", "UP")


@dataclass(frozen=True)
class CheckOutcome:
    """Result of a check: `calibration`, ready to be saved, and `notes`, lines to show."""

    calibration: Calibration
    notes: tuple[str, ...]


def check_device(
    device: Device,
    *,
    home: tuple[float, float, float] = (0.0, 0.0, 0.0),
    ask: Callable[[str], None] | None = None,
    tell: Callable[[str], None] = print,
    clock: Callable[[], float] = time.monotonic,
    sleep: Callable[[float], None] = time.sleep,
) -> CheckOutcome:
    """Check a device in its vendor's axes; it must not be open, and is left closed.

    Parameters
    ----------
    device : Device
        From `catalogue.device(name, calibrated=False)`.
    home : tuple of float
        Home to assume if there is no user [m].
    ask : callable, optional
        Shows a request and returns when the user has fulfilled it. None: no user is present; axes
        and home are then assumed, and only readings and forces are checked.
    tell : callable
        Shows a line.
    clock, sleep : callable
        Monotonic time, and waiting [s].

    Raises
    ------
    AsperityError
        The device failed the check; the message names the step.
    """
    safe = SafeDevice(device, dt=_TICK, settings=_SAFETY)
    check = _Check(safe, ask, tell, clock, sleep)
    safe.open()
    try:
        safe.begin(clock())
        check.listen()
        axes, home = (check.axes(), check.home()) if ask else (("+x", "+y", "+z"), home)
        force = check.forces(axes)
        return CheckOutcome(Calibration(axes, home, force), tuple(check.notes))
    finally:
        safe.close()


@dataclass
class _Check:
    device: SafeDevice
    ask: Callable[[str], None] | None
    tell: Callable[[str], None]
    clock: Callable[[], float]
    sleep: Callable[[float], None]
    notes: list[str] = field(default_factory=list)
    stalls: int = 0

    @property
    def reading(self) -> Reading:
        return self.device.raw_reading

    def listen(self) -> None:
        """Read for a second: count the poses, measure their noise, stop on errors."""
        positions, new, errors = self._read_without_force(_LISTEN)
        if new < 10:
            raise AsperityError(
                f"{self.device.name} sent {new} new poses in {_LISTEN:g} s"
                + (f": {errors[-1]}" if errors else "; is it switched on?")
            )
        if errors:
            raise AsperityError(f"{self.device.name}: {errors[-1]}")
        spread = float(np.linalg.norm(positions.std(axis=0)))
        self._note(
            f"{new / _LISTEN:.0f} new poses a second; moved {spread * 1e3:.3f} mm (rms) meanwhile"
        )

    def axes(self) -> tuple[str, str, str]:
        """Let the user push in three directions; return the device's axis for each."""
        found: list[str] = []
        moves: list[NDArray[np.float64]] = []
        for direction in _DIRECTIONS:
            self._prompt("Hold the end effector in the middle of its workspace")
            before = self._median_position()
            self._prompt(f"Move it about 5 cm {direction}, and keep it there")
            move = self._median_position() - before
            axis = int(np.abs(move).argmax())
            others = math.sqrt(max(0.0, float(move @ move) - move[axis] ** 2))
            if abs(move[axis]) < _LEAST_PUSH or others > 0.6 * abs(move[axis]):
                x, y, z = move * 1e3
                raise AsperityError(
                    f"pushed {direction} it moved {x:.0f}, {y:.0f}, {z:.0f} mm (x, y, z); needed: "
                    f"{_LEAST_PUSH * 1e3:.0f} mm or more, mostly along one axis. Begin again"
                )
            found.append(("-" if move[axis] < 0.0 else "+") + "xyz"[axis])
            moves.append(move / np.linalg.norm(move))
        handedness = float(np.linalg.det(np.array(moves)))
        right, away, up = found
        if handedness < 0.0 and len({axis[1] for axis in found}) == 3:
            raise AsperityError(
                f"right, away, up are {right}, {away}, {up}: left-handed. Either a push went "
                "the other way, or the device's poses are mirrored, which no rotation can undo"
            )
        calibration = Calibration((right, away, up))  # raises if one axis appears twice
        verdict = "as expected" if found == ["+x", "+y", "+z"] else "unlike the backend's axes"
        self._note(f"right, away, up are {right}, {away}, {up}: right-handed, {verdict}")
        return calibration.axes

    def home(self) -> tuple[float, float, float]:
        """Let the user choose the middle of the workspace."""
        self._prompt("Hold it at the middle of your workspace")
        x, y, z = self._median_position().tolist()
        self._note(f"home is {x * 1e3:.0f}, {y * 1e3:.0f}, {z * 1e3:.0f} mm in the device's axes")
        return x, y, z

    def forces(self, axes: tuple[str, str, str]) -> float:
        """Push along each axis; return the largest force that was verified [N]."""
        top = min(TOP_FORCE, self.device.limits.max_force)
        if self.device.limits.force_dof == 0:
            self._note("it has no motors to check")
            return 0.0
        self._prompt(f"Hold it loosely: it will push up to {top:g} N along each axis in turn")
        rows = Calibration(axes).rows
        shifts = [self._ramp(rows[i], _DIRECTIONS[i], top) for i in range(3)]
        shown = ", ".join(f"{x * 1e3:.1f}" for x in shifts)
        if min(shifts) < _SEEN:
            self._note(
                f"pushed with {top:g} N it gave way by {shown} mm: too little along an axis to "
                "know that the motors push at all (held fast, or they are off)"
            )
            return 0.0
        self._note(f"pushed right, away, up with {top:g} N it gave way by {shown} mm that way")
        if self.stalls:
            self._note(
                f"{self.stalls} times no pose came for {_LONGEST_AGE * 1e3:.0f} ms: the computer "
                "is busy, or the connection is poor"
            )
        return top

    def _ramp(self, direction: NDArray[np.float64], towards: str, top: float) -> float:
        """Push along a unit vector; return the displacement along it [m]."""
        while (shift := self._push(direction, towards, top)) is None:
            self.stalls += 1
            began = self.clock()
            while not (self.device.read(self.clock()) and self.reading.age < _LONGEST_AGE):
                self._send_zero()
                self.sleep(_TICK)
                silent = self.clock() - began
                if self.stalls > _MAX_STALLS or silent > _RECOVERY or self.reading.error:
                    why = self.reading.error or f"{self.reading.age * 1e3:.0f} ms without a pose"
                    raise AsperityError(f"{self.device.name} fell silent under force: {why}")
        if shift < -_SEEN:
            raise AsperityError(
                f"pushed {towards} with {top:g} N it moved {-shift * 1e3:.1f} mm the other way: "
                "its forces have the wrong sign. Do not use it"
            )
        return shift

    def _push(self, direction: NDArray[np.float64], towards: str, top: float) -> float | None:
        """Raise and lower a force; return the displacement [m], or None if readings stalled."""
        wrench = np.zeros(6)
        start = self._median_position()
        shift = 0.0
        began = self.clock()
        try:
            while (since := self.clock() - began) < _RISE + _STAY + _FALL:
                self.device.read(self.clock())
                if self.reading.age > _LONGEST_AGE and not self.reading.error:
                    return None
                force = float(np.linalg.norm(wrench[:3]))
                self._stop_runaway(self.reading.pose[:3] - start, force, towards)
                if _RISE < since < _RISE + _STAY:
                    shift = float((self.reading.pose[:3] - start) @ direction)
                part = min(since / _RISE, 1.0, max(0.0, (_RISE + _STAY + _FALL - since) / _FALL))
                wrench[:3] = top * part * direction
                self.device.write(wrench, self.clock())
                self.sleep(_TICK)
        finally:
            self._send_zero()
        return shift

    def _stop_runaway(self, move: NDArray[np.float64], force: float, towards: str) -> None:
        """Raise if the end effector runs away or the device reports an error."""
        if self.reading.error:
            raise AsperityError(f"{self.device.name} fell silent under force: {self.reading.error}")
        distance = float(np.linalg.norm(move))
        speed = float(np.linalg.norm(self.reading.twist[:3]))
        if not (distance <= RUN_AWAY_DISTANCE and speed <= RUN_AWAY_SPEED):  # also for nan
            raise AsperityError(
                f"pushed {towards} with {force:.2f} N it ran away ({distance * 1e3:.0f} mm, "
                f"{speed * 1e3:.0f} mm/s); the force was cut. Hold it, and begin again"
            )

    def _read_without_force(self, seconds: float) -> tuple[NDArray[np.float64], int, list[str]]:
        """Read without force; return positions (n, 3), the number of new ones, and errors."""
        positions, errors, new = [], [], 0
        began = self.clock()
        while self.clock() - began < seconds:
            fresh = self.device.read(self.clock())
            if self.reading.error:
                errors.append(self.reading.error)
            if fresh:
                new += 1
                positions.append(self.reading.pose[:3].copy())
            self._send_zero()
            self.sleep(_TICK)
        return (np.array(positions) if positions else np.zeros((1, 3))), new, errors

    def _send_zero(self) -> None:
        """Send zero at once."""
        self.device.write(np.zeros(6), self.clock(), known=False)

    def _median_position(self) -> NDArray[np.float64]:
        """Return the median position over a tenth of a second [m]."""
        positions, new, errors = self._read_without_force(0.1)
        if new == 0:
            why = errors[-1] if errors else "no new poses"
            raise AsperityError(f"{self.device.name} fell silent: {why}")
        place: NDArray[np.float64] = np.median(positions, axis=0)
        return place

    def _prompt(self, request: str) -> None:
        if self.ask is not None:
            self.ask(request)

    def _note(self, line: str) -> None:
        self.notes.append(line)
        self.tell(line)

"""Everything that goes to a device goes through here, and there is no way round.

The loop never holds the device itself, only a `SafeDevice`. Whatever wrench it is given, what the
device is sent is finite, no stronger than the device's limits (or than the user's, if lower) and
no faster to rise than the slew limit; and it is zero, at once, when

- the wrench is not finite, or
- the device has been silent for `silent_after`, told of nothing but nonsense, or told of old
  measurements (`Reading.age`), or
- the caller says that it does not know the contact any more.

After silence, and at the beginning, the wrench comes up softly: by a factor that grows from 0 to 1
in `soft_start`, or, after a short silence, in ten times what that lasted. Nothing here raises: what
goes wrong is counted, and told in the summary.

The order is: finite, softly, within the limits, slewed. Both the last and the next wrench are
within the limits, the slewed one lies between them, and so it is within them too.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import NDArray

from asperity.errors import require_between, require_not_negative
from asperity.realtime.devices.protocol import Device, Reading
from asperity.simulation.tool_contact import LIMITED, SILENT

_ABSURD = 2.0
"""Farther out than so many radii of the workspace no end effector can be."""
_FASTEST, _FASTEST_TURN = 10.0, 100.0
"""No hand moves faster [m/s], [rad/s]."""
_NORM_TOLERANCE = 1e-2
"""How far a device's quaternion may be off norm 1 before the reading is nonsense."""
_SOFTER = 10.0
"""So many times as long as a silence lasts what comes after it; ours."""
_ROUNDING = 1.0 - 1e-12


@dataclass(frozen=True)
class SafetySettings:
    """What is let through. All defaults are asperity's.

    Parameters
    ----------
    max_force, max_torque : float, optional
        Lower limits than the device's own [N], [N m].
    slew : float
        How long a wrench takes at least from zero to its limit [s]; 0: no limit.
    soft_start : float
        How long it takes to come up at the beginning and after silence [s].
    silent_after : float
        A device that has told nothing new for longer than this is silent [s]. At 1 kHz zero is sent
        a tick later at most: within 5 ms of the last reading.
    """

    max_force: float | None = None
    max_torque: float | None = None
    slew: float = 5e-3
    soft_start: float = 0.25
    silent_after: float = 4e-3

    def __post_init__(self) -> None:
        for name in ("max_force", "max_torque"):
            if getattr(self, name) is not None:
                require_not_negative(name, getattr(self, name))
        require_between("slew", self.slew, 0.0, 1.0, "s")
        require_between("soft_start", self.soft_start, 0.0, 10.0, "s")
        require_between("silent_after", self.silent_after, 1e-4, 1.0, "s")


@dataclass
class SafetyCounts:
    """How often what was needed."""

    clamped_force: int = 0
    clamped_torque: int = 0
    slewed: int = 0
    not_finite: int = 0
    """Wrenches with NaN or infinity in them: sent as zero."""
    bad_readings: int = 0
    """Poses with NaN or infinity in them, or whose quaternion is none: not taken."""
    workspace_clamps: int = 0
    """Poses absurdly far out, velocities absurdly high: drawn in."""
    silences: int = 0
    """Times that the device fell silent."""
    silent_ticks: int = 0
    contact_lost_ticks: int = 0
    """Ticks in which the contact was too old to be carried on."""
    errors: int = 0
    """Exceptions and errors of the device."""
    last_error: str = ""


class SafeDevice:
    """A device that can be told anything.

    Parameters
    ----------
    device : Device
        Opened by `open`; nobody else may hold it.
    dt : float
        Tick [s].
    settings : SafetySettings
    """

    def __init__(
        self, device: Device, *, dt: float, settings: SafetySettings | None = None
    ) -> None:
        self._device = device
        self.settings = settings or SafetySettings()
        self.limits = device.limits
        self.name = device.name
        self.max_force = _lower(device.limits.max_force, self.settings.max_force)
        self.max_torque = _lower(device.limits.max_torque, self.settings.max_torque)
        self.reading = Reading.empty()
        """The last that made sense."""
        self.sent = np.zeros(6)
        """What the device was sent last, its axes (6,) [N, N m]."""
        self.flags = 0
        """What there is to say of the last tick: bits of `FLAGS`."""
        self.counts = SafetyCounts()
        self._raw = Reading.empty()
        self._gain = 0.0
        self._measured = -math.inf
        self._was_silent = False
        self.set_tick(dt)

    @property
    def said(self) -> Reading:
        """What the device said last, whether it made sense or not."""
        return self._raw

    def set_tick(self, dt: float) -> None:
        """Take ticks of `dt` [s] from now on."""
        slew, soft = self.settings.slew, self.settings.soft_start
        self._force_step = self.max_force * dt / slew if slew > 0.0 else math.inf
        self._torque_step = self.max_torque * dt / slew if slew > 0.0 else math.inf
        self._dt, self._soft = dt, soft
        self._gain_step = _step(dt, soft)

    def open(self) -> None:
        """Connect; raises what the device raises."""
        self._device.open()

    def begin(self, now: float) -> None:
        """Start: the wrench comes up softly, and silence is counted from `now` [s]."""
        self.soften()
        self._measured = now
        self.sent[:] = 0.0

    def read(self, now: float) -> bool:
        """Take the newest reading, if it makes sense; return whether there was one.

        Parameters
        ----------
        now : float
            [s], on the loop's clock.
        """
        self.flags = 0
        raw, counts = self._raw, self.counts
        raw.error = ""
        try:
            fresh = bool(self._device.read(raw))
        except Exception as error:  # it must not, but then it must not matter
            fresh, raw.error = False, f"{type(error).__name__}: {error}"
        if raw.error:
            counts.errors += 1
            counts.last_error = raw.error
        if not fresh:
            return False
        if not self._take(raw):
            counts.bad_readings += 1
            return False
        age = float(raw.age)
        if age == age:  # an age that is not a number says nothing
            self._measured = max(self._measured, now - max(age, 0.0))
        return True

    def is_silent(self, now: float) -> bool:
        """Return whether the device has told nothing new for too long."""
        return now - self._measured > self.settings.silent_after

    def soften(self) -> None:
        """Let the next wrenches come up from zero: much may have happened meanwhile."""
        self._gain, self._gain_step = 0.0, _step(self._dt, self._soft)

    def write(self, wrench: NDArray[np.float64], now: float, *, known: bool = True) -> None:
        """Send what may be sent of a wrench (6,), device axes.

        Parameters
        ----------
        wrench : (6,) array
            Force [N] and torque [N m].
        now : float
            [s], on the loop's clock.
        known : bool
            Whether the contact is known; if not, zero is sent.
        """
        counts = self.counts
        fx, fy, fz, tx, ty, tz = wrench.tolist()
        silent = self.is_silent(now)
        counts.silences += silent and not self._was_silent
        self._was_silent = silent
        counts.silent_ticks += silent
        counts.contact_lost_ticks += not known
        if not known:
            self.soften()
        elif silent:
            lasted = now - self._measured
            self._gain, self._gain_step = 0.0, _step(self._dt, min(self._soft, _SOFTER * lasted))
        finite = math.isfinite(fx + fy + fz + tx + ty + tz)
        if not finite:
            counts.not_finite += 1
        if silent or not known or not finite:
            self.flags |= SILENT
            self._send(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
            return
        self._gain = gain = min(self._gain + self._gain_step, 1.0)
        if gain < 1.0:
            self.flags |= LIMITED
        force, torque = gain * math.hypot(fx, fy, fz), gain * math.hypot(tx, ty, tz)
        f = t = gain
        if force > self.max_force:
            counts.clamped_force += 1
            self.flags |= LIMITED
            f *= _ROUNDING * self.max_force / force
        if torque > self.max_torque:
            # A device that cannot turn is not clamped, it just feels no torque.
            if self.max_torque > 0.0:
                counts.clamped_torque += 1
                self.flags |= LIMITED
            t *= _ROUNDING * self.max_torque / torque
        ax, ay, az, bx, by, bz = self.sent.tolist()
        dx, dy, dz = f * fx - ax, f * fy - ay, f * fz - az
        ex, ey, ez = t * tx - bx, t * ty - by, t * tz - bz
        step, turn = math.hypot(dx, dy, dz), math.hypot(ex, ey, ez)
        p = q = 1.0
        if step > self._force_step:
            p = self._force_step / step
        if turn > self._torque_step:
            q = self._torque_step / turn
        if p < 1.0 or q < 1.0:
            counts.slewed += 1
            self.flags |= LIMITED
        self._send(ax + p * dx, ay + p * dy, az + p * dz, bx + q * ex, by + q * ey, bz + q * ez)

    def close(self) -> None:
        """Send zero and disconnect. May be called twice."""
        self._send(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        try:
            self._device.close()
        except Exception as error:
            self._failed(error)

    def told(self) -> dict[str, object]:
        """Return the limits and counts for `summary.json`."""
        limits = {"max_force_n": self.max_force, "max_torque_n_m": self.max_torque}
        return {**limits, **asdict(self.counts)}

    def _send(self, *values: float) -> None:
        self.sent[:] = values
        try:
            self._device.write(self.sent)
        except Exception as error:
            self._failed(error)

    def _failed(self, error: Exception) -> None:
        self.counts.errors += 1
        self.counts.last_error = f"{type(error).__name__}: {error}"

    def _take(self, raw: Reading) -> bool:
        """Fill `reading` from what the device said; return whether it makes sense."""
        x, y, z, qw, qx, qy, qz = raw.pose.tolist()
        vx, vy, vz, wx, wy, wz = raw.twist.tolist()
        norm = math.hypot(qw, qx, qy, qz)
        if not (math.isfinite(x + y + z) and abs(norm - 1.0) <= _NORM_TOLERANCE):
            return False
        if not math.isfinite(vx + vy + vz + wx + wy + wz):
            return False
        out, clamps = self.reading, self.counts
        reach, far = math.hypot(x, y, z), _ABSURD * self.limits.radius
        speed, turning = math.hypot(vx, vy, vz), math.hypot(wx, wy, wz)
        clamps.workspace_clamps += reach > far or speed > _FASTEST or turning > _FASTEST_TURN
        s = min(1.0, far / reach) if reach > 0.0 else 1.0
        v = min(1.0, _FASTEST / speed) if speed > 0.0 else 1.0
        w = min(1.0, _FASTEST_TURN / turning) if turning > 0.0 else 1.0
        out.pose[:] = (s * x, s * y, s * z, qw / norm, qx / norm, qy / norm, qz / norm)
        out.twist[:] = (v * vx, v * vy, v * vz, w * wx, w * wy, w * wz)
        out.buttons, out.age = raw.buttons, raw.age
        return True


def _step(dt: float, seconds: float) -> float:
    """Return how much of 1 a tick is, if all of it takes so long."""
    return min(dt / seconds, 1.0) if seconds > 0.0 else 1.0


def _lower(own: float, wanted: float | None) -> float:
    return own if wanted is None else min(own, wanted)

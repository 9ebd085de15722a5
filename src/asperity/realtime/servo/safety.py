"""The safety layer: every wrench reaches the device through a `SafeDevice`, and in no other way.

Whatever wrench the loop hands over, the one that is sent is finite, within the limits of the device
and of the user, and rises no faster than the slew limit. Zero is sent at once when

- the wrench is not finite, or
- the device has been silent for `silent_after`: it gave no reading, only invalid ones, or only old
  measurements (`Reading.age`), or
- the caller reports that the contact is not known.

At the beginning and after silence, the wrench rises softly: a gain grows from 0 to 1 in
`soft_start`, or, after a short silence, in ten times its duration. Nothing here raises; faults are
counted and reported in the summary.

The order is: finiteness, soft start, limits, slew. The last wrench and the next one are within the
limits and the slewed one lies between them, so it is within the limits too.
"""

from __future__ import annotations

import math
import warnings
from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import NDArray

from asperity.errors import require_between, require_not_negative
from asperity.realtime.devices.protocol import Device, Reading
from asperity.simulation.tool_contact import LIMITED, SILENT

_MAX_DISTANCE = 2.0
"""Largest plausible distance of an end effector, in radii of the workspace."""
_MAX_SPEED, _MAX_ANGULAR_SPEED = 10.0, 100.0
"""Largest plausible velocities of a hand [m/s], [rad/s]."""
_NORM_TOLERANCE = 1e-2
"""Largest deviation of a quaternion's norm from 1 in a valid reading."""
_SOFTER = 10.0
"""Duration of the soft start after a short silence, over that of the silence; project default."""
_ROUNDING = 1.0 - 1e-12


@dataclass(frozen=True)
class SafetySettings:
    """Limits of what is sent. All defaults are the project's.

    Parameters
    ----------
    max_force, max_torque : float, optional
        Limits below the device's own [N], [N m].
    slew : float
        Shortest time for a wrench to rise from zero to its limit [s], 0 to 1; 0: no limit.
    soft_start : float
        Duration of the rise at the beginning and after silence [s], 0 to 10.
    silent_after : float
        Time without a new reading after which a device is silent [s], 1e-4 to 1. At 1 kHz, zero is
        sent at most one tick later: by default within 5 ms of the last reading.
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
    """Counts of the actions of each protection."""

    clamped_force: int = 0
    clamped_torque: int = 0
    slewed: int = 0
    not_finite: int = 0
    """Wrenches with NaN or infinity: zero was sent."""
    bad_readings: int = 0
    """Readings with NaN, infinity or an invalid quaternion: ignored."""
    workspace_clamps: int = 0
    """Readings with implausible positions or velocities: clamped."""
    silences: int = 0
    """Number of times the device fell silent."""
    silent_ticks: int = 0
    contact_lost_ticks: int = 0
    """Ticks in which the contact was too old to be extrapolated."""
    errors: int = 0
    """Exceptions raised and errors reported by the device."""
    last_error: str = ""


class SafeDevice:
    """A device to which any wrench may be written.

    Parameters
    ----------
    device : Device
        Opened by `open`; nothing else may hold it.
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
        self.in_loop = bool(getattr(device, "in_loop", False))
        self.max_force = _lower(device.limits.max_force, self.settings.max_force)
        self.max_torque = _lower(device.limits.max_torque, self.settings.max_torque)
        self.reading = Reading.empty()
        """The last valid reading."""
        self.sent = np.zeros(6)
        """The wrench sent last, in the device's axes (6,) [N], [N m]."""
        self.flags = 0
        """Flags of the last tick: `LIMITED`, `SILENT`."""
        self.counts = SafetyCounts()
        self._raw = Reading.empty()
        self._gain = 0.0
        self._measured = -math.inf
        self._was_silent = False
        self.set_tick(dt)

    @property
    def raw_reading(self) -> Reading:
        """The last reading, valid or not."""
        return self._raw

    def set_tick(self, dt: float) -> None:
        """Continue with ticks of `dt` [s]."""
        slew, soft = self.settings.slew, self.settings.soft_start
        self._force_step = self.max_force * dt / slew if slew > 0.0 else math.inf
        self._torque_step = self.max_torque * dt / slew if slew > 0.0 else math.inf
        self._dt, self._soft = dt, soft
        self._gain_step = _step(dt, soft)

    def open(self) -> None:
        """Connect; raises what the device raises."""
        self._device.open()

    def begin(self, now: float) -> None:
        """Begin with a soft start, counting silence from `now` [s]."""
        self.soften()
        self._measured = now
        self.sent[:] = 0.0

    def read(self, now: float) -> bool:
        """Take the newest reading if it is valid; return whether there was one.

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
        except Exception as error:  # a device must not raise; if it does, the loop continues
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
        if age == age:  # not NaN
            self._measured = max(self._measured, now - max(age, 0.0))
        return True

    def is_silent(self, now: float) -> bool:
        """Return whether the device has given nothing new for longer than `silent_after`."""
        return now - self._measured > self.settings.silent_after

    @property
    def is_rising(self) -> bool:
        """Whether the wrench is zero or rises softly."""
        return self._gain < 1.0

    def soften(self) -> None:
        """Let the wrench rise from zero again, over `soft_start`."""
        self._gain, self._gain_step = 0.0, _step(self._dt, self._soft)

    def write(self, wrench: NDArray[np.float64], now: float, *, known: bool = True) -> None:
        """Send a wrench (6,) in the device's axes, as far as the limits allow.

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
            # For a device without torque this is no clamping, and is not counted.
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

    def summary(self) -> dict[str, object]:
        """Return the limits and counts for `summary.json`."""
        limits = {"max_force_n": self.max_force, "max_torque_n_m": self.max_torque}
        return {**limits, **asdict(self.counts)}

    @property
    def said(self) -> Reading:
        """Deprecated: use `raw_reading`."""
        warnings.warn("said is deprecated: use raw_reading", DeprecationWarning, stacklevel=2)
        return self.raw_reading

    def told(self) -> dict[str, object]:
        """Return `summary()`; deprecated."""
        warnings.warn("told is deprecated: use summary", DeprecationWarning, stacklevel=2)
        return self.summary()

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
        """Fill `reading` from a raw reading; return whether that is valid."""
        x, y, z, qw, qx, qy, qz = raw.pose.tolist()
        vx, vy, vz, wx, wy, wz = raw.twist.tolist()
        norm = math.hypot(qw, qx, qy, qz)
        if not (math.isfinite(x + y + z) and abs(norm - 1.0) <= _NORM_TOLERANCE):
            return False
        if not math.isfinite(vx + vy + vz + wx + wy + wz):
            return False
        out, clamps = self.reading, self.counts
        reach, far = math.hypot(x, y, z), _MAX_DISTANCE * self.limits.radius
        speed, turning = math.hypot(vx, vy, vz), math.hypot(wx, wy, wz)
        clamps.workspace_clamps += reach > far or speed > _MAX_SPEED or turning > _MAX_ANGULAR_SPEED
        s = min(1.0, far / reach) if reach > 0.0 else 1.0
        v = min(1.0, _MAX_SPEED / speed) if speed > 0.0 else 1.0
        w = min(1.0, _MAX_ANGULAR_SPEED / turning) if turning > 0.0 else 1.0
        out.pose[:] = (s * x, s * y, s * z, qw / norm, qx / norm, qy / norm, qz / norm)
        out.twist[:] = (v * vx, v * vy, v * vz, w * wx, w * wy, w * wz)
        out.buttons, out.age = raw.buttons, raw.age
        return True


def _step(dt: float, seconds: float) -> float:
    """Return by how much a gain grows in a tick if it rises from 0 to 1 in `seconds`."""
    return min(dt / seconds, 1.0) if seconds > 0.0 else 1.0


def _lower(own: float, wanted: float | None) -> float:
    return own if wanted is None else min(own, wanted)

"""Motions of the handle: poses over time, given or scripted."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import InitVar, dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from asperity._core.arrays import Array, row_lengths
from asperity.errors import (
    AsperityError,
    require_between,
    require_choice,
    require_finite,
    require_not_negative,
    require_positive,
)
from asperity.geometry.poses import NORM_TOLERANCE, interpolate_pose, require_pose, rotated

KINDS = ("slide", "circle", "press-and-slide", "rotate")
MOST_TICKS = 10_000_000
"""Largest length of a trajectory: nearly three hours at 1 kHz."""
_PRESSING = 0.25
"""Time in which press-and-slide comes down, and again lifts [s]."""
_CLEARANCE = 1e-3
"""Height above contact at which press-and-slide starts [m]."""


@dataclass(frozen=True)
class ScriptedMotion:
    """A scripted motion; every parameter has a default.

    Parameters
    ----------
    kind : {"slide", "circle", "press-and-slide", "rotate"}
        *slide*: back and forth on a straight line. *circle*: around a circle through the start.
        *press-and-slide*: down onto the surface, back and forth on a line, up again.
        *rotate*: in place, about the vertical.
    seconds : float
        Duration [s].
    speed : float
        Sliding speed [m/s].
    length : float
        Length of the line [m].
    direction : float
        Direction of the line, from x towards y [rad].
    radius : float
        Radius of the circle [m].
    turning : float
        Angular velocity of *rotate* [rad/s].
    press_force : float
        Normal force at the start [N]; the depth that gives it is searched.
    press_depth : float, optional
        Depth to press to instead [m].
    ramp : float
        Duration of starting, of stopping, and of each half of a reversal [s].
    start : (3,), optional
        Position of the tool's frame before it is pressed down [m]; by default that in the scene.
    """

    kind: str = "slide"
    seconds: float = 2.0
    speed: float = 0.083
    length: float = 0.06
    direction: float = 0.0
    radius: float = 0.005
    turning: float = 3.0
    press_force: float = 0.58
    press_depth: float | None = None
    ramp: float = 0.05
    start: Sequence[float] | None = None

    def __post_init__(self) -> None:
        require_choice("kind of trajectory", self.kind, KINDS)
        require_between("seconds", self.seconds, 1e-3, 1e4, "s")
        for name, unit in (("speed", "m/s"), ("length", "m"), ("radius", "m"), ("ramp", "s")):
            require_positive(name, getattr(self, name), unit)
        for name, unit in (("direction", "rad"), ("turning", "rad/s")):
            require_between(name, getattr(self, name), -1e6, 1e6, unit)
        require_not_negative("press_force", self.press_force, "N")
        if self.press_depth is not None:
            require_between("press_depth", self.press_depth, -1.0, 1.0, "m")
        if self.start is not None:
            object.__setattr__(self, "start", require_finite("start", self.start, 3))

    @property
    def stroke(self) -> float:
        """Duration of one stroke along the line [s]."""
        return max(self.length / self.speed - self.ramp, 0.0) + 2.0 * self.ramp

    @property
    def period(self) -> float:
        """Duration of two strokes, of one circle, or of one revolution [s]."""
        if self.kind == "circle":
            return 2.0 * math.pi * self.radius / self.speed
        if self.kind == "rotate":
            return 2.0 * math.pi / abs(self.turning) if self.turning else self.seconds
        return 2.0 * self.stroke


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Poses of the handle over time.

    Parameters
    ----------
    times : (n,) array
        Increasing times [s].
    poses : (n, 7) array
        Positions [m] and unit quaternions wxyz.
    name : str
    origins : sequence of str
        Origin of each row, for error messages; by default the number of the row, from 0.
    notes : tuple of str
        Choices, conversions and doubts on the way here, to be shown to the user.
    checked : bool
        Whether `poses` are finite, of unit quaternions, C-ordered and nobody else's.
    """

    times: Array
    poses: Array
    name: str = "trajectory"
    origins: Sequence[str] = field(default=(), repr=False)
    notes: tuple[str, ...] = field(default=(), repr=False)
    checked: InitVar[bool] = False

    def __post_init__(self, checked: bool) -> None:
        times = np.atleast_1d(np.asarray(self.times, dtype=np.float64))
        poses = np.atleast_2d(np.asarray(self.poses, dtype=np.float64))
        if times.ndim != 1 or poses.shape != (times.size, 7) or times.size == 0:
            raise AsperityError(
                "a trajectory needs times (n,) and poses (n, 7), n at least 1; "
                f"got {np.shape(self.times)} and {np.shape(self.poses)}"
            )
        if not np.isfinite(times).all():
            row = int(np.argmin(np.isfinite(times)))
            raise AsperityError(f"{self.name}, {self._row(row)}: time must be finite")
        backwards = np.flatnonzero(np.diff(times) <= 0.0)
        if backwards.size:
            row = int(backwards[0]) + 1
            raise AsperityError(
                f"{self.name}, {self._row(row)}: times must increase, {times[row]:g} s comes "
                f"after {times[row - 1]:g} s"
            )
        poses = poses if checked else self._normalised(poses)
        object.__setattr__(self, "times", times)
        object.__setattr__(self, "poses", poses)

    def _normalised(self, poses: Array) -> Array:
        """Return a copy of poses with unit quaternions; raise `AsperityError` if one is off."""
        poses = np.array(poses, order="C")
        with np.errstate(over="ignore", invalid="ignore"):
            norms = row_lengths(poses[:, 3:])
            right = np.abs(norms - 1.0) <= NORM_TOLERANCE
            total = poses.sum()
        if not np.isfinite(total):
            right &= np.isfinite(poses).all(axis=1)
        if not right.all():
            row = int(np.argmin(right))
            require_pose(poses[row], f"{self.name}, {self._row(row)}")
        for column in poses.T[3:]:
            column /= norms
        return poses

    def _row(self, row: int) -> str:
        return self.origins[row] if self.origins else f"row {row}"

    @property
    def seconds(self) -> float:
        """Duration [s]."""
        return float(self.times[-1] - self.times[0])


def scripted(
    motion: ScriptedMotion, pressed: ArrayLike, *, dt: float = 1e-3, lift: float = 0.0
) -> Trajectory:
    """Return the trajectory of a scripted motion, one pose a tick.

    Parameters
    ----------
    motion : ScriptedMotion
    pressed : (7,) array_like
        Pose at the start, at the depth to press to.
    dt : float
        Tick [s].
    lift : float
        Height above `pressed` at which the tool leaves contact [m], for press-and-slide.
    """
    start = require_pose(pressed, "pressed pose")
    ticks = round(motion.seconds / require_positive("dt", dt, "s"))
    if not 1 <= ticks <= MOST_TICKS:
        raise AsperityError(
            f"{motion.seconds:g} s are {ticks} ticks of {dt:g} s; valid: 1 to {MOST_TICKS}"
        )
    times = np.arange(ticks + 1, dtype=np.float64) * dt
    poses = np.repeat(start[None], ticks + 1, axis=0)
    if motion.kind == "rotate":
        angles = motion.turning * _smooth_start(times, motion.ramp)
        poses = np.array([rotated(start, (0.0, 0.0, angle)) for angle in angles])
    elif motion.kind == "circle":
        angles = motion.speed / motion.radius * _smooth_start(times, motion.ramp)
        x, y = motion.radius * np.sin(angles), motion.radius * (1.0 - np.cos(angles))
        _translate(poses, motion.direction, x, y)
    else:
        along = times
        if motion.kind == "press-and-slide":
            pressing = min(_PRESSING, 0.25 * motion.seconds)
            height = lift + _CLEARANCE
            up = 1.0 - _eased(times / pressing) + _eased((times - times[-1]) / pressing + 1.0)
            poses[:, 2] += height * up
            sliding = times[-1] - 2.0 * pressing
            remaining = sliding - np.clip(times - pressing, 0.0, sliding)
            # The last stroke ends smoothly wherever it is.
            along = _smooth_start(np.array([sliding]), motion.ramp) - _smooth_start(
                remaining, motion.ramp
            )
        _translate(poses, motion.direction, _position(along, motion), np.zeros(ticks + 1))
    return Trajectory(times, poses, motion.kind)


def _translate(poses: Array, direction: float, x: Array, y: Array) -> None:
    """Translate the poses in place by `x` along `direction` and by `y` to its left."""
    cosine, sine = math.cos(direction), math.sin(direction)
    poses[:, 0] += cosine * x - sine * y
    poses[:, 1] += sine * x + cosine * y


def _eased(s: Array) -> Array:
    """Return a cosine ramp from 0 to 1 for `s` from 0 to 1."""
    return np.asarray(0.5 - 0.5 * np.cos(np.pi * np.clip(s, 0.0, 1.0)))


def _smooth_start(times: Array, ramp: float) -> Array:
    """Return the distance [s] travelled at a speed that rises smoothly to 1 during `ramp`."""
    t = np.minimum(times, ramp)
    rising = 0.5 * t - 0.5 * ramp / math.pi * np.sin(math.pi * t / ramp)
    return np.asarray(rising + np.maximum(times - ramp, 0.0))


def _position(times: Array, motion: ScriptedMotion) -> Array:
    """Return the position on the line, 0 to `length` [m], of a motion back and forth.

    A stroke starts and ends smoothly; in between, the speed is exactly `speed`. If the line is too
    short to reach it in `ramp`, the speed is lower.
    """
    ramp, stroke = motion.ramp, motion.stroke
    speed = motion.length / (stroke - ramp)
    number = np.floor(times / stroke)
    t = times - number * stroke
    # The end of a stroke mirrors its beginning.
    distance = _smooth_start(np.minimum(t, stroke - ramp), ramp)
    rest = stroke - np.maximum(t, stroke - ramp)
    distance += 0.5 * ramp - _smooth_start(rest, ramp)
    position = speed * distance
    return np.asarray(np.where(number % 2 == 0, position, motion.length - position))


def at_ticks(trajectory: Trajectory, dt: float) -> Array:
    """Return the poses (n, 7) of a trajectory, interpolated, every `dt` [s]."""
    times, poses = trajectory.times - trajectory.times[0], trajectory.poses
    count = math.floor(times[-1] / dt + 1e-6) + 1
    if count > MOST_TICKS:
        raise AsperityError(
            f"{trajectory.name} lasts {times[-1]:g} s, {count} ticks; valid: at most {MOST_TICKS}"
        )
    ticks = np.arange(count) * dt
    if len(times) == count and np.allclose(times, ticks, rtol=0.0, atol=1e-9):
        return poses.copy()
    right = np.clip(np.searchsorted(times, ticks, side="right"), 1, len(times) - 1)
    out = np.empty((count, 7))
    for i, (t, r) in enumerate(zip(ticks, right, strict=True)):
        s = (t - times[r - 1]) / (times[r] - times[r - 1])
        out[i] = interpolate_pose(poses[r - 1], poses[r], min(max(s, 0.0), 1.0))
    return out

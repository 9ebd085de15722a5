"""Scripted motions of the handle: poses over time, nothing else."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from asperity.errors import (
    AsperityError,
    require_between,
    require_choice,
    require_finite,
    require_not_negative,
    require_positive,
)
from asperity.geometry.poses import interpolate_pose, require_pose, rotated

Array = NDArray[np.floating[Any]]
KINDS = ("slide", "circle", "press-and-slide", "rotate")
MOST_TICKS = 10_000_000
"""Of one trajectory: nearly three hours at 1 kHz."""
_PRESSING = 0.25
"""How long press-and-slide takes to press, and again to lift [s]."""
_CLEARANCE = 1e-3
"""How far above contact press-and-slide begins [m]."""


@dataclass(frozen=True)
class ScriptedMotion:
    """A scripted motion, of which everything has a default.

    Parameters
    ----------
    kind : {"slide", "circle", "press-and-slide", "rotate"}
        *slide*: to and fro along a line. *circle*: round a circle that begins at the start.
        *press-and-slide*: from above down onto the surface, along a line, up again.
        *rotate*: turning in place about the vertical.
    seconds : float
        Duration [s].
    speed : float
        Of sliding [m/s].
    length : float
        Of the line [m].
    direction : float
        Of the line, from x towards y [rad].
    radius : float
        Of the circle [m].
    turning : float
        Speed of turning [rad/s].
    press_force : float
        Normal force at the start [N]; the depth that gives it is searched.
    press_depth : float, optional
        How deep to press instead [m].
    ramp : float
        How long starting, stopping and turning back take [s].
    start : (3,), optional
        Where the tool's frame begins [m], before it is pressed; by default where it is drawn in
        the scene.
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
        """How long the way along the line takes, once [s]."""
        return max(self.length / self.speed - self.ramp, 0.0) + 2.0 * self.ramp

    @property
    def period(self) -> float:
        """After how long the line is done to and fro, or the circle, or a turn [s]."""
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
        Increasing [s].
    poses : (n, 7) array
        Position [m] and unit quaternion wxyz.
    name : str
    """

    times: Array
    poses: Array
    name: str = "trajectory"
    origins: tuple[str, ...] = field(default=(), repr=False)
    """Where each row comes from, for messages; by default its number from 0."""

    def __post_init__(self) -> None:
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
        poses = np.array(
            [require_pose(pose, f"{self.name}, {self._row(i)}") for i, pose in enumerate(poses)]
        )
        object.__setattr__(self, "times", times)
        object.__setattr__(self, "poses", poses)

    def _row(self, row: int) -> str:
        return self.origins[row] if self.origins else f"row {row}"

    @property
    def seconds(self) -> float:
        """Duration [s]."""
        return float(self.times[-1] - self.times[0])


def scripted(
    motion: ScriptedMotion, pressed: ArrayLike, *, dt: float = 1e-3, lift: float = 0.0
) -> Trajectory:
    """Return the poses of a scripted motion, one a tick.

    Parameters
    ----------
    motion : ScriptedMotion
    pressed : (7,) array_like
        The pose at its start, pressed as deep as it shall be.
    dt : float
        Tick [s].
    lift : float
        How far above `pressed` the tool touches nothing [m] (for press-and-slide).
    """
    start = require_pose(pressed, "pressed pose")
    ticks = round(motion.seconds / require_positive("dt", dt, "s"))
    if not 1 <= ticks <= MOST_TICKS:
        raise AsperityError(
            f"{motion.seconds:g} s are {ticks} ticks of {dt:g} s; valid: 1 to {MOST_TICKS}"
        )
    times = np.arange(ticks + 1) * dt
    poses = np.repeat(start[None], ticks + 1, axis=0)
    if motion.kind == "rotate":
        angles = motion.turning * _smooth_start(times, motion.ramp)
        poses = np.array([rotated(start, (0.0, 0.0, angle)) for angle in angles])
    elif motion.kind == "circle":
        angles = motion.speed / motion.radius * _smooth_start(times, motion.ramp)
        x, y = motion.radius * np.sin(angles), motion.radius * (1.0 - np.cos(angles))
        _shift(poses, motion.direction, x, y)
    else:
        along = times
        if motion.kind == "press-and-slide":
            pressing = min(_PRESSING, 0.25 * motion.seconds)
            height = lift + _CLEARANCE
            up = 1.0 - _eased(times / pressing) + _eased((times - times[-1]) / pressing + 1.0)
            poses[:, 2] += height * up
            sliding = times[-1] - 2.0 * pressing
            left = sliding - np.clip(times - pressing, 0.0, sliding)
            # However far the last stroke has got, it ends smoothly.
            along = _smooth_start(np.array([sliding]), motion.ramp) - _smooth_start(
                left, motion.ramp
            )
        _shift(poses, motion.direction, _to_and_fro(along, motion), np.zeros(ticks + 1))
    return Trajectory(times, poses, motion.kind)


def _shift(poses: Array, direction: float, x: Array, y: Array) -> None:
    """Move the poses by `x` along `direction` and by `y` to the left of it, in place."""
    cosine, sine = math.cos(direction), math.sin(direction)
    poses[:, 0] += cosine * x - sine * y
    poses[:, 1] += sine * x + cosine * y


def _eased(s: Array) -> Array:
    """Return a smooth step from 0 to 1 while `s` goes from 0 to 1."""
    return np.asarray(0.5 - 0.5 * np.cos(np.pi * np.clip(s, 0.0, 1.0)))


def _smooth_start(times: Array, ramp: float) -> Array:
    """Return the way at speed 1 [s], the speed rising smoothly from 0 during `ramp`."""
    t = np.minimum(times, ramp)
    rising = 0.5 * t - 0.5 * ramp / math.pi * np.sin(math.pi * t / ramp)
    return np.asarray(rising + np.maximum(times - ramp, 0.0))


def _to_and_fro(times: Array, motion: ScriptedMotion) -> Array:
    """Return the place along the line, there and back: 0 to `length` [m].

    A stroke begins and ends smoothly; between, the speed is exactly `speed`. A line too short to
    reach it in `ramp` is done at a lower speed.
    """
    ramp, stroke = motion.ramp, motion.stroke
    speed = motion.length / (stroke - ramp)
    number = np.floor(times / stroke)
    t = times - number * stroke
    # The end of a stroke mirrors its beginning.
    way = _smooth_start(np.minimum(t, stroke - ramp), ramp)
    rest = stroke - np.maximum(t, stroke - ramp)
    way += 0.5 * ramp - _smooth_start(rest, ramp)
    place = speed * way
    return np.asarray(np.where(number % 2 == 0, place, motion.length - place))


def at_ticks(trajectory: Trajectory, dt: float) -> Array:
    """Return the poses (n, 7) every `dt` [s]; between those given the handle moves evenly."""
    times, poses = trajectory.times - trajectory.times[0], trajectory.poses
    count = math.floor(times[-1] / dt + 1e-6) + 1
    if count > MOST_TICKS:
        raise AsperityError(
            f"{trajectory.name} lasts {times[-1]:g} s, {count} ticks; valid: {MOST_TICKS} at most"
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

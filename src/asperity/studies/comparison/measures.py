"""The numbers that claims are judged by: a method on the scenes of `stimuli`."""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from asperity.errors import AsperityError
from asperity.geometry.poses import rotation_between
from asperity.runs.figures import across_mean
from asperity.scene.scene import Scene
from asperity.studies.baselines import Method, MethodWrench, Renderer
from asperity.studies.baselines.placement import place_bodies
from asperity.studies.comparison import drive, stimuli
from asperity.studies.stability.measure import Symptoms

Array = NDArray[np.float64]
_NOTHING = 1e-6
"""Force below which there is none [N]."""
_SECONDS = 0.58
"""Duration of the slides whose spectrum is taken [s]."""
_LOW, _HIGH = 0.29, 0.87
"""Normal forces, one three times the other [N]."""
_SLOW, _FAST = 0.5 * stimuli.SPEED, 2.0 * stimuli.SPEED


class OutOfTimeError(AsperityError):
    """The time for the claims about a method is spent."""


class _Timed(Renderer):
    """A renderer that stops when the time of its bench is spent."""

    def __init__(self, renderer: Renderer, bench: Bench) -> None:
        self._renderer, self._bench = renderer, bench

    def wrench(self, pose: Array) -> MethodWrench:
        self._bench.check_time()
        return self._renderer.wrench(pose)

    def reset(self) -> None:
        self._renderer.reset()


@dataclass(eq=False)
class Setup:
    """A scene and a renderer of it; slides are remembered."""

    scene: Scene
    renderer: Renderer

    def __post_init__(self) -> None:
        self.slide = cache(self._slide)

    def pressed(self, path: Array, force: float = stimuli.FORCE) -> Array:
        """Return a path (n, 7) raised until the mean upward force is `force` [N]."""
        return drive.raise_path(path, drive.find_pressing_height(self.renderer, path, force))

    def pressed_path(self, force: float = stimuli.FORCE) -> Array:
        """Return the poses (n, 7) of the straight path, pressed to a mean force [N]."""
        return self.pressed(stimuli.straight_path(self.scene, stimuli.SPEED), force)

    def follow(self, poses: Array) -> drive.DrivenRun:
        """Compute the wrench at every pose (n, 7)."""
        return drive.follow_path(self.renderer, poses)

    def _slide(self, force: float = stimuli.FORCE) -> drive.DrivenRun:
        """Slide along the straight path, pressed to a mean force."""
        return self.follow(self.pressed_path(force))


class Bench:
    """A method on the scenes of `stimuli`; renderers and slides are shared between measures.

    Each measure returns its number, in the unit of the claim of its name, and the details.

    Parameters
    ----------
    method : Method
    seconds : float, optional
        Processor time that the measures may take together [s].
    """

    def __init__(self, method: Method, seconds: float | None = None) -> None:
        self._method, self._seconds = method, seconds
        self._end = math.inf if seconds is None else time.thread_time() + seconds
        self._ball, self._foot = cache(self._prepared_ball), cache(self._prepared_foot)
        self._to_and_fro = cache(self._slid_to_and_fro)

    def check_time(self) -> None:
        """Raise `OutOfTimeError` once the time is spent."""
        if time.thread_time() > self._end:
            raise OutOfTimeError(f"not measured within {self._seconds:g} s")

    def _prepared_ball(
        self, diameter: float = 3e-3, *, boxes: int = 1, smooth: bool = False
    ) -> Setup:
        return self._prepared(stimuli.ball_on_plate(diameter, boxes=boxes), smooth)

    def _prepared_foot(
        self, *, boxes: int = 1, smooth: bool = False, textured: bool = False
    ) -> Setup:
        return self._prepared(stimuli.foot_on_plate(boxes=boxes, textured=textured), smooth)

    def _prepared(self, scene: Scene, smooth: bool) -> Setup:
        self.check_time()
        scene = scene.smooth() if smooth else scene
        return Setup(scene, _Timed(self._method.prepare(scene), self))

    def _slid_to_and_fro(self, speed: float) -> tuple[Array, Array]:
        """Return poses (n, 7) and forces (n, 3) of a slide to and fro at a speed [m/s]."""
        ball = self._ball()
        path = stimuli.straight_path(ball.scene, stimuli.SPEED)
        height = ball.pressed(path)[0, 2] - path[0, 2]
        poses = drive.raise_path(stimuli.to_and_fro(ball.scene, speed, _SECONDS), height)
        return poses, ball.follow(poses).force

    def offset(self) -> tuple[float, str]:
        """Compare the tangential force with the slope of the offset surface."""
        off = []
        for diameter in stimuli.DIAMETERS:
            ball = self._ball(diameter)
            force = ball.slide().force
            ideal = _ideal(diameter, stimuli.straight_path(ball.scene, stimuli.SPEED), force)
            off.append(_size(force[:, :1] - ideal) / max(_size(ideal), _NOTHING))
        return 100.0 * max(off), _listed(100.0, off, "%")

    def size(self) -> tuple[float, str]:
        """Compare the tangential force on balls of three sizes."""
        sizes = [tangential_rms(self._ball(d).slide().force) for d in stimuli.DIAMETERS]
        mean = float(np.mean(sizes))
        spread = 0.0 if mean <= _NOTHING else 100.0 * float(np.ptp(sizes)) / mean
        return spread, _listed(1e3, sizes, "mN")

    def force(self) -> tuple[float, str]:
        """Compare the tangential force at two normal forces, one three times the other."""
        low, high = (tangential_rms(self._ball().slide(n).force) for n in (_LOW, _HIGH))
        if low <= _NOTHING:
            return 1.0, "no tangential force"
        return high / low, _listed(1e3, [low, high], "mN")

    def torque(self) -> tuple[float, str]:
        """Measure the torque that texture exerts on a sliding flat foot."""
        run = self._foot().slide()
        plain = self._without(lambda: _change(_about_sole(self._foot(smooth=True).slide())))
        return _by_texture(_change(_about_sole(run)), plain, float(run.force[:, 2].mean()))

    def turning(self) -> tuple[float, str]:
        """Measure the vertical torque on a foot that turns in place."""

        def turned(foot: Setup) -> tuple[float, float]:
            run = foot.follow(foot.pressed(stimuli.turning_path(foot.scene)))
            return _change(run.torque[:, 2:]), float(run.force[:, 2].mean())

        rms, push = turned(self._foot(textured=True))
        return _by_texture(rms, self._without(lambda: turned(self._foot(smooth=True))[0]), push)

    def tool(self) -> tuple[float, str]:
        """Compare the forces on a foot with and without waves on it."""
        own, plain = (self._foot(textured=t).slide().force for t in (True, False))
        change, push = _change((own - plain)[:, :2]), float(own[:, 2].mean())
        return 100.0 * change / push, f"{1e3 * change:.3g} mN at {push:.2g} N"

    def centre(self) -> tuple[float, str]:
        """Measure how far the centre of pressure of a flat foot is from its middle."""
        away = []
        for boxes, angle in itertools.product((1, 4), (0.0, 30.0)):
            foot = self._foot(boxes=boxes, smooth=True)
            pose = stimuli.turned(foot.scene.start[None], np.radians([0.0, 0.0, angle]))
            run = foot.follow(foot.pressed(pose))
            turning = _about_sole(run)[0]
            away.append(math.hypot(turning[0], turning[1]) / run.force[0, 2])
        return 1e6 * max(away), _listed(1e6, away, "um")

    def silence(self) -> tuple[float, str]:
        """Measure the tangential force on a smooth plate."""
        ends = (stimuli.DIAMETERS[0], stimuli.DIAMETERS[-1])
        sizes = [tangential_rms(self._ball(d, smooth=True).slide().force) for d in ends]
        return 100.0 * max(sizes) / stimuli.FORCE, _listed(1e3, sizes, "mN")

    def meshing(self) -> tuple[float, str]:
        """Compare the forces on one plate made of 1, 4 and 16 boxes, along the same path."""
        poses = self._ball().pressed_path()
        balls = [self._ball(boxes=n).follow(poses).force for n in (1, 4, 16)]
        size = tangential_rms(balls[0])
        # Without a tangential force, the difference is related to the normal force.
        ball = _difference(balls, size if size > _NOTHING else float(np.abs(balls[0]).max()))

        def foot_difference() -> float:
            poses = self._foot(smooth=True).pressed_path()
            feet = [self._foot(boxes=n, smooth=True).follow(poses).force for n in (1, 4, 16)]
            return _difference(feet, float(np.abs(feet[0]).max()))

        both = [ball, self._without(foot_difference)]
        return 100.0 * max(both), _listed(100.0, both, "%")

    def energy(self) -> tuple[float, str]:
        """Measure the net work along two closed paths, relative to the work to and fro."""

        def round_a_loop(tool: Setup, turn: float) -> float:
            poses = tool.pressed(stimuli.closed_path(tool.scene, turn=turn))
            # Twice round: what a method remembers of its start belongs to the first lap.
            return _net_work(tool.follow(np.concatenate([poses[:-1], poses])), poses)

        both = [round_a_loop(self._ball(), 0.0)]
        both.append(self._without(lambda: round_a_loop(self._foot(), 0.15)))
        return 100.0 * max(both), _listed(100.0, both, "%")

    def speed(self) -> tuple[float, str]:
        """Compare two speeds, one four times the other, over equal times, to and fro."""
        slow, fast = (tangential_rms(self._to_and_fro(v)[1]) for v in (_SLOW, _FAST))
        value = 0.0 if slow <= _NOTHING else 100.0 * abs(fast / slow - 1.0)
        return value, _listed(1e3, [slow, fast], "mN")

    def frequency(self) -> tuple[float, str]:
        """Compare the share of power near speed / wavelength with that of the offset surface."""
        off, shares = [], []
        for speed in (_SLOW, _FAST):
            poses, force = self._to_and_fro(speed)
            if tangential_rms(force) <= _NOTHING:
                raise AsperityError("no tangential force")
            ideal = _ideal(stimuli.DIAMETERS[-1], poses, force)
            shares.append(_share(_across(force), speed))
            off.append(abs(shares[-1] - _share(ideal, speed)))
        return 100.0 * max(off), _listed(100.0, shares, "%")

    def still(self) -> Symptoms:
        """Measure the symptoms of a hand that presses on the slope of a wave."""
        ball = self._ball()
        poses = ball.pressed_path()
        pose = poses[len(poses) // 2].copy()
        pose[0] = 0.25 * stimuli.WAVELENGTH
        centre = place_bodies(ball.scene).centre
        return drive.simulate_resting_hand(ball.renderer, pose, centre, stimuli.FORCE)

    def _without(self, measure: Callable[[], float]) -> float:
        """Return a number; 0 if the method is not made for it: for feet, or without texture."""
        try:
            return measure()
        except OutOfTimeError:
            raise
        except AsperityError:
            return 0.0


def _ideal(diameter: float, poses: Array, force: Array) -> Array:
    """Return the tangential force (n, 1) on a ball along x by the slope of its offset surface."""
    return np.asarray(-force[:, 2:] * stimuli.offset_slope(diameter, poses[:, 0])[:, None])


def _listed(scale: float, values: list[float], unit: str) -> str:
    return ", ".join(f"{scale * value:.3g}" for value in values) + f" {unit}"


def _of_lateral(run: drive.DrivenRun) -> Array:
    """Return the torque about the centre of the foot of the lateral force on its sole [N m]."""
    down = np.array([0.0, 0.0, -stimuli.FOOT[2]])
    return np.asarray(np.cross(down, run.force * np.array([1.0, 1.0, 0.0])))


def _about_sole(run: drive.DrivenRun) -> Array:
    """Return the torque about the middle of the sole (n, 3) [N m]."""
    return run.torque - _of_lateral(run)


def _size(vectors: Array) -> float:
    """Return the RMS size of vectors (n, k)."""
    return math.sqrt(float((vectors**2).sum(axis=1).mean()))


def _change(vectors: Array) -> float:
    """Return the RMS size of the change of vectors (n, k)."""
    return _size(vectors - vectors.mean(axis=0))


def tangential_rms(force: Array) -> float:
    """Return the RMS change of the component of forces (n, 3) perpendicular to their mean [N]."""
    return _change(_across(force))


def _across(force: Array) -> Array:
    return across_mean(force).astype(np.float64)


def _by_texture(rms: float, plain: float, push: float) -> tuple[float, str]:
    """Return a torque over the normal force and half the foot, 0 if it is not the texture's."""
    detail = f"{1e3 * rms:.3g} mN m at {push:.2g} N, {1e3 * plain:.3g} without texture"
    return (100.0 * rms / (push * stimuli.FOOT[0]) if rms > 2.0 * plain else 0.0), detail


def _difference(forces: list[Array], size: float) -> float:
    """Return the largest RMS difference from the first of some forces, over `size`."""
    return max(_size(other - forces[0]) for other in forces[1:]) / size


def _net_work(run: drive.DrivenRun, poses: Array) -> float:
    """Return the net work along the last lap of a closed path over the work to and fro."""
    lap = len(poses)
    force, torque = run.force[-lap:], run.torque[-lap:]
    moved = np.diff(poses[:, :3], axis=0)
    turned = np.array([rotation_between(a, b) for a, b in itertools.pairwise(poses)])
    work = np.sum(0.5 * (force[1:] + force[:-1]) * moved, axis=1)
    work += np.sum(0.5 * (torque[1:] + torque[:-1]) * turned, axis=1)
    moved_work = float(np.abs(work).sum())
    return abs(float(work.sum())) / moved_work if moved_work > 0.0 else 0.0


def _share(force: Array, speed: float, dt: float = 1e-3) -> float:
    """Return the share of the power of forces (n, k) within a quarter of speed / wavelength."""
    change = force - force.mean(axis=0)
    power = np.abs(np.fft.rfft(change * np.hanning(len(change))[:, None], axis=0)) ** 2
    frequency = np.fft.rfftfreq(len(change), dt) / (speed / stimuli.WAVELENGTH)
    return float(power[np.abs(frequency - 1.0) <= 0.25].sum() / power.sum())

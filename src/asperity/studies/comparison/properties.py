"""Properties of a method, each measured on scenes that differ in one parameter.

Every property is a number with a criterion. The verdict states whether the number meets the
criterion, not whether the method is good. The limits of speed and silence were set after the noise
of two methods had been seen, the others before any method was measured.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity.errors import AsperityError
from asperity.runs.figures import across_mean
from asperity.scene.scene import Scene
from asperity.studies.baselines import Method, Renderer
from asperity.studies.baselines.placement import place_bodies
from asperity.studies.comparison import drive, stimuli
from asperity.studies.stability.measure import Symptoms

Array = NDArray[np.float64]


class Criterion(NamedTuple):
    """A measured number, and the limit from which a property holds."""

    title: str
    what: str
    """Definition of the number."""
    unit: str
    limit: float
    above: bool
    """Whether the property holds above the limit, or below it."""


CRITERIA = {
    "torque": Criterion(
        "torque by texture",
        "a flat foot of 6 x 3 mm: RMS change of the torque about its middle, beyond that on a "
        "plate without texture, over the normal force and half its length",
        "%", 1.0, True,
    ),
    "probe_size": Criterion(
        "size of the probe",
        "RMS tangential force with balls of 0.5, 1.5 and 3 mm: largest less smallest, over mean",
        "%", 10.0, True,
    ),
    "force": Criterion(
        "normal force",
        "RMS tangential force pressed with 0.87 N over that with 0.29 N",
        "times", 1.5, True,
    ),
    "speed": Criterion(
        "speed",
        "RMS tangential force at 166 mm/s, less that at 42 mm/s, over it, in size",
        "%", 10.0, True,
    ),
    "silence": Criterion(
        "silence on a smooth plate",
        "RMS tangential force on the plate without texture, over the normal force, with the "
        "noisier of balls of 0.5 and 3 mm",
        "%", 1.0, False,
    ),
    "meshing": Criterion(
        "invariance to meshing",
        "RMS difference of the force on the plate as 4 and as 16 boxes from that as one, over the "
        "RMS tangential force",
        "%", 2.0, False,
    ),
}  # fmt: skip
"""In the order of the tables. The limits are asperity's."""


class Measured(NamedTuple):
    """One property of one method."""

    value: float | None
    """None if it could not be measured."""
    holds: bool | None
    detail: str
    """The numbers from which it is computed, or why there are none."""


class Properties(NamedTuple):
    """All properties of one method."""

    measured: dict[str, Measured]
    still: Symptoms | None
    """Symptoms felt by a hand at rest; None if it could not be simulated."""


STEPS = len(CRITERIA) + 1
"""Number of progress reports of `measure_properties`."""


def measure_properties(
    method: Method, on_step: Callable[[], None] = lambda: None
) -> Properties:  # fmt: skip
    """Return the properties of a method. Takes seconds to a minute."""
    bench = _Bench(method)
    out = {}
    for name, criterion in CRITERIA.items():
        try:
            value, detail = getattr(bench, name)()
        except AsperityError as error:
            out[name] = Measured(None, None, str(error).rpartition("'stimulus': ")[2])
        else:
            holds = value >= criterion.limit if criterion.above else value <= criterion.limit
            out[name] = Measured(value, holds, detail)
        on_step()
    try:
        still = bench.still()
    except AsperityError:
        still = None
    on_step()
    return Properties(out, still)


class _Bench:
    """A method on the scenes of `stimuli`; renderers are shared between properties.

    The property `name` of `CRITERIA` is the method `name`, which returns its number and details.
    """

    def __init__(self, method: Method) -> None:
        self._method = method
        self._ready: dict[tuple[float, int, bool], tuple[Scene, Renderer]] = {}

    def _ball(
        self, diameter: float = 3e-3, *, boxes: int = 1, smooth: bool = False
    ) -> tuple[Scene, Renderer]:
        key = (diameter, boxes, smooth)
        if key not in self._ready:
            scene = stimuli.ball_on_plate(diameter, boxes=boxes)
            self._ready[key] = self._prepared(scene.smooth() if smooth else scene)
        return self._ready[key]

    def _prepared(self, scene: Scene) -> tuple[Scene, Renderer]:
        return scene, self._method.prepare(scene)

    def _slid(self, ready: tuple[Scene, Renderer], force: float = stimuli.FORCE) -> drive.DrivenRun:
        """Slide along the path, pressed to a mean force."""
        return drive.follow_path(ready[1], _pressed_path(*ready, force))

    def torque(self) -> tuple[float, str]:
        """Measure the torque that texture exerts on a sliding flat foot."""
        run = self._slid(self._prepared(stimuli.foot_on_plate()))
        rms, push = _turning(run), float(run.force[:, 2].mean())
        try:
            smooth = self._prepared(stimuli.foot_on_plate().smooth())
            alone = _turning(self._slid(smooth))
        except AsperityError:  # the method cannot render a scene without texture
            alone = 0.0
        value = 100.0 * math.sqrt(max(rms**2 - alone**2, 0.0)) / (push * stimuli.FOOT[0])
        return value, f"{1e3 * rms:.3g} mN m at {push:.2g} N, {1e3 * alone:.3g} without texture"

    def probe_size(self) -> tuple[float, str]:
        """Compare the tangential force on balls of three sizes."""
        sizes = [tangential_rms(self._slid(self._ball(d)).force) for d in stimuli.DIAMETERS]
        return _spread(sizes), ", ".join(f"{1e3 * size:.3g}" for size in sizes) + " mN"

    def force(self) -> tuple[float, str]:
        """Compare the tangential force at two normal forces, one three times the other."""
        low, high = (tangential_rms(self._slid(self._ball(), n).force) for n in (0.29, 0.87))
        if low <= 1e-6:
            return 1.0, "no tangential force"
        return high / low, f"{1e3 * low:.3g} and {1e3 * high:.3g} mN"

    def speed(self) -> tuple[float, str]:
        """Compare two speeds, one four times the other, over equal times, to and fro."""
        scene, renderer = self._ball()
        path = stimuli.straight_path(scene, stimuli.SPEED)
        height = drive.find_pressing_height(renderer, path, stimuli.FORCE)
        sizes = []
        for share, passes in ((0.5, 2), (2.0, 8)):
            there = drive.raise_path(stimuli.straight_path(scene, share * stimuli.SPEED), height)
            poses = np.concatenate([there, there[::-1]] * (passes // 2))
            sizes.append(tangential_rms(drive.follow_path(renderer, poses).force))
        slow, fast = sizes
        value = 0.0 if slow <= 1e-6 else 100.0 * abs(fast / slow - 1.0)
        return value, f"{1e3 * slow:.3g} and {1e3 * fast:.3g} mN"

    def silence(self) -> tuple[float, str]:
        """Measure the tangential force on a smooth plate."""
        balls = [self._ball(d, smooth=True) for d in (stimuli.DIAMETERS[0], stimuli.DIAMETERS[-1])]
        sizes = [tangential_rms(self._slid(ball).force) for ball in balls]
        detail = " and ".join(f"{1e3 * size:.3g}" for size in sizes) + " mN"
        return 100.0 * max(sizes) / stimuli.FORCE, detail

    def meshing(self) -> tuple[float, str]:
        """Compare the forces on one plate made of 1, 4 and 16 boxes, along the same path."""
        poses = _pressed_path(*self._ball())
        one, *others = (
            drive.follow_path(self._ball(boxes=boxes)[1], poses).force for boxes in (1, 4, 16)
        )
        return _difference(one, others)

    def still(self) -> Symptoms:
        """Measure the symptoms of a hand that presses on the slope of a wave."""
        scene, renderer = self._ball()
        poses = _pressed_path(scene, renderer)
        pose = poses[len(poses) // 2].copy()
        pose[0] = 0.25 * stimuli.WAVELENGTH
        return drive.simulate_resting_hand(
            renderer, pose, place_bodies(scene).centre, stimuli.FORCE
        )


def _pressed_path(scene: Scene, renderer: Renderer, force: float = stimuli.FORCE) -> Array:
    """Return the poses (n, 7) of the path, pressed to a mean force [N]."""
    path = stimuli.straight_path(scene, stimuli.SPEED)
    return drive.raise_path(path, drive.find_pressing_height(renderer, path, force))


def _turning(run: drive.DrivenRun) -> float:
    """Return the RMS change of the torque on the foot about the middle of its sole [N m].

    The torque of the lateral force about that point is subtracted.
    """
    change = run.torque - run.torque.mean(axis=0)
    down = np.array([0.0, 0.0, -stimuli.FOOT[2]])
    change = change - np.cross(down, run.force - run.force.mean(axis=0))
    return float(np.sqrt((change**2).sum(axis=1).mean()))


def tangential_rms(force: Array) -> float:
    """Return the RMS change of the component of forces (n, 3) perpendicular to their mean [N]."""
    across = across_mean(force)
    change = across - across.mean(axis=0)
    return float(np.sqrt((change**2).sum(axis=1).mean()))


def _spread(values: list[float]) -> float:
    """Return the largest less the smallest value over the mean, in per cent."""
    mean = float(np.mean(values))
    return 0.0 if mean <= 1e-6 else 100.0 * float(np.ptp(values)) / mean


def _difference(one: Array, others: list[Array]) -> tuple[float, str]:
    """Return the largest RMS difference from `one`, in per cent of its tangential force's RMS."""
    differences = [float(np.sqrt(((other - one) ** 2).sum(axis=1).mean())) for other in others]
    size = tangential_rms(one)
    detail = ", ".join(f"{1e3 * difference:.3g}" for difference in differences)
    if size <= 1e-6:
        # Without a tangential force, relate the difference to the normal force.
        size = float(np.abs(one).max())
    return 100.0 * max(differences) / size, f"{detail} of {1e3 * size:.3g} mN"

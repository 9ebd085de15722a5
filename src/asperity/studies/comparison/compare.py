"""All methods on one scene and one motion."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity.errors import AsperityError
from asperity.runs.figures import force_spectrum
from asperity.scene.scene import Scene
from asperity.scene.trajectory import ScriptedMotion, Trajectory, at_ticks
from asperity.simulation.simulation import Simulation
from asperity.studies.baselines import METHODS, Method, Renderer
from asperity.studies.comparison.drive import DrivenRun, follow, mean_push, pressed_to, raised
from asperity.studies.comparison.properties import (
    STEPS,
    Properties,
    measure_properties,
    tangential_rms,
)

Array = NDArray[np.float64]
BAND = (20.0, 200.0)
"""[Hz], which the studies' own metric takes (asperity's)."""
REFERENCE = METHODS["asperity"]
_BESIDE = 200
"""Ticks of asperity that are timed before and after those of a method."""


@dataclass(frozen=True)
class CompareSettings:
    """What is compared, and for how long.

    Parameters
    ----------
    motion : ScriptedMotion or Trajectory, optional
        Default: the scene's own.
    dt : float
        Tick [s].
    budget : float
        Processor time that one method's ticks may take [s]; slower ones go less far, which the
        number of ticks says.
    properties : bool
        Measure the properties too.
    """

    motion: ScriptedMotion | Trajectory | None = None
    dt: float = 1e-3
    budget: float = 60.0
    properties: bool = True


class ForceSpectrum(NamedTuple):
    """Amplitude of the tangential force over frequency."""

    frequency: Array
    """[Hz]."""
    amplitude: Array
    """[N]."""


class MethodResult(NamedTuple):
    """One method."""

    method: Method
    reason: str | None
    """Why it could not render the scene; then there is nothing else."""
    preparing: float
    """How long making it ready took [s]."""
    height: float
    """How far its path lay above asperity's [m]."""
    felt: DrivenRun | None
    beside: float | None
    """Median tick of asperity just before and after [s]."""
    spectrum: ForceSpectrum | None
    properties: Properties | None

    @property
    def cost(self) -> tuple[float, float] | None:
        """Median and 99th percentile of a tick [s]."""
        if self.felt is None:
            return None
        return float(np.median(self.felt.seconds)), float(np.percentile(self.felt.seconds, 99))

    @property
    def ratio(self) -> float | None:
        """Median tick over asperity's, on the same machine just before and after."""
        if self.cost is None or self.beside is None:
            return None
        return self.cost[0] / self.beside

    @property
    def band_rms(self) -> float | None:
        """RMS of the tangential force between 20 and 200 Hz [N]."""
        if self.spectrum is None:
            return None
        f = self.spectrum.frequency
        inside = (f >= BAND[0]) & (f <= BAND[1])
        # A Hann window spreads a sine over 1.5 lines' worth of power.
        return float(np.sqrt((self.spectrum.amplitude[inside] ** 2).sum() / 2.0 / 1.5))

    @property
    def tangential(self) -> float | None:
        """RMS of the tangential force [N]."""
        return None if self.felt is None else tangential_rms(self.felt.force)


@dataclass(frozen=True)
class Comparison:
    """What came of it."""

    scene: Scene
    settings: CompareSettings
    poses: Array
    """Asperity's path, (n, 7)."""
    push: float
    """The mean force upwards to which all were pressed [N]."""
    rows: list[MethodResult]


def rounded(value: float) -> str:
    """Return a number to three digits, as it is shown; below a thousandth of its unit is noise."""
    if abs(value) < 1e-3:
        return "0"
    return f"{value:.3g}" if abs(value) < 999.5 else f"{float(f'{value:.3g}'):.0f}"


def compare(
    scene: Scene,
    methods: Sequence[Method],
    settings: CompareSettings | None = None,
    *,
    progress: Callable[[str, int], None] = lambda what, done: None,
) -> Comparison:
    """Run methods along one motion, and measure their properties.

    Parameters
    ----------
    scene : Scene
        Its friction is left out: not all methods have any.
    methods : sequence of Method
    settings : CompareSettings, optional
    progress : callable
        Called with what is done and how far it is, in per cent.

    Raises
    ------
    AsperityError
        If the motion cannot be made, or the tool meets nothing on its way.
    """
    settings = settings or CompareSettings()
    scene = scene.changed(force={"friction": 0.0})
    progress("asperity's path", 0)
    poses = path_of(scene, settings)
    reference = REFERENCE.prepare(scene, dt=settings.dt)
    push = mean_push(reference, poses)
    if push <= 0.0:
        raise AsperityError(
            f"on this motion the tool of scene {scene.name!r} is not pushed up; nothing to compare"
        )
    rows = []
    for method in methods:
        row = _row(method, scene, settings, poses, push, reference, progress)
        rows.append(row)
    return Comparison(scene, settings, poses, push, rows)


def path_of(scene: Scene, settings: CompareSettings) -> Array:
    """Return the poses (n, 7) of a motion, tick by tick, pressed as asperity's own model says."""
    simulation = Simulation(scene, dt=settings.dt)
    trajectory = simulation.trajectory(settings.motion)
    return np.asarray(at_ticks(trajectory, settings.dt), dtype=np.float64)


def _row(
    method: Method, scene: Scene, settings: CompareSettings, poses: Array, push: float,
    reference: Renderer, progress: Callable[[str, int], None],
) -> MethodResult:  # fmt: skip
    """Do one method."""
    progress(f"{method.label}: preparing", 0)
    properties = None
    if settings.properties:
        done = 0

        def step() -> None:
            nonlocal done
            done += 1
            progress(f"{method.label}: properties", round(100 * done / STEPS))

        properties = measure_properties(method, step)
    nothing = MethodResult(method, method.can(scene), 0.0, 0.0, None, None, None, properties)
    if nothing.reason is not None:
        return nothing
    done = 0

    def tick() -> None:
        nonlocal done
        done += 1
        if done % 50 == 0:
            progress(f"{method.label}: ticks", round(100 * done / len(poses)))

    begun = time.perf_counter()
    try:
        renderer = method.prepare(scene, dt=settings.dt)
        preparing = time.perf_counter() - begun
        progress(f"{method.label}: pressing", 0)
        height = 0.0 if method is REFERENCE else pressed_to(renderer, poses, push)
        # Just before, and not before what may take minutes: the machine is not always as fast.
        before = follow(reference, poses[:_BESIDE]).seconds
        felt = follow(renderer, raised(poses, height), budget=settings.budget, on_tick=tick)
    except AsperityError as error:
        return nothing._replace(reason=str(error))
    except MemoryError:  # one method must not take the others with it
        return nothing._replace(reason="it needs more memory than there is")
    after = follow(reference, poses[:_BESIDE]).seconds
    beside = float(np.median(np.concatenate([before, after])))
    frequency, level = force_spectrum(felt.force, settings.dt)
    spectrum = ForceSpectrum(frequency.astype(np.float64), level.astype(np.float64))
    return MethodResult(method, None, preparing, height, felt, beside, spectrum, properties)

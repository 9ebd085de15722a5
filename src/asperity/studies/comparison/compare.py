"""Run all methods on one scene and one motion, and measure them."""

from __future__ import annotations

import itertools
import runpy
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity.errors import AsperityError
from asperity.runs.figures import across_mean, force_spectrum
from asperity.scene.scene import Scene
from asperity.scene.skin import require_rigid
from asperity.scene.trajectory import ScriptedMotion, Trajectory, at_ticks
from asperity.simulation.simulation import Simulation
from asperity.studies.baselines import METHODS, Method, Renderer, choose_methods
from asperity.studies.comparison import drive
from asperity.studies.comparison.claims import (
    CLAIMS,
    STEPS,
    MethodClaims,
    measure_claims,
    stored_claims,
)
from asperity.studies.comparison.measures import tangential_rms

Array = NDArray[np.float64]
BAND = (20.0, 200.0)
"""Band of the studies' metric `band_rms` [Hz] (asperity's)."""
REFERENCE = METHODS["asperity"]
_CLAIM_SECONDS = 60.0
"""Processor time after which claims about a method are left out [s]."""
_REFERENCE_TICKS = slice(0, 200)
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
        Processor time that the ticks of one method may take [s]; slower methods have fewer ticks.
    claims : sequence of str, optional
        Which of `CLAIMS` to measure, at most a minute each method. By default all about methods of
        one's own; those about `METHODS` are the stored ones.
    """

    motion: ScriptedMotion | Trajectory | None = None
    dt: float = 1e-3
    budget: float = 1.0
    claims: Sequence[str] | None = None


class ForceSpectrum(NamedTuple):
    """Amplitude spectrum of the tangential force."""

    frequency: Array
    """[Hz]."""
    amplitude: Array
    """[N]."""


class Rendered(NamedTuple):
    """What a method rendered along the motion, and at what cost."""

    preparing: float
    """Duration of its preparation [s]."""
    height: float
    """Height of its path above asperity's [m]."""
    run: drive.DrivenRun
    reference_tick: float
    """Median tick of asperity just before and after it [s]."""
    spectrum: ForceSpectrum

    @property
    def cost(self) -> tuple[float, float]:
        """Median and 99th percentile of a tick [s]."""
        return float(np.median(self.run.seconds)), float(np.percentile(self.run.seconds, 99))

    @property
    def ratio(self) -> float:
        """Median tick over asperity's, timed on the same machine just before and after."""
        return self.cost[0] / self.reference_tick

    @property
    def band_rms(self) -> float:
        """RMS of the tangential force between 20 and 200 Hz, at most its RMS change [N]."""
        f = self.spectrum.frequency
        inside = (f >= BAND[0]) & (f <= BAND[1])
        # Without a window, by Parseval: a part of `tangential`, to the last digit.
        parts = np.fft.rfft(across_mean(self.run.force), axis=0)[inside]
        return float(np.sqrt(2.0 * (np.abs(parts) ** 2).sum()) / len(self.run.force))

    @property
    def mean_tangential(self) -> float:
        """Size of the mean horizontal force [N]."""
        return float(np.linalg.norm(self.run.force.mean(axis=0)[:2]))

    @property
    def tangential(self) -> float:
        """RMS change of the tangential force [N]."""
        return tangential_rms(self.run.force)

    @property
    def torque(self) -> tuple[float, float]:
        """Size of the mean torque about the centre of mass, and RMS size of its change [N m]."""
        mean = self.run.torque.mean(axis=0)
        change = np.linalg.norm(self.run.torque - mean, axis=1)
        return float(np.linalg.norm(mean)), float(np.sqrt(np.mean(change**2)))


class MethodResult(NamedTuple):
    """Results of one method."""

    method: Method
    reason: str | None
    """Why it could not render the scene; then only `claims` may be present."""
    rendered: Rendered | None
    claims: MethodClaims | None


@dataclass(frozen=True)
class Comparison:
    """Result of `compare`."""

    scene: Scene
    settings: CompareSettings
    poses: Array
    """Asperity's path, (n, 7)."""
    push: float
    """The mean upward force to which all methods were pressed [N]."""
    rows: list[MethodResult]


def format_number(value: float) -> str:
    """Return a number with three digits; values below a thousandth are noise and become 0."""
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
    """Run methods along one motion, and measure claims about them.

    Parameters
    ----------
    scene : Scene
        Its friction is ignored, because not all methods have any.
    methods : sequence of Method
    settings : CompareSettings, optional
    progress : callable
        Called with the current step and its progress in per cent.

    Raises
    ------
    AsperityError
        If the motion cannot be made, the tool touches nothing along it, a geom has a surface of
        its own, or a body has a soft skin.
    """
    require_rigid(scene, "the methods are of rigid bodies")
    settings = settings or CompareSettings()
    for body in scene.bodies:
        if any(geom.surface is not None for geom in body.geoms):
            raise AsperityError(
                f"geoms of body {body.name!r} have surfaces of their own, which the other methods "
                "do not know: give the body one texture to compare"
            )
    scene = scene.changed(force={"friction": 0.0})
    progress("asperity's path", 0)
    poses = make_path(scene, settings)
    reference = REFERENCE.prepare(scene, dt=settings.dt)
    push = drive.mean_push(reference, poses)
    if push <= 0.0:
        raise AsperityError(
            f"on this motion the tool of scene {scene.name!r} is not pushed up: nothing to compare"
        )
    rows = [_row(method, scene, settings, poses, push, reference, progress) for method in methods]
    return Comparison(scene, settings, poses, push, rows)


def make_path(scene: Scene, settings: CompareSettings) -> Array:
    """Return the poses (n, 7) of a motion, one a tick, pressed according to asperity's model."""
    simulation = Simulation(scene, dt=settings.dt)
    trajectory = simulation.trajectory(settings.motion)
    return np.asarray(at_ticks(trajectory, settings.dt), dtype=np.float64)


def _row(
    method: Method, scene: Scene, settings: CompareSettings, poses: Array, push: float,
    reference: Renderer, progress: Callable[[str, int], None],
) -> MethodResult:  # fmt: skip
    """Run one method and measure claims about it."""
    progress(f"preparing {method.label}", 0)
    claims = None
    if settings.claims is None and METHODS.get(method.name) is method:
        claims = stored_claims().get(method.name)
    elif settings.claims is None or settings.claims:
        step = _counter(progress, f"claims of {method.label}", STEPS)
        names = settings.claims or tuple(CLAIMS)
        claims = measure_claims(method, names, seconds=_CLAIM_SECONDS, on_step=step)
    failed = MethodResult(method, method.can(scene), None, claims)
    if failed.reason is not None:
        return failed
    tick = _counter(progress, f"ticks of {method.label}", len(poses), every=50)
    begun = time.perf_counter()
    try:
        renderer = method.prepare(scene, dt=settings.dt)
        preparing = time.perf_counter() - begun
        progress(f"pressing {method.label}", 0)
        drive.refuse_slow(renderer, poses, settings.budget)
        height = 0.0 if method is REFERENCE else drive.find_pressing_height(renderer, poses, push)
        # Right before the run: preparing may take minutes, in which the machine's speed changes.
        before = drive.follow_path(reference, poses[_REFERENCE_TICKS]).seconds
        run = drive.follow_path(
            renderer, drive.raise_path(poses, height), budget=settings.budget, on_tick=tick
        )
    except AsperityError as error:
        return failed._replace(reason=str(error))
    except MemoryError:  # the other methods must still run
        return failed._replace(reason="it needs more memory than there is")
    after = drive.follow_path(reference, poses[_REFERENCE_TICKS]).seconds
    reference_tick = float(np.median(np.concatenate([before, after])))
    frequency, level = force_spectrum(run.force, settings.dt)
    spectrum = ForceSpectrum(frequency.astype(np.float64), level.astype(np.float64))
    rendered = Rendered(preparing, height, run, reference_tick, spectrum)
    return MethodResult(method, None, rendered, claims)


def _counter(
    progress: Callable[[str, int], None], what: str, total: int, *, every: int = 1
) -> Callable[[], None]:
    """Return a function that reports, every so many calls, how many of `total` there were [%]."""
    numbers = itertools.count(1)

    def count() -> None:
        done = next(numbers)
        if done % every == 0:
            progress(what, round(100 * done / total))

    return count


def find_methods(names: Iterable[str]) -> list[Method]:
    """Return methods by name, and those that Python files define; all of `METHODS` by default.

    Parameters
    ----------
    names : iterable of str
        Keys of `METHODS`, or paths that end in `.py`. A file is run; every `Method` among its
        global variables counts.

    Raises
    ------
    AsperityError
        For an unknown name, and for a file that is missing, fails, or defines no method.
    """
    names = list(names)
    own = [method for name in names if name.endswith(".py") for method in _defined_in(Path(name))]
    known = [name for name in names if not name.endswith(".py")]
    return [*(choose_methods(known) if known or not own else []), *own]


def _defined_in(path: Path) -> list[Method]:
    """Return the methods among the global variables of a Python file."""
    if not path.is_file():
        raise AsperityError(f"--method: no such file: {path}")
    try:
        values = runpy.run_path(str(path)).values()
    except Exception as error:  # whatever the file does wrong is one line
        raise AsperityError(f"--method: {path} failed: {type(error).__name__}: {error}") from error
    found = {one.name: one for one in values if isinstance(one, Method)}
    if not found:
        raise AsperityError(f"--method: {path} defines no instance of asperity's Method")
    taken = sorted(set(found) & set(METHODS))
    if taken:
        raise AsperityError(f"--method: {path} defines {taken[0]!r}, which is a built-in method")
    return list(found.values())

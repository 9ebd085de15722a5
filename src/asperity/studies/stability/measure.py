r"""Stability of a scene: its largest stable stiffness over rate and damping, and two symptoms.

A wall of stiffness K, sampled every T, supplies energy to a hand: the held force lags by half a
tick, which acts like a damper of `-K T / 2`. The wall is passive while

    b > K T / 2 + |B|        (Colgate & Schenkel 1997)

with b the damping of the device and B the commanded damping (here 0). A texture raises the
stiffness: the Hessian of U is `k (grad delta grad delta^T + delta Hessian(delta))`, and at kinks
the second term is unbounded. So the limit is measured on the scene itself: a mass with the damping
b, pressed onto it with a constant force and held laterally by a spring, is made to oscillate by a
fraction of its depth. Below the limit the oscillation decays, above it it grows. The contact force
is proportional to the stiffness, so one contact solver serves all stiffnesses.

*Buzzing and aliveness* (Choi & Tan 2004), with the simulated hand pressing and its target at rest:
the RMS of the force above 150 Hz, and of its change below 20 Hz.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from asperity.dynamics.dragged_hand.hand import Hand
from asperity.dynamics.simulated_hand.hand import transition
from asperity.dynamics.virtual_coupling.settings import COUPLING_MODES
from asperity.errors import AsperityError, require_between, require_positive
from asperity.scene.scene import Scene
from asperity.scene.skin import require_rigid
from asperity.scene.trajectory import ScriptedMotion
from asperity.simulation.press import pressed_pose, touching_pose
from asperity.simulation.simulation import Simulation
from asperity.simulation.tool_contact import ToolContact

ArrayOrFloat = TypeVar("ArrayOrFloat", float, NDArray[np.float64])
BUZZING, ALIVENESS = 150.0, 20.0
"""Buzzing is measured above the first, aliveness below the second frequency [Hz]."""
AMPLITUDE = 0.1
"""Amplitude of the oscillation over the depth; asperity's."""
ASIDE = 0.05
"""Offset of resting hands from the tested places, over the span: exactly in a notch no force would
move them; asperity's."""
DEEPEST = 1e-3
"""Largest depth in a trial [m]; the force on a soft wall is reduced accordingly."""
TICKS = 320
"""Ticks of one trial."""
STIFFEST, SOFTEST = 1e6, 1.0
"""Range in which limits are searched [N/m]."""
TOLERANCE = 0.02
"""Tolerance of the logarithm of a limit."""
_HALVINGS = 12
_STEP = 1e-5
"""Step of the finite differences of the Hessian [m]."""


@dataclass(frozen=True)
class StabilitySettings:
    """What is measured; the defaults are asperity's.

    Parameters
    ----------
    rates : sequence of float
        Tick rates [Hz].
    dampings : sequence of float
        Damping of the device, or of device and hand together [N s/m].
    hand : Hand
        Its mass, and the stiffness that holds it laterally.
    force : float
        Force that presses it onto the scene [N].
    places : int
        Number of places along one `span` at which textured scenes are tested.
    span : float, optional
        Length along x over which the places are distributed [m]; by default the longest wave of
        the scene, or 2 mm.
    """

    rates: Sequence[float] = (500.0, 1000.0, 2000.0, 4000.0)
    dampings: Sequence[float] = (0.1, 0.3, 1.0, 3.0)
    hand: Hand = field(default_factory=Hand)
    force: float = 0.58
    places: int = 4
    span: float | None = None

    def __post_init__(self) -> None:
        if not (len(self.rates) and len(self.dampings)):
            raise AsperityError("rates and dampings need at least one value each")
        for rate in self.rates:
            require_between("rate", rate, 10.0, 1e5, "Hz")
        for damping in self.dampings:
            require_positive("damping", damping, "[N s/m]")
        require_positive("force", self.force, "[N]")
        require_between("places", self.places, 1, 100)


class Symptoms(NamedTuple):
    """Symptoms of instability felt by a hand whose target is at rest."""

    buzzing: float
    """RMS of the force above 150 Hz [N]."""
    aliveness: float
    """RMS of the force's change below 20 Hz [N]."""
    force: float
    """Mean magnitude of the force [N]."""
    motion: float
    """Largest excursion of the handle [m]."""


@dataclass(frozen=True, eq=False)
class Stability:
    """Result of `measure_stability`: arrays (rates, dampings) of stiffnesses [N/m]."""

    settings: StabilitySettings
    bound: NDArray[np.float64]
    """Colgate's bound, `2 b / T`."""
    plain: NDArray[np.float64]
    """Limit of the scene without its textures."""
    textured: NDArray[np.float64]
    """Limit at the worst of the places."""
    median: NDArray[np.float64]
    """Median of the limits over the places."""
    raised: NDArray[np.float64]
    """Largest eigenvalue of the Hessian of U over translations, divided by k; (places,)."""
    symptoms: dict[str, Symptoms]
    """Mode of the coupling -> symptoms at the scene's stiffness and 1 kHz."""


def measure_stability(
    scene: Scene,
    settings: StabilitySettings | None = None,
    *,
    modes: Sequence[str] = COUPLING_MODES,
    progress: Callable[[], None] = lambda: None,
) -> Stability:
    """Return the limits of a scene. `progress` is called `len(rates) * len(dampings)` times."""
    require_rigid(scene, "stability varies force.stiffness, which does not act on it")
    settings = settings or StabilitySettings()
    quiet = scene.changed(force={"anti_alias": "off", "friction": 0.0})
    flat, rough = Wall(quiet.smooth(), settings), Wall(quiet, settings)
    poses = rough.places()
    offset_poses = [pose + ASIDE * rough.span * np.eye(7)[0] for pose in poses]
    shape = (len(settings.rates), len(settings.dampings))
    plain, textured, median = np.empty(shape), np.empty(shape), np.empty(shape)
    level = flat.places()[0]
    for i, rate in enumerate(settings.rates):
        for j, damping in enumerate(settings.dampings):
            plain[i, j] = flat.limit(level, rate, damping)
            limits = [rough.limit(pose, rate, damping) for pose in poses]
            textured[i, j], median[i, j] = min(limits), float(np.median(limits))
            progress()
    bound = 2.0 * np.outer(settings.rates, settings.dampings)
    raised = np.array([rough.raised(pose) for pose in poses])
    symptoms = {
        mode: measure_symptoms(scene.changed(coupling={"mode": mode}), settings, offset_poses)
        for mode in modes
    }
    return Stability(settings, bound, plain, textured, median, raised, symptoms)


class Wall:
    """A scene against which a mass is pressed without rotation: forces for any stiffness."""

    def __init__(self, scene: Scene, settings: StabilitySettings) -> None:
        self.settings = settings
        self._engine = ToolContact(scene).engine
        self._stiffness = scene.force.stiffness
        motion = scene.motion
        start = scene.start.copy()
        if isinstance(motion, ScriptedMotion) and motion.start is not None:
            start[:3] = motion.start
        self._start = start
        waves = [field.shortest_wavelength for body in scene.bodies for field in body.fields]
        self.span = settings.span or min(max(waves, default=2e-3), 2e-2)
        """Length along x over which places are distributed [m]."""

    def places(self) -> list[NDArray[np.float64]]:
        """Return poses (7,) with the contact force `settings.force` at the scene's stiffness."""
        poses = []
        for k in range(self.settings.places):
            pose = self._start.copy()
            pose[0] += self.span * k / self.settings.places
            touching = touching_pose(self._engine, pose)
            poses.append(pressed_pose(self._engine, touching, self.settings.force))
        return poses

    def force(self, pose: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the force (3,) at a pose, divided by the stiffness [m]."""
        return np.asarray(self._engine.wrench(pose, 1e-3)[:3] / self._stiffness)

    def energy(self) -> float:
        """Return U at the last pose of `force`, divided by the stiffness [m^2]."""
        contacts = self._engine.contacts
        n = int(contacts.count[0])
        return float(0.5 * contacts.weight[:n] @ contacts.depth[:n] ** 2)

    def raised(self, pose: NDArray[np.float64]) -> float:
        """Return the largest eigenvalue of the Hessian of U over translations, divided by k."""
        self._engine.reset()
        hessian = np.empty((3, 3))
        for axis in range(3):
            ends = []
            for sign in (1.0, -1.0):
                moved = pose.copy()
                moved[axis] += sign * _STEP
                ends.append(self.force(moved))
            hessian[axis] = (ends[1] - ends[0]) / (2.0 * _STEP)
        return float(np.linalg.eigvalsh(0.5 * (hessian + hessian.T))[-1])

    def limit(self, pose: NDArray[np.float64], rate: float, damping: float) -> float:
        """Return the largest stiffness [N/m] at which an oscillation decays, to 2 %."""

        def decays(logarithm: float) -> bool:
            return self.decays(pose, math.exp(logarithm), rate, damping)

        low, high = math.log(SOFTEST), math.log(STIFFEST)
        # Bracket it around Colgate's bound first: it is rarely far from it.
        near = math.log(min(max(2.0 * damping * rate, 2.0 * SOFTEST), 0.5 * STIFFEST))
        for guess in (near - 2.0, near + 0.7):
            if low < guess < high:
                if not decays(guess):
                    high = guess
                    break
                low = guess
        for _ in range(_HALVINGS):
            if high - low < TOLERANCE:
                break
            middle = 0.5 * (low + high)
            low, high = (middle, high) if decays(middle) else (low, middle)
        return math.exp(0.5 * (low + high))

    def decays(
        self, pose: NDArray[np.float64], stiffness: float, rate: float, damping: float
    ) -> bool:
        """Return whether an oscillation of the mass about its equilibrium decays."""
        hand, T = self.settings.hand, 1.0 / rate
        self._engine.reset()
        # The depth that gives about the same force at this stiffness.
        here = pose.copy()
        depth = float(self.force(here)[2])
        wanted = min(depth * self._stiffness / stiffness, DEEPEST)
        here[2] += depth - wanted
        rest = here.copy()
        balance = stiffness * self.force(rest)
        least = stiffness * self.energy()
        depth = wanted
        velocity = np.zeros(3)
        velocity[2] = AMPLITUDE * depth * math.sqrt(stiffness / hand.mass)
        velocity[0] = 0.5 * velocity[2]
        spring = np.array([hand.stiffness, hand.stiffness, 0.0])
        # A held force moves the mass against its damper, laterally also against the hand's spring.
        lateral = transition(hand.mass, damping, hand.stiffness, T)
        vertical = transition(hand.mass, damping, 0.0, T)
        energies, most = np.empty(TICKS), 0.0
        force = balance.copy()
        for i in range(TICKS):
            push, away = force - balance, here[:3] - rest[:3]
            away[:2], velocity[:2] = _advance(lateral, away[:2], velocity[:2], push[:2])
            away[2], velocity[2] = _advance(vertical, away[2], velocity[2], push[2])
            here[:3] = rest[:3] + away
            force = stiffness * self.force(here)
            stored = stiffness * self.energy() - least
            energies[i] = (
                0.5 * hand.mass * float(velocity @ velocity) + stored + float(balance @ away)
                + 0.5 * float(spring @ away**2)
            )  # fmt: skip
            most = max(most, abs(float(away[2])))
            if most > 3.0 * depth:
                return False
        quarter = TICKS // 4
        return bool(energies[-quarter:].mean() < energies[quarter : 2 * quarter].mean())


def _advance(
    tick: tuple[float, ...], place: ArrayOrFloat, velocity: ArrayOrFloat, force: ArrayOrFloat
) -> tuple[ArrayOrFloat, ArrayOrFloat]:
    """Return place and velocity a tick later, numbers or vectors; see `transition`."""
    a, b, c, d, e, f = tick
    return a * place + b * velocity + c * force, d * place + e * velocity + f * force


def measure_symptoms(
    scene: Scene, settings: StabilitySettings, poses: Sequence[NDArray[np.float64]]
) -> Symptoms:
    """Return the symptoms felt by a pressing simulated hand whose target is at rest.

    At 1 kHz with the scene's stiffness, over 0.4 s after 0.4 s: the largest over the poses.
    """
    simulation = Simulation(scene)
    worst = []
    for pose in poses:
        motion = ScriptedMotion(
            "rotate", seconds=0.8, turning=0.0, press_force=settings.force, start=pose[:3].tolist()
        )
        rollout = simulation.rollout(motion, hand=simulation.hand(motion))
        force, moved = rollout.device_wrench[401:, :3], rollout.handle_pose[401:, :3]
        worst.append(symptoms_of(force, moved, simulation.dt))
    return Symptoms(*np.max(worst, axis=0).tolist())


def symptoms_of(force: NDArray[np.float64], moved: NDArray[np.float64], dt: float) -> Symptoms:
    """Return the symptoms of a resting hand from forces (n, 3) [N] and its places (n, 3) [m]."""
    change = force - force.mean(axis=0)
    window = np.hanning(len(change))[:, None]
    lines = np.abs(np.fft.rfft(change * window / np.sqrt(np.mean(window**2)), axis=0))
    frequencies = np.fft.rfftfreq(len(change), dt)
    power = 2.0 * (lines**2).sum(axis=1) / len(change) ** 2
    return Symptoms(
        float(np.sqrt(power[frequencies > BUZZING].sum())),
        float(np.sqrt(power[frequencies < ALIVENESS].sum())),
        float(np.linalg.norm(force, axis=1).mean()),
        float(np.ptp(moved, axis=0).max()),
    )


def summary(result: Stability, scene: Scene) -> dict[str, Any]:
    """Return the results for a file of JSON, in SI units."""
    settings = result.settings
    return {
        "schema": 1,
        "scene": scene.name,
        "rates_hz": list(settings.rates),
        "dampings_n_s_m": list(settings.dampings),
        "mass_kg": settings.hand.mass,
        "sideways_stiffness_n_m": settings.hand.stiffness,
        "force_n": settings.force,
        "colgate_n_m": result.bound.tolist(),
        "plain_n_m": result.plain.tolist(),
        "textured_worst_n_m": result.textured.tolist(),
        "textured_median_n_m": result.median.tolist(),
        "hessian_over_stiffness": result.raised.tolist(),
        "scene_stiffness_n_m": scene.force.stiffness,
        "symptoms": {mode: values._asdict() for mode, values in result.symptoms.items()},
    }

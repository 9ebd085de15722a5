r"""Symptoms of a point-based method under a hand at rest, at any stiffness and tick rate.

A simulated hand presses the tool onto a texture. Choi & Tan name three instabilities of their laws:

- *buzzing*: high frequencies in the force, from a spring too stiff for the tick rate;
- *aliveness*: the force changes slowly though the hand believes itself still and the system is
  passive. A hand is never still: its target drifts here by some tens of micrometres;
- *ridge instability*: a hand that rests on a ridge is pushed into a valley.

The force is held between ticks, as a device holds it, and its spectrum is that of the held force:
at a low rate the steps themselves are high frequencies. The force of a method must be proportional
to its stiffness; then one renderer serves all stiffnesses. The hand, its drift and the limits are
asperity's: a simulated hand has no resonant device, so trends can be compared with theirs, numbers
cannot.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from asperity.dynamics.dragged_hand.hand import Hand
from asperity.dynamics.simulated_hand.hand import HandSettings, SimulatedHand
from asperity.errors import AsperityError, require_between, require_positive
from asperity.studies.stability.measure import Symptoms, symptoms_of

Array = NDArray[np.float64]
HELD_RATE = 40_000.0
"""Rate at which the held force is sampled for its spectrum [Hz]; the highest of Choi & Tan."""
CLEAN = 5e-3
"""Buzzing up to which a stiffness counts as clean [N]; asperity's."""
_SOFTEST, _STIFFEST = 500.0, 2e5
"""Range of stiffness [N/m]."""
_STARTS_OFF = 0.02
"""By how much of its depth the tool starts beside its equilibrium: exactly there nothing grows."""
_FIRST_STEP, _DEEPEST = 2e-5, 2e-3
"""First step and end of the search for the pressed pose [m]."""


class _Renders(Protocol):
    def wrench(self, pose: Array) -> Any: ...
    def reset(self) -> None: ...


@dataclass(frozen=True)
class Rest:
    """How a hand rests on a surface; the defaults are asperity's.

    Parameters
    ----------
    stiffness : float
        Of the contact [N/m].
    rate : float
        Tick rate [Hz], 10 to 1e5.
    force : float
        With which the hand presses [N].
    drift, drift_rate : float
        Amplitude [m] and frequency [Hz] of the involuntary motion of the hand's target along x.
    speed : float
        Of the target along x [m/s]: above 0 the hand strokes.
    seconds : float
        Simulated time, the first half of which is not measured [s].
    hand : Hand
        Its mass, stiffness and damping.
    """

    stiffness: float
    rate: float = 1000.0
    force: float = 0.58
    drift: float = 0.0
    drift_rate: float = 2.0
    speed: float = 0.0
    seconds: float = 0.4
    hand: Hand = field(default_factory=Hand)

    def __post_init__(self) -> None:
        require_positive("stiffness", self.stiffness, "[N/m]")
        require_between("rate", self.rate, 10.0, 1e5, "Hz")
        require_positive("force", self.force, "[N]")
        require_positive("seconds", self.seconds, "[s]")


class RestRun(NamedTuple):
    """A hand that rests, one row a tick."""

    force: Array
    """On the hand [N], (n, 3)."""
    place: Array
    """Of the tool's frame [m], (n, 3)."""
    taken: Array
    """Energy that the surface has taken from the hand so far, including that of pressing in [J],
    (n,). Where it is nowhere below 0, the surface was passive (the passivity observer of Hannaford
    & Ryu)."""
    symptoms: Symptoms
    """Of the last half, of the held force."""


def rest(renderer: _Renders, rendered: float, pose: Array, how: Rest) -> RestRun:
    """Let a hand rest over a pose.

    Parameters
    ----------
    renderer : Renderer
        Of a method whose force is proportional to its stiffness.
    rendered : float
        The stiffness that it renders [N/m].
    pose : (7,) array
        Over the place to press on; its height is found.
    how : Rest

    Raises
    ------
    AsperityError
        Nothing below the pose can be pressed with that force.
    """
    scale = how.stiffness / rendered
    start, depth = _pressed(renderer, scale, pose, how.force)

    def target(time: float) -> Array:
        at = start.copy()
        swing = how.drift * math.sin(2.0 * math.pi * how.drift_rate * time)
        at[0] += swing + how.speed * time
        return at

    dt = 1.0 / how.rate
    hand = SimulatedHand(target, HandSettings(hand=how.hand, press_force=how.force), dt=dt)
    renderer.reset()
    count = max(round(how.seconds * how.rate), 4)
    forces, places, taken = np.empty((count, 3)), np.empty((count + 1, 3)), np.empty(count)
    places[0] = hand.pose[:3]
    energy = 0.5 * how.force * depth
    for i in range(count):
        forces[i] = scale * renderer.wrench(hand.pose).force
        hand.advance(np.concatenate([forces[i], np.zeros(3)]))
        places[i + 1] = hand.pose[:3]
        energy -= float(forces[i] @ (places[i + 1] - places[i]))
        taken[i] = energy
    half, hold = count // 2, max(round(HELD_RATE * dt), 1)
    held = np.repeat(forces[half:], hold, axis=0)
    symptoms = symptoms_of(held, places[half:-1], dt / hold)
    return RestRun(forces, places[:-1], taken, symptoms)


def _pressed(renderer: _Renders, scale: float, pose: Array, force: float) -> tuple[Array, float]:
    """Return a pose a little beside the one that is pressed with a force [N], and its depth [m]."""

    def felt(down: float) -> tuple[Array, float, float]:
        at = pose.copy()
        at[2] -= down
        renderer.reset()
        wrench = renderer.wrench(at)
        return at, scale * float(wrench.force[2]), float(wrench.depth)

    low, high = 0.0, _FIRST_STEP
    while felt(high)[1] < force:
        if high >= _DEEPEST:
            raise AsperityError(
                f"nothing within {1e3 * _DEEPEST:g} mm below the pose resists {force:g} N"
            )
        low, high = high, min(2.0 * high, _DEEPEST)
    for _ in range(50):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if felt(middle)[1] < force else (low, middle)
    depth = felt(high)[2]
    return felt(high - _STARTS_OFF * depth)[0], depth


def clean_stiffness(
    run: Callable[[float], RestRun], *, limit: float = CLEAN, halvings: int = 8
) -> float:
    """Return the largest stiffness below which no buzzing was found [N/m], by bisection.

    `run` rests a hand at a stiffness; the buzzing is clean up to `limit` [N].
    """
    low, high = math.log(_SOFTEST), math.log(_STIFFEST)
    for _ in range(halvings):
        middle = 0.5 * (low + high)
        is_clean = run(math.exp(middle)).symptoms.buzzing <= limit
        low, high = (middle, high) if is_clean else (low, middle)
    return math.exp(low)

r"""A hand that nobody has: mass, spring and damper in six directions round a moving target.

Otaduy & Lin's Eq. 7 along each axis, where l is how far the handle is ahead of its target:

    m l'' = -k l - b l' + F,    J theta'' = -k_r theta - b_r theta' + tau,

with F and tau the wrench that the hand feels. It is linear while a wrench is held, so a tick of it
is solved exactly; only the wrench is sampled, as it is for a person. Its mass is where the tool has
its centre of mass.

*Pressing.* A person who is asked for a force watches it and presses more or less, slowly. So the
target is moved along the normal by an offset p,

    p' = (F_wanted - F_n) / (k t_press),

while there is contact, F_n the force on the hand along the normal. It begins at `F_wanted / k`,
which is where it rests; or comes to it within some time of contact, evenly, and is regulated from
then on.

Mass, stiffness and damping are `Hand`'s; those of rotation, and t_press, are asperity's: no source
gives them together.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from asperity.dynamics.dragged_hand.hand import Hand
from asperity.dynamics.simulated_hand.step import NUMBERS, OFFSET, hand_tick
from asperity.errors import (
    AsperityError,
    require_between,
    require_finite,
    require_not_negative,
    require_positive,
)
from asperity.geometry.poses import rotation_between
from asperity.geometry.rigid_body import centre_of_mass, cross

MOST_OFFSET = 0.02
"""How far a hand presses beyond its target, at most [m]."""


@dataclass(frozen=True)
class HandSettings:
    """How a simulated hand holds and presses. All defaults are asperity's.

    Parameters
    ----------
    hand : Hand
        Of Eq. 7, along every axis.
    along_normal : Hand, optional
        Another one along the normal: light and soft, it presses with a constant force, as the
        paper's studies assume. By default the same.
    moment : float
        Moment of inertia about every axis [kg m^2].
    rotational_stiffness, rotational_damping : float
        [N m/rad], [N m s/rad].
    press_force : float, optional
        Regulated normal force [N]; by default none is regulated.
    press_time : float
        Time constant of the regulation [s].
    preload : bool
        Whether it begins as if it had been pressing for long.
    press_in : float
        Within this time of feeling a force it comes to press so; 0: from the first tick on [s].
    normal : (3,)
        Direction that the force on the hand is counted along; need not be of unit length.
    """

    hand: Hand = field(default_factory=Hand)
    along_normal: Hand | None = None
    moment: float = 1e-4
    rotational_stiffness: float = 2.0
    rotational_damping: float = 0.02
    press_force: float | None = None
    press_time: float = 0.25
    preload: bool = True
    press_in: float = 0.0
    normal: tuple[float, float, float] = (0.0, 0.0, 1.0)

    def __post_init__(self) -> None:
        for name in ("moment", "rotational_stiffness", "press_time"):
            require_positive(name, getattr(self, name))
        for name in ("rotational_damping", "press_in"):
            require_not_negative(name, getattr(self, name))
        if self.press_force is not None:
            require_not_negative("press_force", self.press_force, "[N]")
        if not math.hypot(*require_finite("normal", self.normal, 3)) > 0.0:
            raise AsperityError(f"normal must not be zero, got {self.normal!r}")


class SimulatedHand:
    """A simulated hand in motion.

    Parameters
    ----------
    target : callable
        Pose (7,) of the handle that the hand aims at, at a time [s] from 0.
    settings : HandSettings
    dt : float
        Tick [s], 1e-5 to 0.1, over which a wrench is held.
    centre : (3,) array
        Of the mass, in the handle's frame [m]; wrenches are about it.
    damping : float
        The device's own, added to the hand's [N s/m].

    Examples
    --------
    >>> hand = SimulatedHand(lambda t: start)
    >>> hand.advance(simulation.step(hand.pose))
    """

    def __init__(
        self,
        target: Callable[[float], NDArray[np.float64]],
        settings: HandSettings | None = None,
        *,
        dt: float = 1e-3,
        centre: NDArray[np.float64] | None = None,
        damping: float = 0.0,
    ) -> None:
        self.settings = settings or HandSettings()
        self.dt = require_between("dt", dt, 1e-5, 0.1, "s")
        self.centre = np.zeros(3) if centre is None else np.array(centre, dtype=np.float64)
        self._target = target
        hand = self.settings.hand
        across = self.settings.along_normal or hand
        normal = np.array(self.settings.normal, dtype=np.float64)
        self._normal = normal / np.linalg.norm(normal)
        self._along, self._pressing, self._turning = (
            np.array(held_tick(*values, self.dt))
            for values in (
                (hand.mass, hand.damping + damping, hand.stiffness),
                (across.mass, across.damping + damping, across.stiffness),
                (self.settings.moment, self.settings.rotational_damping,
                 self.settings.rotational_stiffness),
            )
        )  # fmt: skip
        self._soft = across.stiffness
        self._numbers = np.zeros(NUMBERS)
        self._numbers[1:] = self.dt, hand.stiffness, hand.damping + damping, hand.mass
        self._room = (np.zeros(6), np.zeros(6), np.zeros(6))
        self._pose, self._acceleration = np.zeros(7), np.zeros(3)
        self.arm = np.zeros(3)
        """From the handle's origin to the centre of mass, world axes [m]."""
        self._aim, self._velocity = np.zeros(7), np.zeros(6)
        self._state = (self._aim, self._pose, self._velocity, self._acceleration, self.arm)
        self._felt = np.zeros(6)
        self.reset()
        # Machine code is made before any hurry.
        self._tick(self._pose.copy(), tuple(values.copy() for values in self._state))

    def reset(self) -> None:
        """Begin at the target, at rest relative to it, and at time 0."""
        self.time = 0.0
        """[s]"""
        self.offset = 0.0
        """How far the hand presses beyond its target, against the normal [m]."""
        self._felt_for = 0.0
        settings = self.settings
        if settings.press_force is not None and settings.preload and settings.press_in == 0.0:
            self.offset = settings.press_force / self._soft
        self._aim[:] = self._target(0.0)
        following = np.array(self._target(self.dt), dtype=np.float64)
        self._pose[:] = self._aim
        self._velocity[:3] = (self._centre_of(following) - self._centre_of(self._aim)) / self.dt
        self._velocity[3:] = rotation_between(self._aim, following) / self.dt
        self._acceleration[:] = 0.0
        self.arm[:] = self._centre_of(self._pose) - self._pose[:3]

    @property
    def pose(self) -> NDArray[np.float64]:
        """Of the handle (7,)."""
        return self._pose.copy()

    @property
    def acceleration(self) -> NDArray[np.float64]:
        """Of the centre of mass, at the beginning of the last tick, just after it (3,) [m/s^2]."""
        return self._acceleration.copy()

    @property
    def twist(self) -> NDArray[np.float64]:
        """Velocity (6,): linear, of the frame's origin [m/s]; angular [rad/s]; world axes."""
        out = self._velocity.copy()
        out[:3] -= cross(out[3:], self.arm)
        return out

    def advance(self, wrench: NDArray[np.float64]) -> None:
        """Feel a wrench (6,), about the centre of mass, for a tick [N, N m]."""
        self._felt[:] = wrench
        self._press(float(self._felt[:3] @ self._normal))
        self.time += self.dt
        self._numbers[OFFSET] = self.offset
        self._tick(np.asarray(self._target(self.time), dtype=np.float64), self._state)

    def _tick(self, following: NDArray[np.float64], state: tuple[NDArray[np.float64], ...]) -> None:
        hand_tick(
            self._felt, following, self.centre, self._normal, self._along, self._pressing,
            self._turning, self._numbers, state, self._room,
        )  # fmt: skip

    def _press(self, felt: float) -> None:
        """Regulate the pressing force."""
        wanted, within = self.settings.press_force, self.settings.press_in
        if wanted is None:
            return
        if self.settings.preload and self._felt_for < within:
            self._felt_for += self.dt if felt != 0.0 else 0.0
            self.offset = min(self._felt_for / within, 1.0) * wanted / self._soft
            return
        if felt <= 0.0:
            return
        self.offset += (wanted - felt) / self._soft * (self.dt / self.settings.press_time)
        most = MOST_OFFSET + wanted / self._soft
        self.offset = min(max(self.offset, 0.0), most)

    def _centre_of(self, pose: NDArray[np.float64]) -> NDArray[np.float64]:
        return centre_of_mass(pose, self.centre)


def held_tick(mass: float, damping: float, stiffness: float, dt: float) -> tuple[float, ...]:
    """Return how place (3) and velocity (3) follow from place, velocity, force a tick before."""
    from scipy.linalg import expm  # slow to import

    rates = np.zeros((3, 3))
    rates[0, 1] = 1.0
    rates[1] = -stiffness / mass, -damping / mass, 1.0 / mass
    place, velocity, _ = expm(rates * dt).tolist()
    return (*place, *velocity)

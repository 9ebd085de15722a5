r"""A simulated hand: mass, spring and damper in 6 DoF about a moving target.

Otaduy & Lin's (2004) Eq. 7 along each axis, with l the displacement of the handle from its target:

    m l'' = -k l - b l' + F,    J theta'' = -k_r theta - b_r theta' + tau,

F and tau are the wrench on the hand. The system is linear and the wrench is held constant over a
tick, so each tick is solved exactly. The hand's mass sits at the tool's centre of mass.

*Pressing.* A person who is to press with a given force watches that force and corrects it slowly.
So while there is contact, the target is displaced against the normal by an offset p,

    p' = (F_wanted - F_n) / (k t_press),

with F_n the force on the hand along the normal. The offset starts at its equilibrium,
`F_wanted / k`, or rises to it linearly within a given time of contact, and is regulated from then
on.

Mass, stiffness and damping of translation are those of `Hand`; those of rotation, and t_press, are
project defaults: no source reports all of them.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from asperity._core.arrays import Array
from asperity.dynamics.dragged_hand.hand import Hand
from asperity.dynamics.simulated_hand.step import HandModel, HandState, hand_step
from asperity.errors import (
    AsperityError,
    require_between,
    require_finite,
    require_not_negative,
    require_positive,
)
from asperity.geometry.poses import rotation_between
from asperity.geometry.rigid_body import centre_of_mass, cross

MAX_OFFSET = 0.02
"""Largest offset of the target beyond the one that gives the wanted force [m]."""


@dataclass(frozen=True)
class HandSettings:
    """How a simulated hand holds and presses. All defaults are the project's.

    Parameters
    ----------
    hand : Hand
        Mass, stiffness and damping of Eq. 7, along every axis.
    along_normal : Hand, optional
        Those along the normal: a light and soft hand presses with a constant force, as the
        paper's studies assume. By default `hand`.
    moment : float
        Moment of inertia about every axis [kg m^2].
    rotational_stiffness, rotational_damping : float
        [N m/rad], [N m s/rad].
    press_force : float, optional
        Regulated normal force [N]; by default the force is not regulated.
    press_time : float
        Time constant of the regulation [s].
    preload : bool
        Whether the hand starts at the equilibrium of pressing with `press_force`.
    press_in : float
        Time of contact within which the offset rises to that equilibrium [s]; 0: it starts there.
    normal : (3,)
        Direction along which the force on the hand is positive; of any length above 0.
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
        Pose (7,) of the handle that the hand aims at, as a function of time [s] from 0.
    settings : HandSettings
    dt : float
        Tick [s], 1e-5 to 0.1, over which a wrench is held constant.
    centre : (3,) array
        Centre of mass in the handle's frame [m], the reference point of wrenches.
    damping : float
        Physical damping of the device, added to the hand's [N s/m].

    Examples
    --------
    >>> hand = SimulatedHand(lambda t: start)
    >>> hand.advance(simulation.step(hand.pose))
    """

    def __init__(
        self,
        target: Callable[[float], Array],
        settings: HandSettings | None = None,
        *,
        dt: float = 1e-3,
        centre: Array | None = None,
        damping: float = 0.0,
    ) -> None:
        self.settings = settings or HandSettings()
        self.dt = require_between("dt", dt, 1e-5, 0.1, "s")
        self.centre = np.zeros(3) if centre is None else np.array(centre, dtype=np.float64)
        self._target = target
        self._model = self._make_model(damping)
        self._state = HandState(
            np.zeros(7), np.zeros(7), np.zeros(6), np.zeros(3), np.zeros(3)
        )  # fmt: skip
        self._wrench = np.zeros(6)
        self.reset()
        # Compile now, not in the first tick.
        self._step(self._state.pose.copy(), HandState(*(values.copy() for values in self._state)))

    def _make_model(self, damping: float) -> HandModel:
        settings, hand = self.settings, self.settings.hand
        normal_hand = settings.along_normal or hand
        self._press_stiffness = normal_hand.stiffness
        normal = np.array(settings.normal, dtype=np.float64)
        tangential, pressing, rotational = (
            np.array(transition(*values, self.dt)).reshape(2, 3)
            for values in (
                (hand.mass, hand.damping + damping, hand.stiffness),
                (normal_hand.mass, normal_hand.damping + damping, normal_hand.stiffness),
                (settings.moment, settings.rotational_damping, settings.rotational_stiffness),
            )
        )
        return HandModel(
            centre=self.centre,
            normal=normal / np.linalg.norm(normal),
            tangential=tangential,
            pressing=pressing,
            rotational=rotational,
            dt=float(self.dt),
            mass=float(hand.mass),
            stiffness=float(hand.stiffness),
            damping=float(hand.damping + damping),
        )

    def reset(self) -> None:
        """Start at the target, at rest relative to it, at time 0."""
        self.time = 0.0
        """[s]"""
        self.offset = 0.0
        """Distance by which the hand aims beyond its target, against the normal [m]."""
        self._contact_time = 0.0
        settings, state = self.settings, self._state
        if settings.press_force is not None and settings.preload and settings.press_in == 0.0:
            self.offset = settings.press_force / self._press_stiffness
        state.target[:] = self._target(0.0)
        following = np.array(self._target(self.dt), dtype=np.float64)
        state.pose[:] = state.target
        moved = self._centre_of(following) - self._centre_of(state.target)
        state.velocity[:3] = moved / self.dt
        state.velocity[3:] = rotation_between(state.target, following) / self.dt
        state.acceleration[:] = 0.0
        state.arm[:] = self._centre_of(state.pose) - state.pose[:3]

    @property
    def pose(self) -> Array:
        """Pose of the handle (7,)."""
        return self._state.pose.copy()

    @property
    def arm(self) -> Array:
        """Vector from the handle's origin to the centre of mass, world axes (3,) [m]."""
        return self._state.arm

    @property
    def acceleration(self) -> Array:
        """Acceleration of the centre of mass (3,) [m/s^2] just after the last tick began."""
        return self._state.acceleration.copy()

    @property
    def twist(self) -> Array:
        """Velocity (6,) of the frame's origin [m/s] and angular velocity [rad/s], world axes."""
        out = self._state.velocity.copy()
        out[:3] -= cross(out[3:], self._state.arm)
        return out

    def advance(self, wrench: Array) -> None:
        """Advance by one tick under a wrench (6,) about the centre of mass [N, N m]."""
        self._wrench[:] = wrench
        self._regulate(float(self._wrench[:3] @ self._model.normal))
        self.time += self.dt
        self._step(np.asarray(self._target(self.time), dtype=np.float64), self._state)

    def _step(self, target: Array, state: HandState) -> None:
        hand_step(self._model, state, self._wrench, target, float(self.offset))

    def _regulate(self, normal_force: float) -> None:
        """Update the offset from the force on the hand along the normal [N]."""
        wanted, within = self.settings.press_force, self.settings.press_in
        if wanted is None:
            return
        if self.settings.preload and self._contact_time < within:
            self._contact_time += self.dt if normal_force != 0.0 else 0.0
            share = min(self._contact_time / within, 1.0)
            self.offset = share * wanted / self._press_stiffness
            return
        if normal_force <= 0.0:
            return
        rate = (wanted - normal_force) / self._press_stiffness
        self.offset += rate * (self.dt / self.settings.press_time)
        limit = MAX_OFFSET + wanted / self._press_stiffness
        self.offset = min(max(self.offset, 0.0), limit)

    def _centre_of(self, pose: Array) -> Array:
        return centre_of_mass(pose, self.centre)


def transition(mass: float, damping: float, stiffness: float, dt: float) -> tuple[float, ...]:
    """Return the zero-order-hold transition of a mass on a spring and damper over a tick.

    Six numbers: the displacement (three) and the velocity (three) after the tick, as coefficients
    of displacement, velocity and held force at its beginning.
    """
    from scipy.linalg import expm  # slow to import

    rates = np.zeros((3, 3))
    rates[0, 1] = 1.0
    rates[1] = -stiffness / mass, -damping / mass, 1.0 / mass
    displacement, velocity, _ = expm(rates * dt).tolist()
    return (*displacement, *velocity)

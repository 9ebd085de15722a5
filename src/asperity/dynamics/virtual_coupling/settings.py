r"""Virtual coupling: the spring and damper between the handle that a hand holds and the tool.

With e the way from tool to handle (translation of the tool's centre of mass, and rotation vector)
and V, V_h the velocities of the tool and of the handle where the tool's centre of mass is,

    w = K e + B (V_h - V)

acts on the tool about its centre of mass, and -w on the hand (Colgate, Stanley & Brown 1995). What
a hand feels is never stiffer than K, however stiff the contact.

By default K follows from the mass m and a frequency f, `K = m (2 pi f)^2`, and B damps it
critically, `B = 2 sqrt(K m)`; likewise in rotation, where the stiffness is that of the largest
moment of inertia, and each principal axis has its own critical damping. A device's limits cap
them.

The held tool's mass is MuJoCo's, but within `MASS`, and its moments within `MOMENTS`: a light tool
has a coupling too soft to carry the contact, and to a hand that is sampled at 1 kHz the damping of
a heavy one is more than its own mass can follow. Frequency and ranges are asperity's.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from asperity.errors import AsperityError, require_between, require_choice
from asperity.geometry.poses import rotation_of
from asperity.geometry.rigid_body import RigidBody

if TYPE_CHECKING:
    import mujoco

MODES = ("direct", "implicit", "semi-implicit", "static")
FREQUENCY = 30.0
"""Of the tool on its coupling, where no stiffness is given [Hz]; asperity's."""
MASS = (0.02, 0.1)
"""Least and most that a held tool weighs, before `mass_scale` [kg]; asperity's."""
MOMENTS = (2e-5, 2e-4)
"""Least and largest principal moment of inertia, before `mass_scale` [kg m^2]; asperity's."""
_RANGES = {
    "stiffness": (1.0, 1e6, "N/m"),
    "damping": (0.0, 1e4, "N s/m"),
    "rotational_stiffness": (1e-4, 1e4, "N m/rad"),
    "rotational_damping": (0.0, 1e3, "N m s/rad"),
    "mass_scale": (0.01, 1000.0, ""),
}


@dataclass(frozen=True)
class CouplingSettings:
    """How the tool hangs on the handle.

    Parameters
    ----------
    mode : {"direct", "implicit", "semi-implicit", "static"}
        *direct*: tool and handle are one, the hand feels the contact. *implicit*, *semi-implicit*:
        the tool is a rigid body, moved by that integrator. *static*: without mass, where coupling
        and contact are in balance.
    stiffness, damping : float, optional
        Of translation [N/m], [N s/m]. By default from the mass.
    rotational_stiffness, rotational_damping : float, optional
        [N m/rad], [N m s/rad]. By default from the moments of inertia.
    mass_scale : float
        Factor on mass and moments of inertia.

    Raises
    ------
    AsperityError
        A value outside its range, one line.
    """

    mode: str = "direct"
    stiffness: float | None = None
    damping: float | None = None
    rotational_stiffness: float | None = None
    rotational_damping: float | None = None
    mass_scale: float = 1.0

    def __post_init__(self) -> None:
        require_choice("mode", self.mode, MODES)
        for name, (low, high, unit) in _RANGES.items():
            if getattr(self, name) is not None:
                require_between(name, getattr(self, name), low, high, unit)


class DeviceLimits(Protocol):
    """What of `devices.protocol.Limits` bounds a coupling."""

    @property
    def max_stiffness(self) -> float: ...  # noqa: D102
    @property
    def max_damping(self) -> float: ...  # noqa: D102
    @property
    def max_rotational_stiffness(self) -> float: ...  # noqa: D102


class Gains(NamedTuple):
    """Spring and damper in numbers."""

    stiffness: float
    """[N/m]"""
    damping: float
    """[N s/m]"""
    rotational_stiffness: float
    """[N m/rad]"""
    rotational_damping: NDArray[np.float64]
    """Along the principal axes of the tool [N m s/rad], (3,)."""


def coupled_body(model: mujoco.MjModel, tool: str, *, mass_scale: float = 1.0) -> RigidBody:
    """Return what the tool of a model weighs in the hand: within `MASS` and `MOMENTS`, scaled."""
    body: Any = model.body(tool)
    return RigidBody(
        mass=float(np.clip(body.mass[0], *MASS)) * mass_scale,
        centre=np.array(body.ipos, dtype=np.float64),
        moments=np.clip(np.asarray(body.inertia, dtype=np.float64), *MOMENTS) * mass_scale,
        axes=rotation_of(body.iquat),
    )


def gains_for(
    body: RigidBody, settings: CouplingSettings, *, limits: DeviceLimits | None = None
) -> Gains:
    """Return the coupling's gains: as set, else from the mass, and within a device's limits.

    A device without torques (`max_rotational_stiffness` 0) caps none: its hand feels none of it.
    """
    square = (2.0 * math.pi * FREQUENCY) ** 2
    stiffness = settings.stiffness if settings.stiffness is not None else body.mass * square
    turning = settings.rotational_stiffness
    if turning is None:
        turning = float(body.moments.max()) * square
    if limits is not None:
        stiffness = min(stiffness, limits.max_stiffness)
        if limits.max_rotational_stiffness > 0.0:
            turning = min(turning, limits.max_rotational_stiffness)
    damping = settings.damping
    if damping is None:
        damping = 2.0 * math.sqrt(stiffness * body.mass)
    if limits is not None:
        damping = min(damping, limits.max_damping)
    slowing = 2.0 * np.sqrt(turning * body.moments)
    if settings.rotational_damping is not None:
        slowing = np.full(3, float(settings.rotational_damping))
    return Gains(float(stiffness), float(damping), float(turning), slowing)


def require_stable(body: RigidBody, gains: Gains, dt: float) -> None:
    """Refuse gains that the semi-implicit integrator cannot follow at a tick [s].

    A mass on a spring and damper moved by it forgets its motion while `(K dt^2 + 2 B dt) / m < 4`.
    """
    for what, inertia, stiffness, damping in (
        ("", body.mass, gains.stiffness, gains.damping),
        *(
            ("rotational ", moment, gains.rotational_stiffness, slowing)
            for moment, slowing in zip(body.moments, gains.rotational_damping, strict=True)
        ),
    ):
        if not (stiffness * dt + 2.0 * damping) * dt < 4.0 * inertia:
            raise AsperityError(
                f"a semi-implicit coupling with {what}stiffness {stiffness:.4g} and damping "
                f"{damping:.4g} is unstable at a tick of {dt:g} s; lower them, shorten the tick, "
                "or take mode 'implicit'"
            )

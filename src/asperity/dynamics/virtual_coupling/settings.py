r"""Virtual coupling: the spring and damper between the handle and the tool.

With e the displacement from tool to handle (translation of the tool's centre of mass, and rotation
vector) and V, V_h the velocities of tool and handle at the tool's centre of mass, the wrench

    w = K e + B (V_h - V)

acts on the tool about its centre of mass, and -w on the hand (Colgate, Stanley & Brown 1995). So
the stiffness at the hand never exceeds K, however stiff the contact.

By default K follows from the mass m and a frequency f, `K = m (2 pi f)^2`, and B is the critical
damping, `B = 2 sqrt(K m)`. In rotation the stiffness follows from the largest moment of inertia,
and each principal axis has its own critical damping. A device's limits cap the gains.

The coupled tool has MuJoCo's mass clipped to `MASS` and moments of inertia clipped to `MOMENTS`.
The coupling of a lighter tool would be too soft for the contact; the damping of a heavier one would
be unstable for the small mass of a hand that is sampled at 1 kHz. Frequency and ranges are project
defaults.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np

from asperity._core.arrays import Array
from asperity.errors import AsperityError, require_between, require_choice
from asperity.geometry.poses import rotation_of
from asperity.geometry.rigid_body import RigidBody

if TYPE_CHECKING:
    import mujoco

COUPLING_MODES = ("direct", "implicit", "semi-implicit", "static")
FREQUENCY = 30.0
"""Natural frequency of the tool on its coupling, if no stiffness is given [Hz]."""
MAX_FORCE = 10.0
"""Largest force of the coupling's spring without a device [N]."""
MASS = (0.02, 0.1)
"""Smallest and largest mass of a coupled tool, before `mass_scale` [kg]."""
MOMENTS = (2e-5, 2e-4)
"""Smallest and largest principal moment of inertia, before `mass_scale` [kg m^2]."""
_RANGES = {
    "stiffness": (1.0, 1e6, "N/m"),
    "damping": (0.0, 1e4, "N s/m"),
    "rotational_stiffness": (1e-4, 1e4, "N m/rad"),
    "rotational_damping": (0.0, 1e3, "N m s/rad"),
    "mass_scale": (0.01, 1000.0, ""),
    "max_force": (1e-3, 1e4, "N"),
}


@dataclass(frozen=True)
class CouplingSettings:
    """Settings of the virtual coupling.

    Parameters
    ----------
    mode : {"direct", "implicit", "semi-implicit", "static"}
        *direct*: tool and handle are one body, and the contact acts on the hand. *implicit*,
        *semi-implicit*: the tool is a rigid body, advanced by backward or semi-implicit Euler.
        *static*: the tool is massless, at the equilibrium of coupling and contact.
    stiffness, damping : float, optional
        In translation [N/m], [N s/m]. By default from the mass.
    rotational_stiffness, rotational_damping : float, optional
        In rotation [N m/rad], [N m s/rad]. By default from the moments of inertia.
    mass_scale : float
        Factor on mass and moments of inertia.
    max_force : float, optional
        Largest force of the spring [N]: however far the hand pushes into an object, the tool stays
        on its surface. By default the device's, and `MAX_FORCE` without one. The largest torque is
        that force at 0.1 m.

    Raises
    ------
    AsperityError
        A value is outside its range.
    """

    mode: str = "direct"
    stiffness: float | None = None
    damping: float | None = None
    rotational_stiffness: float | None = None
    rotational_damping: float | None = None
    mass_scale: float = 1.0
    max_force: float | None = None

    def __post_init__(self) -> None:
        require_choice("mode", self.mode, COUPLING_MODES)
        for name, (low, high, unit) in _RANGES.items():
            if getattr(self, name) is not None:
                require_between(name, getattr(self, name), low, high, unit)


class DeviceLimits(Protocol):
    """The limits of a device that bound a coupling; see `realtime.devices`."""

    @property
    def max_force(self) -> float: ...  # noqa: D102
    @property
    def max_stiffness(self) -> float: ...  # noqa: D102
    @property
    def max_damping(self) -> float: ...  # noqa: D102
    @property
    def max_rotational_stiffness(self) -> float: ...  # noqa: D102


class Gains(NamedTuple):
    """Stiffness and damping of the coupling."""

    stiffness: float
    """[N/m]"""
    damping: float
    """[N s/m]"""
    rotational_stiffness: float
    """[N m/rad]"""
    rotational_damping: Array
    """About the principal axes of the tool [N m s/rad], (3,)."""
    max_force: float
    """Largest force of the spring [N]."""


def coupled_body(model: mujoco.MjModel, tool: str, *, mass_scale: float = 1.0) -> RigidBody:
    """Return the mass properties of a model's tool, clipped to `MASS` and `MOMENTS`, then scaled.

    Parameters
    ----------
    model : mujoco.MjModel
    tool : str
        Name of the body.
    mass_scale : float
        Factor on mass and moments of inertia.
    """
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
    """Return the gains of a coupling: as set, or by default from the mass; within limits.

    Parameters
    ----------
    body : RigidBody
    settings : CouplingSettings
    limits : DeviceLimits, optional
        Of the device. If it renders no torques (`max_rotational_stiffness` 0), the rotational
        gains are not capped.
    """
    square = (2.0 * math.pi * FREQUENCY) ** 2
    stiffness = settings.stiffness if settings.stiffness is not None else body.mass * square
    rotational_stiffness = settings.rotational_stiffness
    if rotational_stiffness is None:
        rotational_stiffness = float(body.moments.max()) * square
    if limits is not None:
        stiffness = min(stiffness, limits.max_stiffness)
        if limits.max_rotational_stiffness > 0.0:
            rotational_stiffness = min(rotational_stiffness, limits.max_rotational_stiffness)
    damping = settings.damping
    if damping is None:
        damping = 2.0 * math.sqrt(stiffness * body.mass)
    if limits is not None:
        damping = min(damping, limits.max_damping)
    rotational_damping = 2.0 * np.sqrt(rotational_stiffness * body.moments)
    if settings.rotational_damping is not None:
        rotational_damping = np.full(3, float(settings.rotational_damping))
    max_force = settings.max_force
    if max_force is None:
        max_force = MAX_FORCE if limits is None else limits.max_force
    return Gains(
        float(stiffness), float(damping), float(rotational_stiffness), rotational_damping,
        float(max_force),
    )  # fmt: skip


def require_stable(body: RigidBody, gains: Gains, dt: float) -> None:
    """Raise `AsperityError` if the semi-implicit integrator is unstable at a tick `dt` [s].

    It is stable, in each axis, if `(K dt^2 + 2 B dt) / m < 4`.
    """
    for what, inertia, stiffness, damping in (
        ("", body.mass, gains.stiffness, gains.damping),
        *(
            ("rotational ", moment, gains.rotational_stiffness, axis_damping)
            for moment, axis_damping in zip(body.moments, gains.rotational_damping, strict=True)
        ),
    ):
        if not (stiffness * dt + 2.0 * damping) * dt < 4.0 * inertia:
            raise AsperityError(
                f"a semi-implicit coupling with {what}stiffness {stiffness:.4g} and damping "
                f"{damping:.4g} is unstable at a tick of {dt:g} s; lower them, shorten the tick, "
                "or use mode 'implicit'"
            )

"""What each known device can do, by name.

The rows of 3D Systems and Force Dimension are limits that public device code (CHAI3D 3.3) sets in
software; they are no datasheets. Force limits there lie below what some makers name for a peak
(sigma.7: 20 N and 0.4 N m), which is as it should be for a force that is held.

For the Haply Inverse3 no public figure was found for force or stiffness. Its row is asperity's:
2 N is what Isaac Lab's driver allows by default, 300 N/m and 2 N s/m are CHAI3D's for Haply's
pantograph, and 0.1 m lies well within its reach. Raise them with `limits=` once you know better.

The physical damping of all of them, 0.1 N s/m, is asperity's as well.
"""

from __future__ import annotations

from asperity.devices.protocol import Limits
from asperity.errors import require_choice

PRESETS: dict[str, Limits] = {
    "touch": Limits(max_force=3.3, max_torque=0.0, max_stiffness=400.0, max_damping=4.0, radius=0.075),
    "omni": Limits(max_force=3.3, max_torque=0.0, max_stiffness=700.0, max_damping=5.0, radius=0.1),
    "premium-1.5-6dof": Limits(
        max_force=8.5, max_torque=0.188, max_stiffness=800.0, max_damping=5.0,
        max_rotational_stiffness=0.3, radius=0.12, torque_dof=3,
    ),
    "premium-3.0-6dof": Limits(
        max_force=22.0, max_torque=0.188, max_stiffness=1000.0, max_damping=5.0,
        max_rotational_stiffness=0.3, radius=0.25, torque_dof=3,
    ),
    "omega.6": Limits(max_force=12.0, max_torque=0.0, max_stiffness=5000.0, max_damping=30.0, radius=0.075),
    "sigma.7": Limits(
        max_force=12.0, max_torque=0.2, max_stiffness=4000.0, max_damping=30.0,
        max_rotational_stiffness=1.0, radius=0.075, torque_dof=3,
    ),
    "lambda.7": Limits(
        max_force=12.0, max_torque=0.2, max_stiffness=8000.0, max_damping=30.0,
        max_rotational_stiffness=1.0, radius=0.1125, torque_dof=3,
    ),
    "inverse3": Limits(max_force=2.0, max_torque=0.0, max_stiffness=300.0, max_damping=2.0, radius=0.1),
}  # fmt: skip
"""Limits by name."""


def limits_of(name: str) -> Limits:
    """Return the limits of a device by name; an unknown name is refused with the nearest one."""
    return PRESETS[require_choice("device preset", name, PRESETS)]

"""Limits of known devices by name.

The rows of 3D Systems and Force Dimension are the limits that public device code (CHAI3D 3.3) sets
in software, not datasheet values. They lie below some makers' peak forces (sigma.7: 20 N and
0.4 N m), as they should for a force that is held.

For the Haply Inverse3 no public figures for force or stiffness were found. Its row is a project
default: 2 N is what Isaac Lab's driver allows, 300 N/m and 2 N s/m are CHAI3D's for Haply's
pantograph, and 0.1 m lies well within its reach. Raise them with `limits=` once you know better.

The physical damping of all of them, 0.1 N s/m, is a project default as well.
"""

from __future__ import annotations

from asperity.errors import require_choice
from asperity.realtime.devices.protocol import Limits

_ROWS = {
    # largest force [N], torque [N m], stiffness [N/m], damping [N s/m],
    # rotational stiffness [N m/rad]; radius of the workspace [m]
    "touch":            (3.3, 0.0, 400.0, 4.0, 0.0, 0.075),
    "omni":             (3.3, 0.0, 700.0, 5.0, 0.0, 0.1),
    "premium-1.5-6dof": (8.5, 0.188, 800.0, 5.0, 0.3, 0.12),
    "premium-3.0-6dof": (22.0, 0.188, 1000.0, 5.0, 0.3, 0.25),
    "omega.6":          (12.0, 0.0, 5000.0, 30.0, 0.0, 0.075),
    "sigma.7":          (12.0, 0.2, 4000.0, 30.0, 1.0, 0.075),
    "lambda.7":         (12.0, 0.2, 8000.0, 30.0, 1.0, 0.1125),
    "inverse3":         (2.0, 0.0, 300.0, 2.0, 0.0, 0.1),
}  # fmt: skip
PRESETS = {name: Limits(*row, torque_dof=3 if row[1] else 0) for name, row in _ROWS.items()}
"""Limits by device name."""


def limits_of(name: str) -> Limits:
    """Return a device's limits; an unknown name raises AsperityError with the nearest one."""
    return PRESETS[require_choice("device preset", name, PRESETS)]

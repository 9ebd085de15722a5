"""Constraints of the contacts of textured flexes: springs in an implicit Euler step.

With MuJoCo's force `(K I depth - B v - a) / R` of the acceleration a and velocity v of a contact, a
spring k with a damper c and a step h has

    K I / R = k,    B / R = c + h k,    1 / R = h c + h^2 k.

So the force is that at the end of the step, `k (depth - h v') - c v'` with v' = v + h a: stable for
any step and any mass of the vertices, and k depth at rest. This is set in the constraints that
MuJoCo has made, as `rows` does for rigid geoms.
"""

from __future__ import annotations

from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

_STICKING = 0.02
"""R of friction over MuJoCo's default, so that bodies do not creep on slopes."""
_PYRAMIDAL = int(mujoco.mjtConstraint.mjCNSTR_CONTACT_PYRAMIDAL)
_ELLIPTIC = int(mujoco.mjtConstraint.mjCNSTR_CONTACT_ELLIPTIC)


class Springs(NamedTuple):
    """Springs and dampers of contacts; rows are contacts."""

    stiffness: NDArray[np.float64]
    """k [N/m], (n,)."""
    damping: NDArray[np.float64]
    """c [N s/m], (n,)."""


def set_rows(
    model: mujoco.MjModel, data: mujoco.MjData, records: NDArray[np.void], springs: Springs
) -> None:
    """Set the constraints of contacts.

    Parameters
    ----------
    model : mujoco.MjModel
    data : mujoco.MjData
        With constraints made.
    records : contact records
        Of the contacts, (n,).
    springs : Springs
    """
    h, all_rows = float(model.opt.timestep), data.efc_type
    resistance, inverse, reference = data.efc_R, data.efc_D, data.efc_KBIP
    for one, k, c in zip(records, *springs, strict=True):
        row, dim = int(one["efc_address"]), int(one["dim"])
        if row < 0:
            continue
        drag, mass, edges = c + h * k, h * c + h * h * k, 1
        if all_rows[row] == _PYRAMIDAL:
            edges = 2 * (dim - 1)
            drag, mass = drag / edges, max(mass / edges, 1.0 / resistance[row])
            drag = max(drag, reference[row, 1] * mass)
        rows = slice(row, row + edges)
        resistance[rows], inverse[rows] = 1.0 / mass, mass
        # The edges of a pyramid share the force.
        reference[rows, 0] = k / edges / mass / reference[row, 2]
        reference[rows, 1], reference[rows, 3] = drag / mass, 0.0
        if all_rows[row] == _ELLIPTIC:
            across = slice(row + 1, row + dim)
            resistance[across] *= _STICKING
            inverse[across] /= _STICKING
            one["mu"] = one["friction"][0] * np.sqrt(resistance[row + 1] * mass)

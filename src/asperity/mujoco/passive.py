"""Textured contacts as explicit forces, where constraints are not possible.

Force and damping are those at the start of a step, so that the step limits the stiffness: without
damping a contact of k on bodies of the mass m is stable up to `k dt^2 = 4 m`; above a quarter of
that there is a warning. Friction is Coulomb's, regularised below `_SLOW`: there is no sticking.
"""

from __future__ import annotations

import warnings

import mujoco
import numpy as np
from numpy.typing import NDArray

from asperity.mujoco.rows import PlacedContacts

_SLOW = 1e-3
"""Slip speed below which friction is proportional to it [m/s]."""
LONGEST = 1.0
"""Largest `k dt^2 / m`."""


def add_forces(
    model: mujoco.MjModel, data: mujoco.MjData, records: NDArray[np.void],
    placed: PlacedContacts, dissipation: float,
) -> tuple[float, int]:  # fmt: skip
    """Add the forces of contacts to `data.qfrc_passive`.

    Parameters
    ----------
    model : mujoco.MjModel
    data : mujoco.MjData
    records : contact records
        Of the contacts.
    placed : PlacedContacts
        Their rows.
    dissipation : float
        a of Hunt & Crossley [s/m].

    Returns
    -------
    (float, int)
        The largest `k dt^2 / m`, and its contact; -1 for none.
    """
    worst, at, none = 0.0, -1, np.zeros(3)
    for i, one in enumerate(records):
        rate = dissipation * placed.steepness[i] * placed.parting[i]
        push = float(placed.push[i]) * max(1.0 - rate, 0.0)
        slip = placed.slip[i] if placed.is_second[i] else -placed.slip[i]
        speed = float(np.linalg.norm(slip))
        force = push * one["frame"][:3]
        force = force - one["friction"][0] * push * slip / max(speed, _SLOW)
        first, second = (int(model.geom_bodyid[geom]) for geom in one["geom"])
        for body, sign in ((first, -1.0), (second, 1.0)):
            mujoco.mj_applyFT(model, data, sign * force, none, one["pos"], body, data.qfrc_passive)
        inverse = model.body_invweight0[first, 0] + model.body_invweight0[second, 0]
        stiffness = placed.push[i] / -one["dist"]
        ratio = float(stiffness * inverse * model.opt.timestep**2)
        if ratio > worst:
            worst, at = ratio, i
    return worst, at


def warn_of_step(names: tuple[str, str], ratio: float, step: float) -> None:
    """Warn that a step is too long for the stiffness of a contact between two bodies."""
    warnings.warn(
        f"mode 'passive': a step of {1e3 * step:.3g} ms is too long for the stiffness of contact "
        f"of {names[0]} with {names[1]} (k dt^2 / m = {ratio:.2g}); valid: at most {LONGEST:g}, "
        f"with a step of {1e3 * step * (LONGEST / ratio) ** 0.5:.2g} ms or {LONGEST / ratio:.2g} "
        "times the stiffness",
        stacklevel=2,
    )

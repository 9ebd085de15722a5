"""Forces on a set of taxels, whose sum and moment are exactly those of the contacts.

Every contact is spread over the taxels around it: first by a Gaussian weight, then with the least
correction that makes the sum of the forces the contact's force, and their moment its moment.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from asperity._core.arrays import Array
from asperity.contact.contacts import Contacts
from asperity.errors import AsperityError, require_finite, require_positive
from asperity.geometry.poses import require_pose, rotation_of

_REACH = 4.0
"""Distance from a contact, in spreads, up to which taxels get a force."""
_FEWEST = 6
"""Smallest number of taxels over which a contact is spread."""


class TaxelForces:
    """Taxels at points of a rigid body, over which contacts are spread.

    Parameters
    ----------
    places : (n, 3) array
        In the body's frame [m], 3 or more that are not on a line.
    spread : float, optional
        Standard deviation of the Gaussian [m]; by default the mean distance of neighbours.

    Attributes
    ----------
    spread : float
        [m]

    Raises
    ------
    AsperityError
        The places are fewer than 3, not finite, or on a line.

    Examples
    --------
    >>> taxels = TaxelForces(places)
    >>> wrench = solver.wrench(pose, 1e-3)
    >>> forces = taxels.of_tool(pose, solver.contacts, wrench, solver.centre)
    """

    def __init__(self, places: ArrayLike, spread: float | None = None) -> None:
        self.places = np.array(places, dtype=np.float64)
        if self.places.ndim != 2 or self.places.shape[1] != 3 or len(self.places) < 3:
            raise AsperityError(
                f"places of taxels must be 3 or more rows of 3 numbers, got {self.places.shape}"
            )
        middle = self.places - self.places.mean(axis=0)
        if not np.isfinite(middle).all() or np.linalg.matrix_rank(middle, 1e-9) < 2:
            raise AsperityError("places of taxels must be finite and not all on one line")
        if spread is None:
            apart = np.linalg.norm(self.places[:, None] - self.places, axis=2)
            np.fill_diagonal(apart, np.inf)
            spread = float(apart.min(axis=1).mean())
        self.spread = require_positive("spread", spread, "[m]")

    def of_tool(
        self, pose: ArrayLike, contacts: Contacts, wrench: ArrayLike, centre: ArrayLike
    ) -> Array:
        """Return the force on each taxel of a rigid tool (n, 3) [N], world axes.

        Their sum is the wrench's force, and their moment about the centre its torque. Parts that
        belong to no contact, such as the torque of a wide contact between meshes, are spread from
        the deepest one.

        Parameters
        ----------
        pose : (7,)
            Of the tool's frame: position [m], unit quaternion wxyz.
        contacts : Contacts
            Of the solver at this pose.
        wrench : (6,)
            The solver's: force [N], torque about the centre of mass [N m], world axes.
        centre : (3,)
            Centre of mass in the tool's frame [m].
        """
        place, total = require_pose(pose, "pose"), np.array(require_finite("wrench", wrench, 6))
        turn, count = rotation_of(place[3:]), int(contacts.count[0])
        out = np.zeros_like(self.places)
        if not count:
            return out
        middle = place[:3] + turn @ np.array(require_finite("centre", centre, 3))
        points, forces = contacts.point[:count], contacts.force[:count]
        rest = total[:3] - forces.sum(axis=0)
        torque = total[3:] - np.cross(points - middle, forces).sum(axis=0)
        deepest = int(contacts.depth[:count].argmax())
        torque -= np.cross(points[deepest] - middle, rest)
        for number, (point, force) in enumerate(zip(points, forces, strict=True)):
            is_deepest = number == deepest
            whole = force + rest if is_deepest else force
            moment = turn.T @ torque if is_deepest else np.zeros(3)
            self.add(turn.T @ (point - place[:3]), turn.T @ whole, moment, out)
        return out @ turn.T

    def add(self, point: Array, force: Array, moment: Array, out: Array) -> None:
        """Spread a force [N] and a moment [N m] at a point [m] over the taxels near it, in `out`.

        All in the body's frame.
        """
        arms = self.places - point
        far = np.linalg.norm(arms, axis=1)
        near = np.flatnonzero(far <= max(_REACH * self.spread, np.sort(far)[:_FEWEST][-1]))
        if np.linalg.matrix_rank(arms[near] - arms[near].mean(axis=0), 1e-9) < 2:
            near = np.arange(len(far))
        arms, far = arms[near], far[near]
        weight = np.exp(-0.5 * ((far - far.min()) / self.spread) ** 2)
        weight /= weight.sum()
        forces = weight[:, None] * force
        # (a, b) is solved for so that `weight (a + b x arm)` has no force and the missing moment.
        scale = self.spread
        across = _cross_matrices(arms / scale)
        rows = np.concatenate([np.broadcast_to(np.eye(3), across.shape), across], axis=1)
        system = np.einsum("n,nij,nkj->ik", weight, rows, rows)
        missing = np.concatenate(
            [np.zeros(3), (moment - np.cross(arms, forces).sum(axis=0)) / scale]
        )
        forces += weight[:, None] * np.einsum("nij,i->nj", rows, np.linalg.solve(system, missing))
        out[near] += forces


def _cross_matrices(vectors: Array) -> Array:
    """Return for each vector the matrix of the cross product with it, (n, 3, 3)."""
    out = np.zeros((len(vectors), 3, 3))
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        out[:, i, j], out[:, i, k] = -vectors[:, k], vectors[:, j]
    return out

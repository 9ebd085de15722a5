"""Forces on the taxels of a tactile skin, whose sum and moment are exactly those of the contacts.

Every contact of the skin's geoms, textured or not, is spread over the taxels around it by
`contact.taxel_forces`.
"""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from asperity.contact.taxel_forces import TaxelForces
from asperity.errors import AsperityError
from asperity.mujoco.names import geom_name, resolve


class Taxels:
    """A tactile skin on the geoms of a body.

    Parameters
    ----------
    model : mujoco.MjModel
    name : str
        Of a geom or a body.
    places : (n, 3) array, or (rows, columns)
        Places of taxels in the body's frame [m], 3 or more that are not on a line; or a grid over
        the geom's surface (`surface_grid`).
    spread : float, optional
        Standard deviation of the Gaussian [m]; by default the mean distance of neighbours.

    Attributes
    ----------
    places : (n, 3) array
    body : int
        Number of the body in the model.

    Raises
    ------
    AsperityError
        A name that is not in the model; or places that are fewer than 3, not finite, or on a line.
    """

    def __init__(
        self, model: mujoco.MjModel, name: str, places: ArrayLike | tuple[int, int],
        spread: float | None = None,
    ) -> None:  # fmt: skip
        self._model = model
        named = resolve(model, {name: None})[0]
        if named.kind == "flex":
            raise AsperityError(f"{name!r} is a flex; taxels lie on a geom or a body")
        self._geoms = np.array(named.geoms)
        self.body = int(model.geom_bodyid[self._geoms[0]])
        if isinstance(places, tuple) and len(places) == 2:
            places = surface_grid(model, int(self._geoms[0]), *places)
        self._taxels = TaxelForces(places, spread)
        self.places = self._taxels.places

    def forces(self, data: mujoco.MjData) -> NDArray[np.float64]:
        """Return the force on each taxel (n, 3) [N], in the body's frame, as of the last step."""
        out = np.zeros_like(self.places)
        turn, at, found = data.xmat[self.body].reshape(3, 3), data.xpos[self.body], np.zeros(6)
        for i, (first, second) in enumerate(data.contact.geom if data.ncon else ()):
            on_first, on_second = first in self._geoms, second in self._geoms
            if on_first == on_second or data.contact.efc_address[i] < 0:
                continue
            mujoco.mj_contactForce(self._model, data, i, found)
            axes = data.contact.frame[i].reshape(3, 3)
            sign = 1.0 if on_second else -1.0
            force, moment = sign * turn.T @ axes.T @ found[:3], sign * turn.T @ axes.T @ found[3:]
            self._taxels.add(turn.T @ (data.contact.pos[i] - at), force, moment, out)
        return out

    def wrench(self, data: mujoco.MjData) -> NDArray[np.float64]:
        """Return force and moment of all taxels about the body's origin, (6,), body's frame."""
        forces = self.forces(data)
        return np.concatenate([forces.sum(axis=0), np.cross(self.places, forces).sum(axis=0)])


def surface_grid(model: mujoco.MjModel, geom: int, rows: int, columns: int) -> NDArray[np.float64]:
    """Return places of a grid over a geom's surface in its body's frame [m], (rows * columns, 3).

    On a box: its face towards +z. On spheres, ellipsoids, capsules and cylinders: rows along z,
    columns around it. On a mesh: the square of its texture coordinates, where it is covered.

    Raises
    ------
    AsperityError
        Another kind of geom, or a mesh without texture coordinates.
    """
    kind = mujoco.mjtGeom(int(model.geom_type[geom])).name[7:].lower()
    size = model.geom_size[geom]
    along, around = ((np.arange(n) + 0.5) / n for n in (rows, columns))
    if kind == "mesh":
        from asperity.mujoco.uv_grid import places_by_uv

        return places_by_uv(model, geom, along, around)
    s, t = (x.ravel() for x in np.meshgrid(2.0 * along - 1.0, 2.0 * np.pi * around, indexing="ij"))
    round_by = np.sqrt(1.0 - s**2)
    ring = np.stack([np.cos(t), np.sin(t)], axis=1)
    if kind == "box":
        local = np.stack([size[0] * s, size[1] * (t / np.pi - 1.0), 0.0 * s + size[2]], axis=1)
    elif kind in ("sphere", "ellipsoid"):
        axes = np.full(3, size[0]) if kind == "sphere" else size
        local = axes * np.column_stack([round_by[:, None] * ring, s])
    elif kind == "cylinder":
        local = np.column_stack([size[0] * ring, size[1] * s])
    elif kind == "capsule":
        height = (size[0] + size[1]) * s
        beyond = np.maximum(np.abs(height) - size[1], 0.0)
        radius = np.sqrt(size[0] ** 2 - beyond**2)
        local = np.column_stack([radius[:, None] * ring, height])
    else:
        raise AsperityError(
            f"{geom_name(model, geom)} is of type {kind}, over which there is no grid; "
            "give the places of the taxels"
        )
    turn = np.empty(9)
    mujoco.mju_quat2Mat(turn, model.geom_quat[geom])
    return np.asarray(local @ turn.reshape(3, 3).T + model.geom_pos[geom])

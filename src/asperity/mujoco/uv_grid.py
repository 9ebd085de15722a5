"""A grid of points over a mesh geom by its texture coordinates."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from asperity.mujoco.bodies import mesh_uv
from asperity.scene.mjcf import model_mesh


def places_by_uv(
    model: mujoco.MjModel, geom: int, along: NDArray[np.float64], around: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the points of a mesh geom at texture coordinates, in its body's frame [m], (n, 3).

    Parameters
    ----------
    model : mujoco.MjModel
    geom : int
    along, around : (rows,) and (columns,) arrays
        v and u; points that no triangle covers are dropped.

    Raises
    ------
    AsperityError
        The mesh has no texture coordinates.
    """
    vertices, faces = model_mesh(model, int(model.geom_dataid[geom]))
    corners, wanted = mesh_uv(model, geom), np.stack(np.meshgrid(around, along), axis=-1)
    turn = np.empty(9)
    mujoco.mju_quat2Mat(turn, model.geom_quat[geom])
    places = vertices @ turn.reshape(3, 3).T + model.geom_pos[geom]
    out = []
    for point in wanted.reshape(-1, 2):
        a, b, c = (corners[:, i] - point for i in range(3))
        parts = np.stack([_area(b, c), _area(c, a), _area(a, b)], axis=1)
        total = parts.sum(axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            shares = parts / total[:, None]
        inside = np.flatnonzero((shares >= -1e-9).all(axis=1) & (np.abs(total) > 0.0))
        if inside.size:
            out.append(shares[inside[0]] @ places[faces[inside[0]]])
    return np.array(out).reshape(-1, 3)


def _area(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return twice the signed areas between rows of vectors (n, 2)."""
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]

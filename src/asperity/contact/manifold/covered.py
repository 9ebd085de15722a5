"""Faces of geoms that other geoms of the same rigid body cover."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from asperity.geometry.bodies import KINDS

if TYPE_CHECKING:
    from asperity.contact.body_arrays import Geometry

_BOX, _CYLINDER = KINDS.index("box"), KINDS.index("cylinder")
_TOLERANCE = 1e-6
"""Distance over a face's size within which another geom covers it."""


def covered_faces(
    geometry: Geometry, frames: NDArray[np.float64], group: NDArray[Any]
) -> NDArray[np.int64]:
    """Return which flat faces of each geom are covered by another geom of its rigid body.

    Parameters
    ----------
    geometry : Geometry
    frames : (bodies, 3, 4) array
        Of the bodies [m].
    group : (bodies,) array
        Bodies with the same number are one rigid body.

    Returns
    -------
    (geoms,) array
        Bit `2 axis + side` for each face: all six of a box, the two ends of a cylinder.
    """
    covered = np.zeros(len(geometry.kind), np.int64)
    axes, centres = _geom_frames(geometry, frames)
    group = group[geometry.body]
    flat = np.isin(geometry.kind, (_BOX, _CYLINDER))
    radius = np.array([_radius(k, s) for k, s in zip(geometry.kind, geometry.size, strict=True)])
    for g in np.flatnonzero(flat).tolist():
        near = np.linalg.norm(centres - centres[g], axis=1) < radius + radius[g]
        near &= group == group[g]
        near[g] = False
        for axis in (0, 1, 2) if geometry.kind[g] == _BOX else (2,):
            for side in range(2):
                corners = axes[g] @ _corners(geometry, g, axis, 2 * side - 1).T
                for h in np.flatnonzero(near):
                    local = axes[h].T @ (corners + (centres[g] - centres[h])[:, None])
                    if _is_inside(geometry.kind[h], geometry.size[h], local).all():
                        covered[g] |= 1 << (2 * axis + side)
    return covered


def _geom_frames(
    geometry: Geometry, frames: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return axes (geoms, 3, 3) and centres (geoms, 3) of all geoms."""
    own = frames[geometry.body]
    axes = own[:, :, :3] @ geometry.rotation
    return axes, own[:, :, 3] + np.einsum("gij,gj->gi", own[:, :, :3], geometry.position)


def _radius(kind: int, size: NDArray[np.float64]) -> float:
    """Return the radius of a geom's bounding sphere [m]; infinite for a plane."""
    return np.inf if KINDS[kind] == "plane" else float(np.linalg.norm(size) + size[0])


def _corners(geometry: Geometry, g: int, axis: int, sign: int) -> NDArray[np.float64]:
    """Return the corners (n, 3) of a flat face or its rim, moved slightly outwards and inwards."""
    size = geometry.size[g]
    if geometry.kind[g] == _CYLINDER:
        turn = np.linspace(0.0, 2.0 * np.pi, 32, endpoint=False)
        rim = size[0] * (1.0 - _TOLERANCE)
        rows = np.column_stack([rim * np.cos(turn), rim * np.sin(turn), np.zeros(32)])
        half = size[1]
    else:
        signs = np.array([(i, j) for i in (-1, 1) for j in (-1, 1)], dtype=float)
        rows = np.zeros((4, 3))
        rows[:, [(axis + 1) % 3, (axis + 2) % 3]] = signs
        rows *= size * (1.0 - _TOLERANCE)
        half = size[axis]
    rows[:, axis] = sign * (half + _TOLERANCE * size.max())
    return rows


def _is_inside(kind: int, size: NDArray[np.float64], p: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which points (3, n), given in a geom's frame, lie within it."""
    name = KINDS[kind]
    inside: NDArray[np.bool_] = np.zeros(p.shape[1], bool)
    across = np.hypot(p[0], p[1])
    if name == "plane":
        inside = p[2] < 0.0
    elif name == "sphere":
        inside = np.linalg.norm(p, axis=0) < size[0]
    elif name == "ellipsoid":
        inside = np.linalg.norm(p / size[:, None], axis=0) < 1.0
    elif name == "capsule":
        inside = np.hypot(across, np.maximum(np.abs(p[2]) - size[1], 0.0)) < size[0]
    elif name == "cylinder":
        inside = (across < size[0]) & (np.abs(p[2]) < size[1])
    elif name == "box":
        inside = np.all(np.abs(p) < size[:, None], axis=0)
    return inside

"""Sizes of a body's surface that do not depend on its tessellation or pose, and convexity."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from asperity.geometry.bodies import Body
from asperity.geometry.convex.pieces import CONVEX_UP_TO, is_convex
from asperity.geometry.facets.facets import Facets

_SAME_PLANE, _OFF_ROUND_NUMBERS = 1e-3, 0.2137
"""Width of the bins of normals, and of offsets over a body's size, and their shift, in bins, which
keeps round numbers off the bins' borders."""


def flat_area(facets: Facets) -> float:
    """Return the mean area of plane faces, weighted by their areas [m^2].

    Facets belong to one face if their normals and offsets are in the same bins.
    """
    area = _triangles(facets)[1].sum(axis=1)
    normal, origin = facets.axes[:, 2], facets.origin
    size = max(float(np.linalg.norm(np.ptp(origin, axis=0))), 1e-9)
    offset = np.einsum("ij,ij->i", normal, origin - origin.mean(axis=0)) / size
    bins = np.floor(np.column_stack([normal, offset]) / _SAME_PLANE + _OFF_ROUND_NUMBERS)
    _, face = np.unique(bins, axis=0, return_inverse=True)
    areas = np.bincount(face.ravel(), area)
    return float((areas**2).sum() / max(areas.sum(), 1e-30))


def surface_width(facets: Facets) -> float:
    """Return the second largest standard deviation of a surface along its principal axes [m].

    It is the thickness of a long tool, but not that of a thin plate.
    """
    corners, area = _triangles(facets)
    corners, area = corners.reshape(-1, 3, 3), area.ravel()
    total = max(area.sum(), 1e-30)
    mean = area @ corners.mean(axis=1) / total
    corners = corners - mean
    # The integral of x x^T over a triangle, from its corners and their sum.
    around = np.einsum("t,tci,tcj->ij", area, corners, corners)
    whole = np.einsum("t,ti,tj->ij", area, corners.sum(axis=1), corners.sum(axis=1))
    return float(np.sqrt(np.linalg.eigvalsh((around + whole) / (12.0 * total))[1]))


def _triangles(facets: Facets) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the triangles of each facet, a fan from its first corner, and their areas [m^2].

    Shapes (facets, 6, 3, 3) [m] and (facets, 6); triangles beyond a facet's corners have no area.
    """
    points, last = facets.points, facets.points.shape[1] - 1
    first = np.broadcast_to(points[:, :1], points[:, 1:last].shape)
    corners = np.stack([first, points[:, 1:last], points[:, 2:]], axis=2)
    one, other = corners[..., 1, :] - first, corners[..., 2, :] - first
    area = 0.5 * np.linalg.norm(np.cross(one, other), axis=-1)
    return corners, np.where(np.arange(2, last + 1) < facets.sides[:, None], area, 0.0)


def is_convex_body(body: Body) -> bool:
    """Return whether a body is one convex geom, or a mesh that is convex but for fine marks."""
    if body.mesh is None:
        return len(body.geoms) == 1
    return is_convex(body.mesh.vertices, body.mesh.faces, CONVEX_UP_TO)

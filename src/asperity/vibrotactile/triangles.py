"""Where a force and a speed lie in a triangulation of models, and how much of each model that is.

Places are (speed, force), each divided by its largest, so that a distance across both makes sense.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.spatial import Delaunay, QhullError

from asperity._core.arrays import Array, Indices
from asperity._core.kernels import kernel
from asperity.errors import AsperityError

_RIM = 5
"""Models along each side of the plane where nothing was recorded."""
_ONE = 1.05
"""Speeds, or forces, are one if the largest is at most so many times the least."""
_FLAT = 1e-10
"""A triangle of less than this area (of 1 x 1) is none."""


class Triangulation(NamedTuple):
    """Triangles over scaled places, as kernels read them."""

    places: Array
    """(n, 2), between 0 and 1."""
    triangles: Indices
    """(m, 3) places of each, counted from 0."""
    inverses: Array
    """(m, 2, 2): from a place less the third corner to the weights of the first two."""
    rim: Indices
    """(r, 2) places of the edges that belong to one triangle only."""
    scale: Array
    """(2,) what places were divided by: m/s and N."""


def triangulated(
    speeds: Array, forces: Array, triangles: Indices | None = None, *, stretch: float = 1.0
) -> Triangulation:
    """Return the triangulation of models at `speeds` [m/s] and `forces` [N], (n,) each.

    Without `triangles` (m, 3) it is Delaunay's, of the scaled places, of which speeds count
    `stretch` times: the larger, the rather are neighbours of about one speed.

    Raises
    ------
    AsperityError
        The places span no triangle, or a triangle names a place that is not there.
    """
    scale = np.array([max(float(speeds.max()), 1e-12), max(float(forces.max()), 1e-12)])
    places = np.ascontiguousarray(np.column_stack([speeds, forces]) / scale)
    if triangles is None:
        try:
            triangles = Delaunay(places * [stretch, 1.0]).simplices.astype(np.int64)
        except (QhullError, ValueError):
            triangles = np.empty((0, 3), np.int64)
    if triangles.size and not (triangles.min() >= 0 and triangles.max() < len(places)):
        raise AsperityError(
            f"a triangle names model {int(triangles.max()) + 1}; valid: 1 to {len(places)}"
        )
    corners = places[triangles]
    edges = corners[:, :2] - corners[:, 2:]
    areas = 0.5 * np.abs(edges[:, 0, 0] * edges[:, 1, 1] - edges[:, 0, 1] * edges[:, 1, 0])
    inside = areas > _FLAT
    triangles = np.ascontiguousarray(triangles[inside])
    if not len(triangles):
        raise AsperityError(
            f"{len(places)} models lie on one line in force and speed; at least two speeds and "
            "two forces are needed"
        )
    inverses = np.linalg.inv(np.swapaxes(edges[inside], 1, 2))
    return Triangulation(places, triangles, np.ascontiguousarray(inverses), _rim(triangles), scale)


def without_slivers(mesh: Triangulation) -> Indices:
    """Return the triangles (m, 3) of a mesh without those along its rim between models in a line.

    Models recorded at one speed, or one force, stand in a line but for chance. Where the middle one
    stands a little inside, the rim passes it by, and so would all places beyond the rim.
    """
    corners = mesh.places[mesh.triangles]
    in_line = (corners.max(axis=1) <= _ONE * corners.min(axis=1)).any(axis=1)
    triangles = mesh.triangles
    while True:
        rim = set(map(tuple, _rim(triangles).tolist()))
        edges = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]], axis=2).tolist()
        outside = [any(tuple(edge) in rim for edge in own) for own in edges]
        drop = in_line & np.array(outside)
        if not drop.any() or drop.all():
            return np.ascontiguousarray(triangles)
        triangles, in_line = triangles[~drop], in_line[~drop]


def rim_places(places: Array) -> list[Array]:
    """Return places on the rim of the unit square where no model of `places` (n, 2) stands."""
    rim, out = [], []
    for k in range(_RIM):
        s = k / (_RIM - 1)
        rim += [(0.0, s), (s, 0.0), (1.0, s), (s, 1.0)]
    for place in dict.fromkeys(rim):
        nearest = float(np.linalg.norm(places - place, axis=1).min())
        close = nearest < 0.5 / (_RIM - 1)
        # Where a model stands close by, the corner alone is needed to close the plane.
        if 0.0 in place or not close or (place == (1.0, 1.0) and nearest > 0.0):
            out.append(np.array(place))
    return out


def _rim(triangles: Indices) -> Indices:
    edges = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    named, counts = np.unique(np.sort(edges, axis=1), axis=0, return_counts=True)
    return np.ascontiguousarray(named[counts == 1])


@kernel
def weigh(mesh, speed, force, first, corners, weights):
    """Fill the three models at a place and their weights; return the triangle, -1 on the rim.

    Beyond the triangulation it is the nearest place on its rim. `first` is looked at first.
    """
    x, y = speed / mesh.scale[0], force / mesh.scale[1]
    count = mesh.triangles.shape[0]
    for i in range(count + 1):
        t = i - 1 if i > 0 else first
        if t < 0 or t >= count:
            continue
        last = mesh.triangles[t, 2]
        dx, dy = x - mesh.places[last, 0], y - mesh.places[last, 1]
        a = mesh.inverses[t, 0, 0] * dx + mesh.inverses[t, 0, 1] * dy
        b = mesh.inverses[t, 1, 0] * dx + mesh.inverses[t, 1, 1] * dy
        c = 1.0 - a - b
        if a >= -1e-12 and b >= -1e-12 and c >= -1e-12:
            for k in range(3):
                corners[k] = mesh.triangles[t, k]
            a, b, c = max(a, 0.0), max(b, 0.0), max(c, 0.0)
            whole = a + b + c
            weights[0], weights[1], weights[2] = a / whole, b / whole, c / whole
            return t
    nearest = np.inf
    for i in range(mesh.rim.shape[0]):
        p, q = mesh.rim[i, 0], mesh.rim[i, 1]
        ex = mesh.places[q, 0] - mesh.places[p, 0]
        ey = mesh.places[q, 1] - mesh.places[p, 1]
        dx, dy = x - mesh.places[p, 0], y - mesh.places[p, 1]
        s = min(max((dx * ex + dy * ey) / (ex * ex + ey * ey), 0.0), 1.0)
        away = (dx - s * ex) ** 2 + (dy - s * ey) ** 2
        if away < nearest:
            nearest = away
            corners[0], corners[1], corners[2] = p, q, q
            weights[0], weights[1], weights[2] = 1.0 - s, s, 0.0
    return -1

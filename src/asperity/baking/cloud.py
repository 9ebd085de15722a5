"""Conversion of points that cover one side of an object, as from a scanner, to a height map.

The plane of the map is the one that fits the points best. At each sample a plane is fitted to the
surrounding points with weights that decrease with distance (moving least squares: Levin, Math.
Comp. 67, 1517 (1998)), which averages noise and accepts unevenly distributed points. It needs no
normals and leaves gaps where there are no points. A map has one height at each position, so points
all around a body are refused: make a mesh of them with another program and bake that.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.spatial import ConvexHull, KDTree, QhullError

from asperity._core.arrays import Array
from asperity.baking.fill import filled
from asperity.errors import AsperityError
from asperity.texture.height_field import HeightField

_NEIGHBOURS = 16
_REACH = 1.2
"""Length scale of a point's weight [mean distances between points]."""
_FARTHEST = 3.0
"""A sample with no points within this distance is filled from others [mean distances]."""
_ASTRAY = 4.0
"""A point farther from the local fit than this is not part of a sheet [mean distances]."""
_FEW = 0.02
_SAMPLES = 1.2
"""Samples per distance between points."""


def map_of_points(points: Array, *, size: int) -> HeightField:
    """Return a height map of points that are one side of a surface.

    Parameters
    ----------
    points : (n, 3) array
        [m].
    size : int
        Largest number of samples along the longer side. The density of the points limits it too.

    Returns
    -------
    HeightField
        Clamped; its notes give the plane and the share that was filled.

    Raises
    ------
    AsperityError
        Points that are not a single sheet as seen along the normal of that plane; one line.
    """
    axes = _axes(points)
    flat = (points - points.mean(axis=0)) @ axes.T
    low, high = flat.min(axis=0), flat.max(axis=0)
    spread = high - low
    if not spread[:2].min() > 0.0:
        raise AsperityError("the points lie on a line; valid: points of a surface")
    away = np.asarray(KDTree(flat[:, :2]).query(flat[:, :2], k=2)[0])[:, 1]
    apart = max(float(np.median(away)), math.sqrt(spread[0] * spread[1] / len(flat)))
    pixel = max(apart / _SAMPLES, float(spread[:2].max()) / size)
    columns, rows = (max(4, math.ceil(s / pixel)) for s in spread[:2])
    tree = KDTree(flat[:, :2])
    _refuse_several_sheets(flat, tree, apart)
    u, v = (low[k] + (np.arange(n) + 0.5) * pixel for k, n in ((0, columns), (1, rows)))
    grid = np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)
    heights = _fitted(flat, tree, grid, max(apart, pixel)).reshape(rows, columns)
    lacking = ~np.isfinite(heights)
    if lacking.all():
        raise AsperityError("the points are too far from each other for a surface")
    normal = ", ".join(f"{x:.3g}" for x in axes[2])
    notes = [
        f"{len(points)} points, {1e6 * apart:.3g} um apart: {columns} x {rows} heights over the "
        f"plane that fits them best, seen from ({normal})"
    ]
    if lacking.any():
        notes.append(f"{100 * lacking.mean():.3g} % of the map has no points near and is filled")
    return HeightField(filled(heights), pixel, "clamp", notes)


def _axes(points: Array) -> Array:
    """Return u, v and the upward normal (3, 3), in rows, of the plane that fits best.

    u runs along the side of the smallest bounding rectangle that is nearest to x.
    """
    away = points - points.mean(axis=0)
    normal = np.linalg.eigh(away.T @ away)[1][:, 0]
    # The sign of the normal is free: upwards, or else towards +y or +x.
    sign = next((np.sign(normal[k]) for k in (2, 1, 0) if abs(normal[k]) > 0.1), 1.0)
    normal = normal * sign
    first = np.eye(3)[0 if abs(normal[0]) < 0.9 else 1]
    u = first - (first @ normal) * normal
    u /= np.linalg.norm(u)
    v = np.cross(normal, u)
    turn = _smallest_rectangle(away @ np.stack([u, v], axis=1))
    u, v = np.cos(turn) * u + np.sin(turn) * v, np.cos(turn) * v - np.sin(turn) * u
    return np.array([u, v, normal])


def _smallest_rectangle(flat: Array) -> float:
    """Return the angle of the smallest rectangle around points (n, 2), -45 to 45 degrees [rad]."""
    try:
        corners = flat[ConvexHull(flat).vertices]
    except QhullError:
        raise AsperityError("the points lie on a line; valid: points of a surface") from None
    sides = np.roll(corners, -1, axis=0) - corners
    quarter = 0.5 * np.pi
    turns = np.arctan2(sides[:, 1], sides[:, 0])
    turns = turns - quarter * np.round(turns / quarter)
    areas = []
    for turn in turns:
        c, s = np.cos(turn), np.sin(turn)
        areas.append(np.ptp(corners @ [c, s]) * np.ptp(corners @ [-s, c]))
    return float(turns[int(np.argmin(areas))])


def _fitted(flat: Array, tree: KDTree, places: Array, apart: float) -> Array:
    """Return the heights (k,) of planes fitted to the points around positions (k, 2), or NaN."""
    out = np.full(len(places), np.nan)
    count = min(_NEIGHBOURS, len(flat))
    for start in range(0, len(places), 100_000):
        part = slice(start, start + 100_000)
        away, near = (np.asarray(found) for found in tree.query(places[part], k=count))
        weight = np.exp(-((away / (_REACH * apart)) ** 2)) + 1e-9
        offset = (flat[near, :2] - places[part][:, None]) / apart
        basis = np.concatenate([np.ones((*away.shape, 1)), offset], axis=2)
        left = np.einsum("nk,nki,nkj->nij", weight, basis, basis)
        left += 1e-9 * np.trace(left, axis1=1, axis2=2)[:, None, None] * np.diag([0.0, 1.0, 1.0])
        right = np.einsum("nk,nki,nk->ni", weight, basis, flat[near, 2])
        heights = np.linalg.solve(left, right[..., None])[:, 0, 0]
        out[part] = np.where(away[:, 0] <= _FARTHEST * apart, heights, np.nan)
    return out


def _refuse_several_sheets(flat: Array, tree: KDTree, apart: float) -> None:
    fit = _fitted(flat, tree, flat[:, :2], apart)
    astray = np.abs(flat[:, 2] - fit) > _ASTRAY * apart
    share = float(astray.mean())
    if share > _FEW:
        raise AsperityError(
            f"the points are no height map: {100 * share:.3g} % of them lie more than "
            f"{1e3 * _ASTRAY * apart:.3g} mm from the surface through those round them, as seen "
            "from the plane that fits best; valid: points of one side, or a mesh made of them"
        )

"""Conversion of points that cover one side of an object, as from a scanner, to a height map.

The plane of the map is the one that fits the points best. At each sample a polynomial is fitted to
the surrounding points (`local_fit`); which one is found by leaving points out, so that noise is
averaged where there is any, and detail kept where there is none. It needs no normals and leaves
gaps where there are no points. The error of the map is its distance from points that were left out
when it was made. A map has one height at each position, so points all around a body are refused:
make a mesh of them with another program and bake that.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy.spatial import ConvexHull, KDTree, QhullError

from asperity._core.arrays import Array, Mask
from asperity.baking.fill import filled
from asperity.baking.local_fit import SMOOTH, LocalFit, best_fit
from asperity.errors import AsperityError
from asperity.geometry.mesh.checks import count_of
from asperity.texture.height_field import HeightField

_ASTRAY = 4.0
"""A point farther from the local fit than this is not part of a sheet [mean distances]."""
_FEW = 0.02
_SAMPLES = 1.3
"""Samples per distance between points."""
_LEFT_OUT = 0.05
"""Share of the points from which the error is measured."""
_MOST_LEFT_OUT = 20_000
_WINDOW = 400
"""Samples a side of the part of a map in which the error is measured."""
_WAVES = (2.5, 3.0, 4.0, 5.0, 6.0, 8.0, 12.0, 16.0, 24.0)
"""Lengths of waves of which it is said how much is left [mean distances between points]."""
_KEPT = (0.95, 0.9, 0.7)


class MapOfPoints(NamedTuple):
    """A height map, and the heights of points that were left out above or below it [m]."""

    field: HeightField
    left_out: Array


def map_of_points(points: Array, *, size: int, seed: int = 0) -> MapOfPoints:
    """Return a height map of points that are one side of a surface.

    Parameters
    ----------
    points : (n, 3) array
        [m].
    size : int
        Largest number of samples along the longer side. The density of the points limits it too.
    seed : int
        Of the choice of the points that are left out to measure the error.

    Returns
    -------
    MapOfPoints
        The field is clamped, and made of all points; its notes give the plane, the waves that it
        keeps, and the share that was filled.

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
    notes = []
    astray = _astray(flat, apart)
    if astray.any():
        flat = flat[~astray]
        notes.append(
            f"{count_of(astray.sum(), 'point')} left out, more than {1e3 * _ASTRAY * apart:.3g} mm "
            "from the surface through the others"
        )
    fit = best_fit(flat, apart)
    u, v = (low[k] + (np.arange(n) + 0.5) * pixel for k, n in ((0, columns), (1, rows)))
    grid = np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)
    wide = max(apart, pixel)
    heights = fit.heights(flat, grid, wide).reshape(rows, columns)
    lacking = ~np.isfinite(heights)
    if lacking.all():
        raise AsperityError("the points are too far from each other for a surface")
    normal = ", ".join(f"{x:.3g}" for x in axes[2])
    notes += [
        f"{len(points)} points, {1e6 * apart:.3g} um apart: {columns} x {rows} heights over the "
        f"plane that fits them best, seen from ({normal})",
        _waves_note(flat, fit, grid, wide, pixel),
    ]
    if lacking.any():
        notes.append(f"{100 * lacking.mean():.3g} % of the map has no points near and is filled")
    away = _left_out(flat, fit, low[:2], grid.reshape(rows, columns, 2), (wide, pixel), seed)
    notes.append(
        f"the error is that of {len(away)} points left out of the map; noise of the points is in it"
    )
    return MapOfPoints(HeightField(filled(heights), pixel, "clamp", notes), away)


def _left_out(
    flat: Array, fit: LocalFit, low: Array, grid: Array, scales: tuple[float, float], seed: int
) -> Array:
    """Return how far points lie above or below a map that is made without them [m].

    In the middle of large maps only, as many samples as there is time for.
    """
    wide, pixel = scales
    for most in (_WINDOW, max(grid.shape)):
        window = [slice(max(0, (n - most) // 2), (n + most) // 2) for n in grid.shape[:2]]
        part = grid[tuple(window)]
        corner = low + pixel * np.array([window[1].start, window[0].start])
        ends = corner + pixel * np.array(part.shape[1::-1])
        there = (flat[:, :2] >= corner) & (flat[:, :2] <= ends)
        inside = np.flatnonzero(there.all(axis=1))
        if len(inside) >= _MOST_LEFT_OUT * _LEFT_OUT or most >= max(grid.shape):
            break
    count = max(1, min(round(_LEFT_OUT * len(inside)), _MOST_LEFT_OUT))
    out = np.random.default_rng(seed).permutation(inside)[:count]
    heights = fit.heights(np.delete(flat, out, axis=0), part.reshape(-1, 2), wide)
    rest = HeightField(filled(heights.reshape(part.shape[:2])), pixel, "clamp")
    return np.asarray(flat[out, 2] - rest.heights(*(flat[out, :2] - corner).T))


def _waves_note(flat: Array, fit: LocalFit, grid: Array, wide: float, pixel: float) -> str:
    """Return how much the map keeps of waves of several lengths, that its points lie on."""
    some = grid[:: max(1, len(grid) // 2000)]
    kept: dict[float, float] = {}
    for length in _WAVES:
        wave = length * wide
        if wave < 2.0 * pixel:
            continue
        total = 0.0
        for axis in (0, 1):
            phases = 2.0 * np.pi * flat[:, axis] / wave
            seen = fit.heights(np.column_stack([flat[:, :2], np.sin(phases)]), some, wide)
            phases = 2.0 * np.pi * some[:, axis] / wave
            good = np.isfinite(seen)
            if not good.any():
                continue
            basis = np.stack([np.sin(phases), np.cos(phases), np.ones(len(some))], axis=1)[good]
            part = np.linalg.lstsq(basis, seen[good], rcond=None)[0]
            total += 0.5 * float(np.hypot(part[0], part[1]))
        kept[1e3 * wave] = total
        if total >= _KEPT[0]:
            break
    limits = [
        f"{100 * share:.0f} % of the amplitude of waves of {length:.3g} mm"
        for share in _KEPT
        for length in [w for w, part in kept.items() if part >= share][:1]
    ]
    return f"it keeps {', '.join(limits) or 'little of any waves'}, less of shorter ones"


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


def _astray(flat: Array, apart: float) -> Mask:
    """Return which points are not part of the sheet; refuse them if they are many."""
    off = np.abs(flat[:, 2] - SMOOTH.heights(flat, flat[:, :2], apart))
    astray = off > _ASTRAY * apart
    share = float(astray.mean())
    if share > _FEW:
        raise AsperityError(
            f"the points are no height map: {100 * share:.3g} % of them lie more than "
            f"{1e3 * _ASTRAY * apart:.3g} mm from the surface through those round them, as seen "
            "from the plane that fits best; valid: points of one side, or a mesh made of them"
        )
    return np.asarray(astray)

"""Distances between a baked surface and the full one, in both directions, as in Metro.

Distances from points of the baked surface measure what is rendered but not present; distances from
points of the full surface measure what is present but not rendered (Cignoni, Rocchini & Scopigno,
Computer Graphics Forum 17, 167 (1998)). Rms, 99th percentile and maximum are each the larger of the
two directions.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

from asperity._core.arrays import Array, Indices
from asperity.baking.folder import Texture
from asperity.baking.heights import places
from asperity.baking.nearest import Nearest
from asperity.geometry.mesh.mesh import Mesh
from asperity.geometry.mesh.topology import crosses
from asperity.texture.height_field import HeightField

_SAMPLES = 60_000
_MOST = 500_000
"""Largest number of triangles, approximately, by which the baked surface is represented."""


class BakeError(NamedTuple):
    """Distances between two surfaces [m]; of the two directions the larger."""

    rms: float
    p99: float
    max: float


def bake_error(low: Mesh, field: HeightField, full: Array, *, seed: int = 0) -> BakeError:
    """Return the distance between the textured low-resolution mesh and the full surface.

    Parameters
    ----------
    low : Mesh
        With texture coordinates.
    field : HeightField
        Its texture.
    full : (m, 3, 3) array
        Corners of the full surface's triangles [m].
    seed : int
        Of the 60,000 random points on either surface, uniform over its area.
    """
    rng = np.random.default_rng(seed)
    face, weights = scattered(low.vertices[low.faces], _SAMPLES, rng)
    there = Nearest(full).to(displaced(low, field, face, weights))[1]
    face, weights = scattered(full, _SAMPLES, rng)
    points = np.einsum("ij,ijk->ik", weights, full[face])
    back = Nearest(_as_triangles(low, field)).to(points)[1]
    return BakeError(*map(max, statistics(there), statistics(back)))


def statistics(away: Array) -> BakeError:
    """Return the statistics of distances, or of heights above and below."""
    away = np.abs(away)
    return BakeError(
        float(np.sqrt(np.mean(away**2))), float(np.percentile(away, 99.0)), float(away.max())
    )


def plate_error(
    low: Mesh, heights: Path, texture: Texture, field: HeightField, *, seed: int = 0
) -> BakeError:
    """Return the distance of the top of a plate, as written, from a height map.

    Parameters
    ----------
    low : Mesh
        The slab, whose first two triangles are its top; the map is in the middle of it.
    heights : Path
        File of its texture.
    texture : Texture
    field : HeightField
        The map; its lowest sample is in the slab's plane.
    seed : int
        Of the 60,000 random points.
    """
    written = HeightField.from_file(heights, size=texture.size, unit="m")
    rng = np.random.default_rng(seed)
    face, weights = scattered(low.vertices[low.faces[:2]], _SAMPLES, rng)
    points = displaced(low, written, face, weights)
    u, v = (points[:, :2] + 0.5 * np.asarray(field.size)).T
    away = np.abs(points[:, 2] - (field.heights(u, v) - field.lowest))
    return statistics(away)


def scattered(triangles: Array, count: int, rng: np.random.Generator) -> tuple[Indices, Array]:
    """Return random points, uniform by area: triangles (k,) and weights of their corners (k, 3)."""
    area = np.linalg.norm(crosses(triangles), axis=1)
    face = np.sort(rng.choice(len(triangles), count, p=area / area.sum()))
    r, s = np.sqrt(rng.random(count)), rng.random(count)
    return face.astype(np.int64), np.stack([1.0 - r, r * (1.0 - s), r * s], axis=1)


def displaced(mesh: Mesh, field: HeightField, face: Indices, weights: Array) -> Array:
    """Return points of the textured surface [m], (n, 3), at points of the mesh."""
    assert mesh.uv is not None
    points, along = places(mesh, face, weights)
    u, v = (np.einsum("ij,ijk->ik", weights, mesh.uv[face]) * np.asarray(field.size)).T
    return np.asarray(points + field.heights(u, v)[:, None] * along)


def _as_triangles(low: Mesh, field: HeightField) -> Array:
    """Return the baked surface as triangles about as wide as a texel.

    The triangles of the low-resolution mesh are subdivided evenly, so its edges stay sharp.
    """
    triangles = low.vertices[low.faces]
    sides = np.linalg.norm(np.roll(triangles, -1, axis=1) - triangles, axis=2).max(axis=1)
    whole = 0.5 * np.linalg.norm(crosses(triangles), axis=1).sum()
    wide = max(field.pixel_size[0], float(np.sqrt(2.0 * whole / _MOST)))
    # Few different numbers of divisions, so that many triangles share one.
    divisions = np.ceil(2.0 ** (np.ceil(2.0 * np.log2(np.maximum(sides / wide, 1.0))) / 2.0))
    parts = []
    for n in np.unique(divisions.astype(np.int64)):
        which = np.flatnonzero(divisions == n)
        weights, corners = divided(int(n))
        face = np.repeat(which, len(weights))
        points = displaced(low, field, face, np.tile(weights, (len(which), 1)))
        parts.append(points.reshape(len(which), -1, 3)[:, corners].reshape(-1, 3, 3))
    return np.concatenate(parts)


def divided(divisions: int) -> tuple[Array, Indices]:
    """Return weights (k, 3) of the points of an evenly divided triangle, and its parts (m, 3)."""
    n = divisions
    i, j = (a.ravel() for a in np.indices((n + 1, n + 1)))
    i, j = i[i + j <= n], j[i + j <= n]
    number = np.zeros((n + 2, n + 2), dtype=np.int64)
    number[i, j] = np.arange(len(i))
    up, down = i + j < n, i + j < n - 1
    parts = [
        np.stack([number[i, j], number[i + 1, j], number[i, j + 1]], axis=1)[up],
        np.stack([number[i + 1, j], number[i + 1, j + 1], number[i, j + 1]], axis=1)[down],
    ]
    return np.stack([n - i - j, i, j], axis=1) / n, np.concatenate(parts)

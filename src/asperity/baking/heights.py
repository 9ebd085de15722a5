"""Heights of a full surface over a low-resolution one, as a texture.

Each texel inside a chart holds the distance to the full surface along the unit normal interpolated
there, along which the renderer displaces it. Texels whose ray finds no surface, and outliers whose
ray found another part of the body, are filled from their neighbours. The space between charts is
filled smoothly: it is never touched, but bounds of heights extend over it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.spatial import KDTree

from asperity._core.arrays import Array, Indices, Mask
from asperity.baking.fill import filled
from asperity.baking.nearest import Nearest
from asperity.baking.rays import FullSurface
from asperity.baking.texels import Texels, texels_of
from asperity.baking.unwrap import texture_span
from asperity.geometry.mesh.mesh import Mesh

_CAGE = 1.6
"""Range of the rays, in local distances between the two surfaces."""
_SAMPLED = 50_000
"""Largest number of triangles of the full surface used to estimate that distance, approximately."""
_SLACK = 2e-3
"""Addition to the range, in sizes of the mesh."""
_OUTLIER = 0.1, 8.0
"""Least deviation of an outlier from its surroundings, in cages and in texel widths."""
_ROWS = 64


class Baked(NamedTuple):
    """A texture of heights and statistics of its making.

    Attributes
    ----------
    heights : (n, n) float32 array
        [m], [iv, iu], row 0 at v = 0.
    texels : Texels
    coverage : float
        Share of the texels in charts whose ray found the full surface.
    mended : int
        Outliers in charts that were replaced from their neighbours.
    cage : float
        Longest range of any ray [m].
    """

    heights: NDArray[np.float32]
    texels: Texels
    coverage: float
    mended: int
    cage: float


def bake_heights(
    low: Mesh, full: Array, size: int, *, on_progress: Callable[[float], None] | None = None
) -> Baked:
    """Return the heights of a full surface over a mesh with texture coordinates.

    Parameters
    ----------
    low : Mesh
        With texture coordinates within 0..1, whose charts do not overlap.
    full : (m, 3, 3) array
        Corners of the full surface's triangles [m].
    size : int
        Texels along each side.
    on_progress : callable, optional
        Called with the share of the rays that are done, 0 to 1.
    """
    texels = texels_of(low, size)
    surface = FullSurface(full)
    cage = _cages(low, full)
    extent = float(np.ptp(low.vertices, axis=0).max())
    found = np.full(len(texels.face), np.nan)
    step = max(1, _ROWS * size)
    for start in range(0, len(found), step):
        part = slice(start, start + step)
        points, along = places(low, texels.face[part], texels.weights[part])
        face = texels.face[part]
        limit = np.einsum("ij,ij->i", cage[low.faces[face]], texels.weights[part])
        limit = limit + _SLACK * extent
        found[part] = surface.heights(points, along, limit)
        if on_progress is not None:
            on_progress(min(1.0, (start + step) / len(found)))
    inside = texels.inside
    coverage = float(np.isfinite(found[inside]).mean()) if inside.any() else 0.0
    grid = np.full((size, size), np.nan)
    grid[tuple(texels.where.T)] = found
    farthest = float(cage.max() + _SLACK * extent)
    texel = texture_span(low) / size
    doubted = _outliers(grid, max(_OUTLIER[0] * farthest, _OUTLIER[1] * texel))
    mended = int(np.count_nonzero(doubted[tuple(texels.where[inside].T)]))
    grid[doubted] = np.nan
    return Baked(filled(grid).astype(np.float32), texels, coverage, mended, farthest)


def places(mesh: Mesh, face: Indices, weights: Array) -> tuple[Array, Array]:
    """Return points of a mesh [m] and the unit normals for displacement there, (n, 3)."""
    points = np.einsum("ij,ijk->ik", weights, mesh.vertices[mesh.faces[face]])
    along = np.einsum("ij,ijk->ik", weights, mesh.normals[face])
    lengths = np.linalg.norm(along, axis=1, keepdims=True)
    return points, along / np.maximum(lengths, 1e-12)


def _cages(low: Mesh, full: Array) -> Array:
    """Return the range of rays from each vertex of a mesh [m], (n,).

    Each corner and centre of a full triangle is nearest to some triangle of the mesh; the rays of
    that triangle's vertices must reach at least as far.
    """
    every = max(1, len(full) // _SAMPLED)
    samples = np.concatenate([full[::every].reshape(-1, 3), full[::every].mean(axis=1)])
    face, away = Nearest(low.vertices[low.faces]).to(samples)
    of_face = np.zeros(len(low.faces))
    np.maximum.at(of_face, face, away)
    # Conversely, a triangle nearest to none gets its own distance from the full surface.
    middles = low.vertices[low.faces].mean(axis=1)
    of_face = np.maximum(of_face, KDTree(samples).query(middles)[0])
    out = np.zeros(len(low.vertices))
    np.maximum.at(out, low.faces.ravel(), np.repeat(of_face, 3))
    wide = out.copy()
    np.maximum.at(wide, low.faces.ravel(), np.repeat(out[low.faces].max(axis=1), 3))
    return _CAGE * wide


def _outliers(grid: Array, limit: float) -> Mask:
    """Return which heights differ from the local median by more than `limit`, in small clusters."""
    known = np.isfinite(grid)
    if not known.any():
        return np.zeros(grid.shape, dtype=bool)
    calm = np.where(known, grid, 0.0)
    near = ndimage.distance_transform_edt(~known, return_distances=False, return_indices=True)
    middle = ndimage.median_filter(calm[tuple(near)], size=5, mode="nearest")
    return np.asarray(known & (np.abs(grid - middle) > limit))

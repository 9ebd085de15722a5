"""Simplification of a mesh to a given number of triangles without loss of soundness.

`asperity.baking.collapse` preserves topology and folds nothing, so it may stop before it reaches
the number. Its limits are then relaxed step by step. The result with the fewest defects is
returned; among equals the one nearest to the number, then the one with the fewest folded corners.

The package fast-simplification collapses the edges below a rising threshold in the order of the
file, not the cheapest first. From 444,000 displaced triangles of a hammer it reached 984 with an
error of 0.40 mm (rms), or 2,000 with 2 mm, never 518; cheapest first gives 518 with 0.17 mm.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from asperity._core.arrays import Array, Indices
from asperity.baking.collapse import collapsed
from asperity.geometry.mesh.checks import SAME_PLACE, count_of, same_places
from asperity.geometry.mesh.crossings import crossing_triangles
from asperity.geometry.mesh.mesh import Mesh, mesh_from_arrays
from asperity.geometry.mesh.normals import smooth_normals
from asperity.geometry.mesh.topology import crosses, edges_of

_LIMITS = ((0.2, 0.03), (0.2, 0.0), (0.1, 0.0))
"""Least cosine between normals, and least quality of triangles; strict first."""
LEAST_FACING = 0.2
"""Least cosine, as for facets on which contact is searched."""
_FEW_FOLDED = 5e-3
"""Share of folded corners below which no second try is made."""
_NEAR_ENOUGH = 1.03
"""Accepted number of triangles, in the number wanted; a closed mesh has an even number."""


class Soundness(NamedTuple):
    """Defects of a surface, compared in this order; fewer is better."""

    borders: int
    """Edges with one triangle."""
    crowded: int
    """Edges with more than two triangles."""
    crossing: int
    """Triangles that cross another; 0 where there are too many to check."""
    folded: int = 0
    """Corners whose smooth normal deviates from the triangle's by 78 degrees or more: the texture
    would displace them sideways, and contact is not searched on them."""


def simplified(mesh: Mesh, faces: int) -> Mesh:
    """Return a mesh with about `faces` triangles, or more if fewer would add defects.

    Parameters
    ----------
    mesh : Mesh
    faces : int
        From 4 to the number of the mesh, for which the mesh is returned with coincident vertices
        merged.

    Returns
    -------
    Mesh
        With smooth normals and without texture coordinates. Its notes give the number of triangles
        if it is not about `faces`, and whether the mesh opened.
    """
    points, at = joined_places(mesh)
    if faces >= len(at):
        return mesh_from_arrays(points, at, hard_angle=180.0, name=mesh.name)
    middle = points.mean(axis=0)
    size = float(np.ptp(points, axis=0).max())
    scaled = (points - middle) / size
    before = soundness(scaled, at)
    tried: list[tuple[Any, ...]] = []
    for facing, quality in _LIMITS:
        found = collapsed(scaled, at, faces, facing=facing, quality=quality)
        now = soundness(*found)
        # Defects that the mesh already had do not count.
        worse = tuple(max(a - b, 0) for a, b in zip(now[:3], before[:3], strict=True))
        reached = max(len(found[1]), int(_NEAR_ENOUGH * faces))
        tried.append(((worse, reached, now.folded), found, now))
        few = len(found[1]) <= _NEAR_ENOUGH * faces
        if worse == (0, 0, 0) and few and now.folded <= _FEW_FOLDED * found[1].size:
            break
    _, (low, corners), now = min(tried, key=lambda one: one[0])
    made = mesh_from_arrays(low * size + middle, corners, hard_angle=180.0, name=mesh.name)
    notes = _notes(before, now, len(at), len(made.faces), faces)
    return Mesh(made.vertices, made.faces, made.normals, None, mesh.name, (*notes, *made.notes))


def joined_places(mesh: Mesh) -> tuple[Array, Indices]:
    """Return the distinct positions of a mesh's vertices (n, 3), and those of its triangles."""
    size = float(np.ptp(mesh.vertices, axis=0).max())
    places = same_places(mesh.vertices, SAME_PLACE * size)
    _, first = np.unique(places, return_index=True)
    return mesh.vertices[first], places[mesh.faces]


def soundness(points: Array, faces: Indices) -> Soundness:
    """Return the defects of triangles of distinct positions."""
    edges = edges_of(faces)
    crossing = crossing_triangles(np.asarray(points, dtype=np.float64)[faces], faces)
    return Soundness(
        int((edges.size == 1).sum()), int((edges.size > 2).sum()), int(crossing or 0),
        _folded(points, faces),
    )  # fmt: skip


def _folded(points: Array, faces: Indices) -> int:
    """Return the number of corners whose smooth normal is nearly in the plane of the triangle."""
    triangles = np.asarray(points, dtype=np.float64)[faces]
    facet = crosses(triangles)
    facet /= np.maximum(np.linalg.norm(facet, axis=1, keepdims=True), 1e-300)
    normals = smooth_normals(points, faces, faces, None, [])
    return int((np.einsum("ijk,ik->ij", normals, facet) < LEAST_FACING).sum())


def _notes(before: Soundness, now: Soundness, had: int, has: int, wanted: int) -> tuple[str, ...]:
    notes = []
    if has > _NEAR_ENOUGH * wanted:
        notes.append(
            f"simplification of {had} triangles stopped at {has}, {wanted} were wanted: with fewer "
            "it would open or run through itself"
        )
    if before.borders == 0 and now.borders:
        notes.append(f"simplification opened it: {count_of(now.borders, 'border edge')}")
    elif before.borders == 0 and now.crowded <= before.crowded:
        notes.append("it is closed as it was")
    if now.crowded > before.crowded:
        notes.append(f"simplification joined {count_of(now.crowded, 'edge')} of several sheets")
    if now.crossing > before.crossing:
        notes.append(f"after simplification {count_of(now.crossing, 'triangle')} cross another")
    if now.folded > before.folded:
        notes.append(
            f"{count_of(now.folded, 'corner')} of {3 * has} with a smooth normal nearly in the "
            "plane of the triangle: the surface is coarse there; more faces help"
        )
    return tuple(notes)

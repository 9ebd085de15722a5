"""A mesh with fewer triangles, as sound as it was.

`asperity.baking.collapse` keeps what is closed closed and folds nothing, so it may not reach the
number that is wanted. Its limits are then eased. Of the results the soundest is taken, of those
that are as sound the one nearest to the number, of those the one that is least folded.

Why not fast-simplification: it takes edges below a rising threshold in the order in which they
stand in the file, not the cheapest first. From 444,000 displaced triangles of a hammer it came to
984, 0.40 mm (rms) away, or 2,000 and 2 mm, never to 518; the cheapest first give 518 and 0.17 mm.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity.baking.collapse import collapsed
from asperity.geometry.mesh.checks import SAME_PLACE, count_of, same_places
from asperity.geometry.mesh.crossings import crossing_triangles
from asperity.geometry.mesh.mesh import Mesh, mesh_from_arrays
from asperity.geometry.mesh.normals import smooth_normals
from asperity.geometry.mesh.topology import crosses, edges_of

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
_LIMITS = ((0.2, 0.03), (0.2, 0.0), (0.1, 0.0))
"""Least cosine between normals, and quality of triangles: strict first."""
LEAST_FACING = 0.2
"""Cosine, as for facets that a contact may lie on."""
_FEW_FOLDED = 5e-3
"""Share of corners that need no second try."""
_NEAR_ENOUGH = 1.03
"""Times the number wanted; a closed mesh has an even number."""


class Soundness(NamedTuple):
    """What is wrong with a surface; less is better, compared in this order."""

    borders: int
    """Sides of triangles that no other meets."""
    crowded: int
    """Edges that more than two triangles meet."""
    crossing: int
    """Triangles that cross another; 0 where there are too many to look."""
    folded: int = 0
    """Corners whose smooth normal is 78 degrees or more off the triangle's: it would be displaced
    sideways, and no contact is looked for on it."""


def simplified(mesh: Mesh, faces: int) -> Mesh:
    """Return a mesh with about `faces` triangles, or as few as it can have and stay as sound.

    Parameters
    ----------
    mesh : Mesh
    faces : int
        4 to the mesh's own number; with that the mesh is returned as it is, vertices at one place
        made one.

    Returns
    -------
    Mesh
        With smooth normals and without texture coordinates. Its notes say how many triangles it
        has if these are not as many as wanted, and whether it opened.
    """
    points, at = joined_places(mesh)
    if faces >= len(at):
        return mesh_from_arrays(points, at, name=mesh.name)
    middle = points.mean(axis=0)
    size = float(np.ptp(points, axis=0).max())
    scaled = (points - middle) / size
    before = soundness(scaled, at)
    best: tuple[Any, ...] | None = None
    for facing, quality in _LIMITS:
        found = collapsed(scaled, at, faces, facing=facing, quality=quality)
        now = soundness(*found)
        # As sound as the mesh was is sound; the rest is compared by what is worse.
        worse = tuple(max(a - b, 0) for a, b in zip(now[:3], before[:3], strict=True))
        reached = max(len(found[1]), int(_NEAR_ENOUGH * faces))
        rank = (worse, reached, now.folded)
        if best is None or rank < best[0]:
            best = (rank, found, now)
        few = len(found[1]) <= _NEAR_ENOUGH * faces
        if worse == (0, 0, 0) and few and now.folded <= _FEW_FOLDED * found[1].size:
            break
    assert best is not None
    _, (low, corners), now = best
    made = mesh_from_arrays(low * size + middle, corners, name=mesh.name)
    notes = _notes(before, now, len(at), len(made.faces), faces)
    return Mesh(made.vertices, made.faces, made.normals, None, mesh.name, (*notes, *made.notes))


def joined_places(mesh: Mesh) -> tuple[Array, Indices]:
    """Return the places of a mesh's vertices (n, 3), each once, and those of its corners."""
    size = float(np.ptp(mesh.vertices, axis=0).max())
    places = same_places(mesh.vertices, SAME_PLACE * size)
    _, first = np.unique(places, return_index=True)
    return mesh.vertices[first], places[mesh.faces]


def soundness(points: Array, faces: Indices) -> Soundness:
    """Return what is wrong with triangles of places that are each there once."""
    edges = edges_of(faces)
    crossing = crossing_triangles(np.asarray(points, dtype=np.float64)[faces], faces)
    return Soundness(
        int((edges.size == 1).sum()), int((edges.size > 2).sum()), int(crossing or 0),
        _folded(points, faces),
    )  # fmt: skip


def _folded(points: Array, faces: Indices) -> int:
    """Return how many corners have smooth normals that are nearly in the plane of the triangle."""
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

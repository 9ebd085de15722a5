"""A mesh with fewer triangles, closed if it was closed, by quadric edge collapse.

fast-simplification (Garland & Heckbert, SIGGRAPH 97, in the variant of sp4cerat) goes on until a
threshold that grows with each pass is met. Growing slowly it keeps the shape and stops early;
growing fast it reaches any number, but may join what does not belong together or fold the surface
over. So several speeds are tried, and of those results that are as sound as the mesh was the one
that comes nearest to the number wanted is taken: the slowest of them.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity.errors import AsperityError
from asperity.geometry.mesh import Mesh, mesh_from_arrays
from asperity.geometry.mesh_checks import SAME_PLACE, count_of, facet_heights, same_places
from asperity.geometry.mesh_crossings import crossing_triangles
from asperity.geometry.mesh_topology import edges_of

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
_SPEEDS = (2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.5, 10.0)
"""fast-simplification's `agg`, slowest first."""
_NEAR_ENOUGH = 1.03
"""Times the number wanted; a closed mesh has an even number."""
_FLATTEST = 1e-5
"""Height of a triangle below which it is one side only, in sizes of the mesh."""


class Soundness(NamedTuple):
    """What is wrong with a surface; less is better, compared in this order."""

    borders: int
    """Sides of triangles that no other meets."""
    crowded: int
    """Edges that more than two triangles meet."""
    crossing: int
    """Triangles that cross another; 0 where there are too many to look."""


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

    Raises
    ------
    AsperityError
        fast-simplification not installed (`pip install asperity[bake]`); nothing left. One line.
    """
    points, at = joined_places(mesh)
    if faces >= len(at):
        return mesh_from_arrays(points, at, name=mesh.name)
    middle = points.mean(axis=0)
    size = float(np.ptp(points, axis=0).max())
    scaled = (points - middle) / size
    before = soundness(scaled, at)
    best: tuple[Any, ...] | None = None
    for speed in _SPEEDS:
        found = _collapsed(scaled, at, faces, speed)
        if found is None:
            continue
        now = soundness(*found)
        # As sound as the mesh was is sound; the rest is compared by what is worse.
        worse = tuple(max(a - b, 0) for a, b in zip(now, before, strict=True))
        reached = max(len(found[1]), int(_NEAR_ENOUGH * faces))
        rank = (worse, reached)
        if best is None or rank < best[0]:
            best = (rank, found, now)
        if worse == (0, 0, 0) and len(found[1]) <= _NEAR_ENOUGH * faces:
            break
    if best is None:
        raise AsperityError(
            f"mesh {mesh.name!r}: nothing is left of it with {faces} triangles; ask for more"
        )
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
        int((edges.size == 1).sum()), int((edges.size > 2).sum()), int(crossing or 0)
    )


def _collapsed(
    points: Array, faces: Indices, count: int, speed: float
) -> tuple[Array, Indices] | None:
    try:
        import fast_simplification
    except ImportError:
        raise AsperityError(
            "simplifying a mesh needs fast-simplification, which is not installed; "
            "valid: pip install asperity[bake], or as many faces as the mesh has"
        ) from None
    low, corners = fast_simplification.simplify(
        np.ascontiguousarray(points, dtype=np.float64), faces.astype(np.int32),
        target_count=count, agg=speed,
    )  # fmt: skip
    low, corners = np.asarray(low, dtype=np.float64), np.asarray(corners, dtype=np.int64)
    if not len(corners) or not np.isfinite(low).all():
        return None
    if (facet_heights(low[corners]) <= _FLATTEST).all():
        return None
    return low, corners


def _notes(
    before: Soundness, now: Soundness, had: int, has: int, wanted: int
) -> tuple[str, ...]:
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
    return tuple(notes)
